//! A scripted HTTP/1.1 server: it does what a real one would not do on demand.
#![allow(dead_code, unreachable_pub, missing_docs)]

pub mod service;

use cager_client::{Client, ClientOptions};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

/// One request and the connection it came on; dropping it cuts the connection.
pub struct Exchange {
    socket: TcpStream,
    buffer: Vec<u8>,
    body: BodyLeft,
    pub method: String,
    /// Path and query.
    pub target: String,
    headers: Vec<(String, String)>,
}

#[derive(Clone, Copy, PartialEq)]
enum BodyLeft {
    Chunked,
    Bytes(usize),
}

/// Answers every request, one per connection, by `handler`; returns the address.
pub async fn serve<F, A>(handler: F) -> String
where
    F: Fn(Exchange) -> A + Send + Sync + 'static,
    A: Future<Output = ()> + Send + 'static,
{
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let address = format!("http://{}", listener.local_addr().expect("an address"));
    let handler = Arc::new(handler);
    tokio::spawn(async move {
        while let Ok((socket, _)) = listener.accept().await {
            let handler = Arc::clone(&handler);
            tokio::spawn(async move {
                if let Some(exchange) = Exchange::read(socket).await {
                    handler(exchange).await;
                }
            });
        }
    });
    address
}

/// A client of a scripted server that does not wait long.
pub fn client(address: &str) -> Client {
    let options = ClientOptions {
        idle_timeout: Duration::from_secs(2),
        retries: 4,
        max_backoff: Duration::from_millis(20),
        http2: false,
        ..ClientOptions::default()
    };
    Client::new(address).expect("an address").with_options(options)
}

impl Exchange {
    async fn read(socket: TcpStream) -> Option<Self> {
        let mut exchange = Self {
            socket,
            buffer: Vec::new(),
            body: BodyLeft::Bytes(0),
            method: String::new(),
            target: String::new(),
            headers: Vec::new(),
        };
        let end = loop {
            if let Some(at) = exchange.buffer.windows(4).position(|w| w == b"\r\n\r\n") {
                break at;
            }
            exchange.more().await?;
        };
        let head = String::from_utf8(exchange.buffer.drain(..end + 4).collect()).ok()?;
        let mut lines = head.lines();
        let mut first = lines.next()?.split(' ');
        (exchange.method, exchange.target) = (first.next()?.to_owned(), first.next()?.to_owned());
        let headers = lines.filter_map(|line| line.split_once(": "));
        exchange.headers = headers.map(|(name, value)| (name.to_lowercase(), value.to_owned())).collect();
        exchange.body = match (exchange.header("transfer-encoding"), exchange.header("content-length")) {
            (Some(_), _) => BodyLeft::Chunked,
            (None, length) => BodyLeft::Bytes(length.map_or(0, |l| l.parse().expect("a length"))),
        };
        Some(exchange)
    }

