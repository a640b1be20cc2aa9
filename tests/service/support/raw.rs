//! HTTP/1.1 by hand, where every byte and its moment matter.

use super::{HANG, Reply, TestApp, within};
use bytes::Bytes;
use http::{HeaderMap, HeaderName, HeaderValue};
use std::fmt::Write as _;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpSocket, TcpStream};

/// A connection.
pub(crate) struct Raw {
    stream: TcpStream,
    buffer: Vec<u8>,
    chunked: bool,
}

/// One chunk of a request body.
pub(crate) fn chunked(piece: &[u8]) -> Vec<u8> {
    [format!("{:x}\r\n", piece.len()).as_bytes(), piece, b"\r\n"].concat()
}

impl Raw {
    pub(crate) async fn connect(app: &TestApp) -> Self {
        let stream = TcpStream::connect(app.address).await.expect("a connection");
        stream.set_nodelay(true).expect("a socket option");
        Self { stream, buffer: Vec::new(), chunked: false }
    }

    /// A connection that takes little before it is read.
    pub(crate) async fn narrow(app: &TestApp) -> Self {
        let socket = TcpSocket::new_v4().expect("a socket");
        socket.set_recv_buffer_size(8 << 10).expect("a socket option");
        let stream = socket.connect(app.address).await.expect("a connection");
        Self { stream, buffer: Vec::new(), chunked: false }
    }

    pub(crate) async fn write(&mut self, bytes: &[u8]) {
        within("the service takes bytes", HANG, self.stream.write_all(bytes)).await.expect("it takes them");
    }

    /// Writes until the service closes or takes nothing for a moment; whether all went.
    pub(crate) async fn try_write(&mut self, bytes: &[u8]) -> bool {
        let limit = Duration::from_secs(3);
        matches!(tokio::time::timeout(limit, self.stream.write_all(bytes)).await, Ok(Ok(())))
    }

    /// Sends a request's head.
    pub(crate) async fn head(&mut self, method: &str, path: &str, headers: &[(&str, &str)]) {
        let mut text = format!("{method} {path} HTTP/1.1\r\nhost: localhost\r\n");
        for (name, value) in headers {
            write!(text, "{name}: {value}\r\n").expect("a text");
        }
        self.write(format!("{text}\r\n").as_bytes()).await;
    }

    /// Begins to post a body of unknown length.
    pub(crate) async fn post_chunked(&mut self, path: &str, headers: &[(&str, &str)]) {
        let mut all = vec![("transfer-encoding", "chunked"), ("content-type", super::OCTETS)];
        all.extend(headers);
        self.head("POST", path, &all).await;
    }

    /// Reads the head of the answer.
    pub(crate) async fn answer(&mut self) -> Reply {
        let end = loop {
            if let Some(at) = self.buffer.windows(4).position(|four| four == b"\r\n\r\n") {
                break at;
            }
            assert!(self.more().await, "the connection ended before an answer");
        };
        let head = String::from_utf8(self.buffer.drain(..end + 4).collect()).expect("ASCII");
        let mut lines = head.split("\r\n");
        let status = lines.next().and_then(|line| line.split(' ').nth(1)?.parse().ok()).expect("a status");
        let mut headers = HeaderMap::new();
        for (name, value) in lines.filter_map(|line| line.split_once(": ")) {
            let name = HeaderName::try_from(name).expect("a name");
            headers.append(name, HeaderValue::try_from(value).expect("a value"));
        }
        self.chunked = headers.get("transfer-encoding").is_some_and(|coding| coding == "chunked");
        Reply { status, headers, body: Bytes::new() }
    }

    /// The next piece of the answer's body; `None` at its end, whether it is announced or not.
    pub(crate) async fn piece(&mut self) -> Option<Vec<u8>> {
        assert!(self.chunked, "only streams are read by pieces");
        let (start, length) = loop {
            if let Some(at) = self.buffer.windows(2).position(|two| two == b"\r\n") {
                let text = std::str::from_utf8(&self.buffer[..at]).expect("a length");
                break (at + 2, usize::from_str_radix(text, 16).expect("a length"));
            }
            if !self.more().await {
                return None;
            }
        };
        while self.buffer.len() < start + length + 2 {
            if !self.more().await {
                return None;
            }
        }
        let piece = self.buffer[start..start + length].to_vec();
        self.buffer.drain(..start + length + 2);
        (length > 0).then_some(piece)
    }

    /// The whole answer.
    pub(crate) async fn reply(&mut self) -> Reply {
        let mut reply = self.answer().await;
        let mut body = Vec::new();
        if self.chunked {
            while let Some(piece) = self.piece().await {
                body.extend(piece);
            }
        } else {
            let length: usize = reply.header("content-length").parse().expect("a length");
            while self.buffer.len() < length {
                assert!(self.more().await, "the connection ended within the answer");
            }
            body = self.buffer.drain(..length).collect();
        }
        reply.body = body.into();
        reply
    }

    /// Whether the service keeps it, where nothing is to come.
    pub(crate) async fn is_open(&mut self) -> bool {
        tokio::time::timeout(Duration::from_millis(100), self.stream.read_buf(&mut self.buffer)).await.is_err()
    }

    async fn more(&mut self) -> bool {
        let read = self.stream.read_buf(&mut self.buffer);
        // A reset is an end, too.
        within("the service answers", HANG, read).await.is_ok_and(|count| count > 0)
    }
}
