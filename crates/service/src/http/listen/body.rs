//! Request and response bodies that report progress to the connection's state.

use super::state::{RequestInFlight, State};
use bytes::Bytes;
use http_body::{Body, Frame, SizeHint};
use hyper::body::Incoming;
use std::error::Error;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::time::{Instant, Sleep, sleep};

/// Largest chunk of a response passed to HTTP/2 at once, which bounds the memory of a slow reader.
const PIECE_BYTES: usize = 64 << 10;

/// The client stopped sending within a request body. It is the source of the body's error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the request body stopped coming for {} s; send it again", after.as_secs_f64())]
pub struct BodyTimeout {
    /// How long was waited.
    pub after: Duration,
}

/// Whether the root cause of an error while reading a request body is a [`BodyTimeout`], which means 408.
pub fn is_body_timeout(error: &(dyn Error + 'static)) -> bool {
    std::iter::successors(Some(error), |&error| error.source()).any(<dyn Error>::is::<BodyTimeout>)
}

/// A request body that fails if the client pauses too long.
pub(super) struct RequestBody {
    inner: Incoming,
    state: Arc<State>,
    in_flight: Option<Arc<RequestInFlight>>,
    timeout: Duration,
    /// Runs only while a handler waits for data.
    clock: Option<Pin<Box<Sleep>>>,
    waiting: bool,
    /// Set when the body is dropped before its end.
    unfinished: Arc<AtomicBool>,
}

impl RequestBody {
    pub(super) fn new(inner: Incoming, in_flight: &Arc<RequestInFlight>, timeout: Duration) -> Self {
        let state = Arc::clone(in_flight.state());
        // A request without a body is complete.
        let empty = inner.is_end_stream();
        if empty {
            state.body_ended();
        }
        let in_flight = (!empty).then(|| Arc::clone(in_flight));
        Self { inner, state, in_flight, timeout, clock: None, waiting: false, unfinished: Arc::default() }
    }

    /// Becomes true when the body is dropped before its end.
    pub(super) fn unfinished(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.unfinished)
    }

    /// Polls the clock, which starts with the first wait after some progress.
    fn poll_clock(&mut self, cx: &mut Context<'_>) -> Poll<()> {
        let timeout = self.timeout;
        let clock = self.clock.get_or_insert_with(|| Box::pin(sleep(timeout)));
        if !self.waiting {
            self.waiting = true;
            clock.as_mut().reset(Instant::now() + timeout);
        }
        clock.as_mut().poll(cx)
    }
}

impl Body for RequestBody {
    type Data = Bytes;
    type Error = Box<dyn Error + Send + Sync>;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, Self::Error>>> {
        let this = &mut *self;
        let Poll::Ready(frame) = Pin::new(&mut this.inner).poll_frame(cx) else {
            ready!(this.poll_clock(cx));
            metrics::counter!("cager_body_timeouts_total").increment(1);
            this.waiting = false;
            return Poll::Ready(Some(Err(BodyTimeout { after: this.timeout }.into())));
        };
        this.waiting = false;
        this.state.body_progressed();
        if let Some(in_flight) = &this.in_flight {
            in_flight.body_progressed();
        }
        if frame.is_none() || this.inner.is_end_stream() {
            this.state.body_ended();
            this.in_flight = None;
        }
        Poll::Ready(frame.map(|frame| frame.map_err(Into::into)))
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

impl Drop for RequestBody {
    fn drop(&mut self) {
        if self.in_flight.is_some() {
            self.unfinished.store(true, Ordering::Release);
        }
    }
}

/// A response body that reports whether the client reads it.
pub(super) struct ResponseBody {
    inner: axum::body::Body,
    in_flight: Arc<RequestInFlight>,
    /// Rest of a large piece, for HTTP/2.
    rest: Bytes,
    split: bool,
}

impl ResponseBody {
    pub(super) fn new(inner: axum::body::Body, in_flight: Arc<RequestInFlight>, split: bool) -> Self {
        Self { inner, in_flight, rest: Bytes::new(), split }
    }
}

impl Body for ResponseBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = &mut *self;
        this.in_flight.taken();
        let mut data = std::mem::take(&mut this.rest);
        if data.is_empty() {
            match ready!(Pin::new(&mut this.inner).poll_frame(cx)) {
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(bytes) => data = bytes,
                    Err(frame) => return Poll::Ready(Some(Ok(frame))),
                },
                end => return Poll::Ready(end),
            }
        }
        if this.split && data.len() > PIECE_BYTES {
            this.rest = data.split_off(PIECE_BYTES);
        }
        this.in_flight.offered(data.len());
        Poll::Ready(Some(Ok(Frame::data(data))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (inner, rest) = (self.inner.size_hint(), self.rest.len() as u64);
        let mut hint = SizeHint::new();
        hint.set_lower(inner.lower() + rest);
        if let Some(upper) = inner.upper() {
            hint.set_upper(upper + rest);
        }
        hint
    }
}

impl Drop for ResponseBody {
    fn drop(&mut self) {
        self.in_flight.taken();
    }
}
