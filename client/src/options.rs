//! How a client connects and how patient it is.

use std::time::Duration;

/// How a client connects and how patient it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientOptions {
    /// Longest wait for a connection.
    pub connect_timeout: Duration,
    /// Longest time in which neither side moves a byte, before the connection counts as broken. It does not limit how long
    /// a transfer takes.
    pub idle_timeout: Duration,
    /// Attempts after a first one, in a row and without progress, before a call gives up.
    pub retries: u32,
    /// Longest wait between attempts, unless the service asks for a longer one.
    pub max_backoff: Duration,
    /// HTTP/2 with prior knowledge on `http://` addresses, where the server speaks it; on `https://` both sides agree anyway.
    /// Over HTTP/1.1 a server that refuses a large body early is often not heard.
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