    async fn more(&mut self) -> Option<()> {
        let mut piece = [0; 16 << 10];
        let count = self.socket.read(&mut piece).await.ok().filter(|&count| count > 0)?;
        self.buffer.extend_from_slice(&piece[..count]);
        Some(())
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str())
    }

    pub fn query(&self, name: &str) -> Option<&str> {
        let (_, query) = self.target.split_once('?')?;
        query.split('&').find_map(|pair| pair.split_once('=').filter(|(n, _)| *n == name).map(|(_, value)| value))
    }

    pub fn path(&self) -> &str {
        self.target.split('?').next().unwrap_or_default()
    }

    /// The next piece of the request's body; `None` at its end and where the client is gone.
    pub async fn body_piece(&mut self) -> Option<Vec<u8>> {
        match self.body {
            BodyLeft::Bytes(0) => None,
            BodyLeft::Bytes(left) => {
                if self.buffer.is_empty() {
                    self.more().await?;
                }
                let piece: Vec<u8> = self.buffer.drain(..left.min(self.buffer.len())).collect();
                self.body = BodyLeft::Bytes(left - piece.len());
                Some(piece)
            }
            BodyLeft::Chunked => {
                let end = loop {
                    if let Some(at) = self.buffer.windows(2).position(|w| w == b"\r\n") {
                        break at;
                    }
                    self.more().await?;
                };
                let length = usize::from_str_radix(std::str::from_utf8(&self.buffer[..end]).ok()?, 16).ok()?;
                while self.buffer.len() < end + 2 + length + 2 {
                    self.more().await?;
                }
                let piece = self.buffer[end + 2..][..length].to_vec();
                self.buffer.drain(..end + 2 + length + 2);
                if length == 0 {
                    self.body = BodyLeft::Bytes(0);
                    return None;
                }
                Some(piece)
            }
        }
    }

    /// Lets a body that was read whole be read again.
    pub fn put_back(&mut self, body: Vec<u8>) {
        self.body = BodyLeft::Bytes(body.len());
        self.buffer = body;
    }

    pub async fn whole_body(&mut self) -> Vec<u8> {
        let mut body = Vec::new();
        while let Some(piece) = self.body_piece().await {
            body.extend(piece);
        }
        body
    }

    /// Answers and closes the connection.
    pub async fn reply(mut self, status: u16, headers: &[(&str, &str)], body: impl AsRef<[u8]>) {
        let body = body.as_ref();
        self.head(status, headers, &format!("content-length: {}\r\n", body.len())).await;
        let _ = self.socket.write_all(body).await;
        let _ = self.socket.shutdown().await;
        // The client closes first, so that nothing it still sends makes the system throw the answer away.
        while self.more().await.is_some() {
            self.buffer.clear();
        }
    }

    pub async fn json(self, body: impl AsRef<[u8]>) {
        self.reply(200, &[("content-type", "application/json")], body).await;
    }

    pub async fn problem(self, status: u16, word: &str, headers: &[(&str, &str)]) {
        let body = problem(status, word);
        let mut headers = headers.to_vec();
        headers.push(("content-type", "application/problem+json"));
        self.reply(status, &headers, body).await;
    }

    /// Begins an answer of unknown length.
    pub async fn begin(&mut self, status: u16, headers: &[(&str, &str)]) {
        self.head(status, headers, "transfer-encoding: chunked\r\n").await;
    }

    /// Begins an answer of `length` bytes, of which some may never come.
    pub async fn begin_sized(&mut self, status: u16, headers: &[(&str, &str)], length: usize) {
        self.head(status, headers, &format!("content-length: {length}\r\n")).await;
    }

    async fn head(&mut self, status: u16, headers: &[(&str, &str)], length: &str) {
        let mut head = format!("HTTP/1.1 {status} Whatever\r\nconnection: close\r\n{length}");
        for (name, value) in headers {
            head.push_str(&format!("{name}: {value}\r\n"));
        }
        head.push_str("\r\n");
        let _ = self.socket.write_all(head.as_bytes()).await;
    }

    pub async fn raw(&mut self, bytes: &[u8]) {
        let _ = self.socket.write_all(bytes).await;
        let _ = self.socket.flush().await;
    }

    /// Sends one chunk of an answer that was begun.
    pub async fn chunk(&mut self, bytes: &[u8]) {
        let mut chunk = format!("{:x}\r\n", bytes.len()).into_bytes();
        chunk.extend_from_slice(bytes);
        chunk.extend_from_slice(b"\r\n");
        self.raw(&chunk).await;
    }

    /// Ends an answer that was begun.
    pub async fn end(mut self) {
        self.raw(b"0\r\n\r\n").await;
        let _ = self.socket.shutdown().await;
        while self.more().await.is_some() {
            self.buffer.clear();
        }
    }
}

pub fn problem(status: u16, word: &str) -> String {
    format!(r#"{{"type":"urn:cager:problem:{word}","title":"{word}","status":{status},"detail":"detail of {word}"}}"#)
}
