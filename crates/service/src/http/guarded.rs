//! Bodies that end when their token is revoked or expires, and response bodies that keep a request's permit until they are sent.

use crate::admission::Permit;
use crate::auth::Grant;
use axum::body::Body;
use bytes::Bytes;
use http_body::{Frame, SizeHint};
use std::pin::Pin;
use std::task::{Context, Poll};

/// Smaller bodies are copied to the connection's buffers at once.
const SMALL: u64 = 16 << 10;

struct GuardedBody {
    body: Body,
    /// Ends the body with an error when it completes.
    over: Option<Pin<Box<dyn Future<Output = ()> + Send>>>,
    /// Released with it.
    _kept: Option<Permit>,
}

/// Fails the body when its token is revoked or expires.
pub(super) fn revocable(body: Body, grant: &Grant) -> Body {
    if http_body::Body::is_end_stream(&body) {
        return body;
    }
    let (revoked, expires) = (grant.revoked.clone(), grant.expires);
    let over = async move {
        match expires {
            Some(expires) => drop(tokio::time::timeout_at(expires.into(), revoked.cancelled()).await),
            None => revoked.cancelled().await,
        }
    };
    Body::new(GuardedBody { body, over: Some(Box::pin(over)), _kept: None })
}

/// Keeps a request's permit until the body is sent, if the body is large and in memory; streams have permits of their own.
pub(super) fn with_permit(body: Body, place: Permit) -> Body {
    match http_body::Body::size_hint(&body).exact() {
        Some(bytes) if bytes > SMALL => Body::new(GuardedBody { body, over: None, _kept: Some(place) }),
        _ => body,
    }
}

impl http_body::Body for GuardedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if self.over.as_mut().is_some_and(|over| over.as_mut().poll(cx).is_ready()) {
            self.over = Some(Box::pin(std::future::ready(())));
            return Poll::Ready(Some(Err(axum::Error::new("it was ended: the token was revoked or has expired"))));
        }
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
