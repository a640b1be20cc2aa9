//! HTTP/1.1 by hand, since well-made clients cannot be made to misbehave.

use crate::process::HANG;
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::time::timeout;

/// One connection.
pub(crate) struct Wire(pub(crate) TcpStream);

/// What came back on a connection until it closed or had all that was waited for.
#[derive(Debug)]
pub(crate) struct Heard {
    pub(crate) text: String,
    pub(crate) after: Duration,
}

impl Heard {
    /// The status; 0 where there was no answer.
    pub(crate) fn status(&self) -> u16 {
        self.text.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0)
    }
}

impl Wire {
    pub(crate) async fn connect(address: SocketAddr) -> Self {
        Self(TcpStream::connect(address).await.expect("a connection"))
    }

    /// Sends what can be sent; a server may have closed.
    pub(crate) async fn send(&mut self, bytes: impl AsRef<[u8]>) {
        let _ = timeout(HANG, self.0.write_all(bytes.as_ref())).await.expect("the server takes it");
    }

    /// A header of a POST with more header lines, each with its end.
    pub(crate) async fn post(&mut self, path: &str, lines: &str) {
        self.send(format!("POST {path} HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n")).await;
    }

    /// A chunk of a chunked body.
    pub(crate) async fn chunk(&mut self, bytes: &[u8]) {
        let mut chunk = format!("{:x}\r\n", bytes.len()).into_bytes();
        chunk.extend_from_slice(bytes);
        chunk.extend_from_slice(b"\r\n");
        self.send(chunk).await;
    }

    /// Reads until something is in the text, or the connection closes.
    pub(crate) async fn hear(&mut self, what: &str) -> Heard {
        let clock = Instant::now();
        let mut bytes = Vec::new();
        let listening = async {
            while !String::from_utf8_lossy(&bytes).contains(what) {
                // A reset is a way of closing, too.
                if self.0.read_buf(&mut bytes).await.unwrap_or(0) == 0 {
                    return;
                }
            }
        };
        let heard = timeout(HANG, listening).await;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        assert!(heard.is_ok(), "{what:?} does not come: {text}");
        Heard { text, after: clock.elapsed() }
    }

    /// Reads until the connection closes.
    pub(crate) async fn hear_all(&mut self) -> Heard {
        self.hear("\u{0}never").await
    }
}
