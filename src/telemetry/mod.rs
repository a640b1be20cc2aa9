//! What the service says about itself: log lines, and the identifier that ties them to requests.

mod logging;
pub mod metrics;
mod request;

pub use logging::{LogFormat, LoggingError, init_logging};
pub use request::{RequestId, request_id};
