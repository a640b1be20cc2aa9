//! Another machine that the service asks or tells: keeps what it hears, and answers as it was told to.

use axum::Router;
use axum::extract::Request;
use axum::response::{IntoResponse as _, Response};
use bytes::Bytes;
use http::{HeaderMap, StatusCode};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

/// A request as it came.
#[derive(Clone)]
pub(crate) struct Heard {
    pub(crate) path: String,
    pub(crate) headers: HeaderMap,
    pub(crate) body: Bytes,
}

impl Heard {
    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers[name].to_str().expect("a text")
    }
}

type Answer = Box<dyn Fn(&Heard) -> Response + Send + Sync>;

/// Listens on loopback until it is dropped.
pub(crate) struct Elsewhere {
    pub(crate) address: String,
    heard: Arc<Mutex<VecDeque<Heard>>>,
    task: tokio::task::JoinHandle<()>,
}

impl Elsewhere {
    /// Answers so.
    pub(crate) async fn answering(answer: impl Fn(&Heard) -> Response + Send + Sync + 'static) -> Self {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = format!("http://{}", listener.local_addr().expect("its address"));
        let (heard, answer): (Arc<Mutex<VecDeque<Heard>>>, Arc<Answer>) = (Arc::default(), Arc::new(Box::new(answer)));
        let keep = Arc::clone(&heard);
        let routes = Router::new().fallback(async move |request: Request| {
            let (parts, body) = request.into_parts();
            let body = axum::body::to_bytes(body, 16 << 20).await.expect("a body");
            let one = Heard { path: parts.uri.path().to_owned(), headers: parts.headers, body };
            let response = answer(&one);
            keep.lock().expect("no panic").push_back(one);
            response
        });
        let task = tokio::spawn(async move { axum::serve(listener, routes).await.expect("it serves") });
        Self { address, heard, task }
    }

    /// Answers the first requests with these, and 204 from then on.
    pub(crate) async fn with(statuses: &[u16]) -> Self {
        let statuses = Mutex::new(statuses.iter().copied().collect::<VecDeque<u16>>());
        Self::answering(move |_| {
            let status = statuses.lock().expect("no panic").pop_front().unwrap_or(204);
            StatusCode::from_u16(status).expect("a status").into_response()
        })
        .await
    }

    /// The next request that came, waited for.
    pub(crate) async fn next(&self) -> Heard {
        super::eventually("a request", async || self.heard.lock().expect("no panic").pop_front()).await
    }

    /// Requests that came and were not looked at.
    pub(crate) fn left(&self) -> usize {
        self.heard.lock().expect("no panic").len()
    }
}

impl Drop for Elsewhere {
    fn drop(&mut self) {
        self.task.abort();
    }
}
