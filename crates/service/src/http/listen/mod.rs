//! The listener: connections, their protocols and their time limits.
//!
//! `axum::serve` has no limits: a client may stall in a header or a body, or never read. Here every wait for a client, the number of
//! connections and shutdown are bounded. One port serves HTTP/1.1, HTTP/2 with prior knowledge and, under TLS, both by negotiation.

mod accept;
mod body;
mod connection;
mod head;
mod idle;
mod linger;
mod peers;
mod service;
mod shared_stream;
mod socket;
mod state;
mod tls;

pub use accept::serve;
pub use body::{BodyTimeout, is_body_timeout};
pub(crate) use state::{ConnectionHandle, Reason};
pub use tls::{Tls, TlsError, tls_config};

use std::time::Duration;

/// Limits on time, connections and headers.
#[derive(Clone, Debug)]
pub struct Limits {
    /// From the connection (or the first byte of a later request) to the end of the header, and for a TLS handshake.
    pub header_timeout: Duration,
    /// Longest pause of a request body while a handler waits for it.
    pub body_timeout: Duration,
    /// How long a connection without requests stays open.
    pub idle_timeout: Duration,
    /// Longest time without progress of a response. Long by default, since a paused viewer is legitimate; an upload on the same connection
    /// counts as progress.
    pub write_timeout: Duration,
    /// The same for responses to those who have not shown who they are, where it is shorter.
    pub stranger_write_timeout: Duration,
    /// How long open requests may go on after the stop signal.
    pub drain_timeout: Duration,
    /// Connections that are served.
    pub max_connections: usize,
    /// Further connections that get one answer of the spare router. Beyond, connections are closed at once.
    pub spare_connections: usize,
    /// Connections of one address on which nobody has shown who they are; beyond, idle ones of it are closed, or the new one is.
    pub max_per_address: usize,
    /// Whether responses have to be read at 16 KiB per second, beside pauses that add up to the write timeout.
    pub paced_readers: bool,
    /// Closed connections whose clients may still read the last response, beside those that are served; a quarter of them for an address on whose
    /// connections nobody has shown who they are.
    pub max_lingering: usize,
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
            stranger_write_timeout: Duration::from_secs(30),
            drain_timeout: Duration::from_secs(20),
            max_connections: 1024,
            spare_connections: 64,
            max_per_address: usize::MAX,
            paced_readers: true,
            max_lingering: 256,
            max_header_bytes: 32 << 10,
            max_headers: 100,
            max_h2_streams: 128,
        }
    }
}

impl Limits {
    /// How often connections look at the clock: often enough for the shortest limit, seldom enough to cost nothing.
    fn tick(&self) -> Duration {
        let shortest =
            self.header_timeout.min(self.idle_timeout).min(self.write_timeout).min(self.stranger_write_timeout);
        (shortest / 8).clamp(Duration::from_millis(10), Duration::from_secs(1))
    }
}
