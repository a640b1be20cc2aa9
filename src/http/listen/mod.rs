//! The listener: connections, their protocols and their time limits.
//!
//! `axum::serve` lets a client stay for ever: it may say nothing, half a header or half a body, and it may never read. Here every
//! wait for a client has an end, the number of connections has one, and so has a shutdown. HTTP/1.1, HTTP/2 with prior
//! knowledge and, under TLS, both by negotiation are served on the same port.

mod accept;
mod body;
mod connection;
mod head;
mod linger;
mod service;
mod socket;
mod state;
mod tls;
mod waiting;

pub use accept::serve;
pub use body::{BodyTimeout, is_body_timeout};
pub use tls::{Tls, TlsError, tls_config};

use std::time::Duration;

/// What a client may take: time, connections and header space.
#[derive(Clone, Debug)]
pub struct Limits {
    /// From the connection (or the first byte of a later request) to the end of the header, and for a TLS handshake.
    pub header_timeout: Duration,
    /// Longest pause of a request body that somebody waits for. Pauses because the server does not read do not count.
    pub body_timeout: Duration,
    /// How long a connection without requests stays open.
    pub idle_timeout: Duration,
    /// Longest time in which a response's reader takes nothing. Long by default, since a paused viewer is legitimate; a client
    /// that still uploads on the same connection counts as alive.
    pub write_timeout: Duration,
    /// How long open requests may go on after the stop signal.
    pub drain_timeout: Duration,
    /// Connections that are served.
    pub max_connections: usize,
    /// Further connections that get one answer of the spare router. Beyond, connections are closed at once.
    pub spare_connections: usize,
    /// Size of a request's header, request line included, in bytes.
    pub max_header_bytes: usize,
    /// Number of a request's header lines.
    pub max_headers: usize,
    /// Simultaneous requests on one HTTP/2 connection.
    pub max_h2_streams: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            header_timeout: Duration::from_secs(10),
            body_timeout: Duration::from_secs(30),
            idle_timeout: Duration::from_secs(75),
            write_timeout: Duration::from_secs(300),
            drain_timeout: Duration::from_secs(20),
            max_connections: 1024,
            spare_connections: 64,
            max_header_bytes: 32 << 10,
            max_headers: 100,
            max_h2_streams: 128,
        }
    }
}

impl Limits {
    /// How often connections look at the clock: often enough for the shortest limit, seldom enough to cost nothing.
    fn tick(&self) -> Duration {
        let shortest = self.header_timeout.min(self.idle_timeout).min(self.write_timeout);
        (shortest / 8).clamp(Duration::from_millis(10), Duration::from_secs(1))
    }
}
