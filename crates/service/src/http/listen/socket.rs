//! The byte stream of a connection, which reports reads and writes to the connection's state.

use super::linger::{LingeringPlaces, linger};
use super::state::State;
use std::io::{self, IoSlice};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// Resources of a connection until its socket is closed.
pub(super) struct ConnectionResources {
    /// Where a lingering socket is waited for at shutdown.
    pub(super) tracker: TaskTracker,
    /// Ends lingering.
    pub(super) abort: CancellationToken,
    /// Limits how many linger.
    pub(super) lingering: LingeringPlaces,
    /// The connection's place; given back on drop.
    pub(super) place: Box<dyn Send>,
}

/// A stream that tells the connection's state about its reads, writes and waits.
pub(super) struct Socket<S: AsyncRead + AsyncWrite + Unpin + Send + 'static> {
    io: Option<S>,
    state: Arc<State>,
    keep: Option<ConnectionResources>,
}

impl<S: AsyncRead + AsyncWrite + Unpin + Send + 'static> Socket<S> {
    pub(super) fn new(io: S, state: Arc<State>, keep: ConnectionResources) -> Self {
        Self { io: Some(io), state, keep: Some(keep) }
    }

    fn io(&mut self) -> io::Result<Pin<&mut S>> {
        self.io.as_mut().map(Pin::new).ok_or_else(|| io::ErrorKind::NotConnected.into())
    }

    /// Notes the outcome of a write.
    fn note(&self, outcome: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        match &outcome {
            Poll::Pending => self.state.blocked(),
            Poll::Ready(Ok(_)) => self.state.wrote(),
            Poll::Ready(Err(_)) => self.state.abandon(),
        }
        outcome
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + Send + 'static> AsyncRead for Socket<S> {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        let outcome = self.io()?.poll_read(cx, buf);
        match &outcome {
            Poll::Pending => {}
            Poll::Ready(Ok(())) => self.state.read(&buf.filled()[before..]),
            Poll::Ready(Err(_)) => self.state.abandon(),
        }
        outcome
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + Send + 'static> AsyncWrite for Socket<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        let outcome = self.io()?.poll_write(cx, buf);
        self.note(outcome)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bufs: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let outcome = self.io()?.poll_write_vectored(cx, bufs);
        self.note(outcome)
    }

    fn is_write_vectored(&self) -> bool {
        self.io.as_ref().is_some_and(AsyncWrite::is_write_vectored)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let outcome = self.io()?.poll_flush(cx);
        // A completed flush ends a blocked write but is no progress.
        match &outcome {
            Poll::Pending => self.state.blocked(),
            Poll::Ready(_) => self.state.flushed(),
        }
        outcome
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.io()?.poll_shutdown(cx)
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin + Send + 'static> Drop for Socket<S> {
    fn drop(&mut self) {
        let (Some(io), Some(keep)) = (self.io.take(), self.keep.take()) else { return };
        self.state.close();
        // Without a runtime (it is going down), the socket just closes.
        if !self.state.may_linger() || tokio::runtime::Handle::try_current().is_err() {
            return;
        }
        let ConnectionResources { tracker, abort, lingering, place } = keep;
        drop(place);
        let Some(permit) = lingering.enter(self.state.stranger()) else { return };
        // It still counts for its address.
        let state = Arc::clone(&self.state);
        tracker.spawn(async move {
            abort.run_until_cancelled(linger(io)).await;
            drop((permit, state));
        });
    }
}
