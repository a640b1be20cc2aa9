//! Decodes request bodies with a `Content-Encoding` (RFC 9110, §8.4) as a stream, so that size limits apply to the decoded bytes.

use crate::problem::{self, ApiError};
use async_compression::tokio::bufread::{GzipDecoder, ZstdDecoder};
use async_compression::zstd::DParameter;
use axum::body::Body;
use axum::extract::Request;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures_util::{Stream, StreamExt as _, stream};
use http::{HeaderValue, header};
use std::error::Error;
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Poll, ready};
use tokio::io::{AsyncBufRead, AsyncRead, ReadBuf};
use tokio::sync::{Semaphore, mpsc};
use tokio_util::io::{ReaderStream, StreamReader};

/// Largest window of zstd, as a power of two: 8 MiB, which every decoder must have (RFC 9659). Without a bound a small body takes 128 MiB.
const WINDOW_LOG: u32 = 23;
/// Bytes of a packed body that are read before they are unpacked. The end of a connection comes after them, and small bodies are work for long.
const AHEAD_BYTES: usize = 1 << 20;
/// How many times as long as it came a body may be, and how long in any case. Frames that move are packed two or three times.
const MAX_RATIO: u64 = 100;
const FREE_BYTES: u64 = 32 << 20;

/// A body was packed so well that unpacking it is work for long.
#[derive(Debug, thiserror::Error)]
#[error("it unpacks to more than {MAX_RATIO} times its length")]
struct PackedTooWell;

/// Whether the root cause of an error while reading a request body is that it unpacks to too much.
pub(crate) fn is_packed_too_well(error: &(dyn Error + 'static)) -> bool {
    let of_io = |error: &(dyn Error + 'static)| {
        let inner = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
        matches!(inner, Some(inner) if inner.is::<PackedTooWell>())
    };
    std::iter::successors(Some(error), |&error| error.source()).any(|error| error.is::<PackedTooWell>() || of_io(error))
}

/// Unpacks the body of a request.
///
/// # Errors
/// A coding that is unknown.
pub(super) async fn decoded(mut request: Request, next: Next) -> Response {
    let Some(coding) = request.headers_mut().remove(header::CONTENT_ENCODING) else { return next.run(request).await };
    let coding = coding.to_str().unwrap_or_default().trim().to_ascii_lowercase();
    if coding == "identity" {
        return next.run(request).await;
    }
    let unpack: fn(Body) -> Body = match coding.as_str() {
        "gzip" | "x-gzip" => |body| {
            let (packed, read) = reader(body);
            let mut decoder = GzipDecoder::new(packed);
            decoder.multiple_members(true);
            Body::from_stream(ReaderStream::new(Bounded { decoder, read, unpacked: 0 }))
        },
        "zstd" => |body| {
            let window = [DParameter::window_log_max(WINDOW_LOG)];
            let (packed, read) = reader(body);
            let decoder = ZstdDecoder::with_params(packed, &window);
            Body::from_stream(ReaderStream::new(Bounded { decoder, read, unpacked: 0 }))
        },
        _ => {
            let detail = format!("the body's coding {coding:?} is unknown; send it as gzip, zstd, or as it is");
            let mut refused = ApiError::new(problem::MEDIA_TYPE, detail).into_response();
            refused.headers_mut().insert(header::ACCEPT_ENCODING, HeaderValue::from_static("gzip, zstd"));
            return refused;
        }
    };
    // It was the length of the encoded body.
    request.headers_mut().remove(header::CONTENT_LENGTH);
    next.run(request.map(unpack)).await
}

/// The packed body, and how many bytes of it were taken.
fn reader(body: Body) -> (impl AsyncBufRead + Send + Unpin + 'static, Arc<AtomicU64>) {
    let read = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&read);
    let pieces = read_ahead(body).inspect(move |piece| {
        let bytes = piece.as_ref().map_or(0, Bytes::len) as u64;
        counted.fetch_add(bytes, Ordering::Relaxed);
    });
    (StreamReader::new(Box::pin(pieces)), read)
}

/// Reads [`AHEAD_BYTES`] of a body before they are asked for, once the first are: who is refused before is not told to go on.
fn read_ahead(body: Body) -> impl Stream<Item = io::Result<Bytes>> + Send {
    stream::once(async move {
        let (send, receive) = mpsc::unbounded_channel();
        let room = Arc::new(Semaphore::new(AHEAD_BYTES));
        let reading = async move {
            let mut pieces = body.into_data_stream();
            while let Some(piece) = pieces.next().await {
                let bytes = piece.as_ref().map_or(0, Bytes::len).clamp(1, AHEAD_BYTES);
                // Never closed; a piece that is larger than all room takes all of it.
                let Ok(taken) = Arc::clone(&room).acquire_many_owned(bytes as u32).await else { return };
                if send.send((piece.map_err(io::Error::other), taken)).is_err() {
                    return;
                }
            }
        };
        // Ends with the stream, whose end may leave it waiting for room or for the client.
        let reading = tokio_util::task::AbortOnDropHandle::new(tokio::spawn(reading));
        stream::unfold((receive, reading), async |(mut receive, reading)| {
            let (piece, _taken) = receive.recv().await?;
            Some((piece, (receive, reading)))
        })
    })
    .flatten()
}

/// What a decoder gives, up to a multiple of what it was given.
struct Bounded<D> {
    decoder: D,
    read: Arc<AtomicU64>,
    unpacked: u64,
}

impl<D: AsyncRead + Unpin> AsyncRead for Bounded<D> {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        ready!(Pin::new(&mut self.decoder).poll_read(cx, buf))?;
        self.unpacked += (buf.filled().len() - before) as u64;
        if self.unpacked > FREE_BYTES.max(MAX_RATIO * self.read.load(Ordering::Relaxed)) {
            return Poll::Ready(Err(io::Error::other(PackedTooWell)));
        }
        Poll::Ready(Ok(()))
    }
}
