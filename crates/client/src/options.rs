//! Connection options, time-outs and retries.

use std::time::Duration;

/// Connection options, time-outs and retries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientOptions {
    /// Longest wait for a connection.
    pub connect_timeout: Duration,
    /// Time without any transfer after which a connection counts as broken. It does not limit the duration of a transfer.
    pub idle_timeout: Duration,
    /// Consecutive retries without progress before a call gives up.
    pub retries: u32,
    /// Longest wait between attempts, unless the service asks for a longer one.
    pub max_backoff: Duration,
    /// Use HTTP/2 with prior knowledge on `http://` addresses if the server supports it; `https://` negotiates anyway. Over HTTP/1.1 an
    /// early refusal of a large body is often lost.
    pub http2: bool,
}

impl Default for ClientOptions {
    fn default() -> Self {
        Self {
            connect_timeout: Duration::from_secs(10),
            idle_timeout: Duration::from_secs(60),
            retries: 10,
            max_backoff: Duration::from_secs(30),
            http2: true,
        }
    }
}
