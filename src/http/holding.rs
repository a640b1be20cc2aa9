//! Response bodies that keep a place until they are read or dropped.

use crate::admission::Held;
use axum::body::Body;
use bytes::Bytes;
use http_body::{Frame, SizeHint};
use std::pin::Pin;
use std::task::{Context, Poll};

/// Smaller bodies leave for the connection's buffers at once.
const SMALL: u64 = 16 << 10;

/// A body, and the place that it keeps.
struct Holding {
    body: Body,
    _place: Held,
}

/// Keeps the place of a request with its answer's body, where that is a large one in memory; a stream has a place of its own.
pub(super) fn holding(body: Body, place: Held) -> Body {
    match http_body::Body::size_hint(&body).exact() {
        Some(bytes) if bytes > SMALL => Body::new(Holding { body, _place: place }),
        _ => body,
    }
}

impl http_body::Body for Holding {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
