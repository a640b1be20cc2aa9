//! Log lines, metrics and traces, and the request identifier that connects them.

mod logging;
pub mod metrics;
mod request;
pub mod traces;
mod zeros;

pub use logging::{LogFormat, LoggingError, init_logging};
pub(crate) use logging::{log_filter, parts};
pub use request::{RequestId, request_id};
pub(crate) use zeros::REJECTIONS;
