//! What the service says about itself: log lines, metrics, traces, and the identifier that ties them to requests.

mod logging;
pub mod metrics;
mod request;
pub mod traces;

pub use logging::{LogFormat, LoggingError, init_logging};
pub use request::{RequestId, request_id};
