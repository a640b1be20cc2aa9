//! Responses with immutable content: `ETag`, `Range` and conditional requests (RFC 9110, §13 and §14).

use crate::admission::Permit;
use crate::problem::{self, ApiError};
use crate::sync::lock;
use crate::tasks::blocking;
use axum::body::Body;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures_util::StreamExt as _;
use http::{HeaderMap, HeaderValue, StatusCode, header};
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Bytes read and sent at a time.
const PIECE: u64 = 512 << 10;

/// Content that never changes.
pub(crate) struct Immutable {
    pub(crate) length: u64,
    /// Without the quotes.
    pub(crate) etag: String,
    pub(crate) media_type: &'static str,
    /// Whether shared caches may store it; not if tokens are required.
    pub(crate) public: bool,
    /// Memory permit for the chunks being sent, empty at first.
    pub(crate) room: Permit,
    /// Reads a range; blocks.
    pub(crate) read: Arc<dyn Fn(Range<u64>) -> io::Result<Bytes> + Send + Sync>,
}

impl Immutable {
    /// These bytes of a file.
    pub(crate) fn of_file(
        file: File,
        bytes: Range<u64>,
        etag: String,
        media_type: &'static str,
        room: Permit,
        public: bool,
    ) -> Self {
        let (file, begin, length) = (Mutex::new(file), bytes.start, bytes.end - bytes.start);
        let read = move |range: Range<u64>| {
            let mut file = lock(&file);
            let mut bytes = vec![0; (range.end - range.start) as usize];
            file.seek(SeekFrom::Start(begin + range.start))?;
            file.read_exact(&mut bytes)?;
            Ok(bytes.into())
        };
        Self { length, etag, media_type, public, room, read: Arc::new(read) }
    }

    /// As [`Self::respond`], after the first bytes were read: what cannot be read is told by the status, not by a body that breaks off.
    pub(crate) async fn respond_readable(mut self, headers: &HeaderMap) -> Response {
        let sent = match self.select(headers, &format!("\"{}\"", self.etag)) {
            Ok(Selection::All) => 0..self.length,
            Ok(Selection::Part(range)) => range,
            Ok(Selection::NotModified) | Err(_) => 0..0,
        };
        let first = sent.start..sent.end.min(sent.start + PIECE);
        if !first.is_empty() {
            if let Err(refusal) = self.make_room(first.end - first.start) {
                return refusal.into_response();
            }
            let (read, range) = (Arc::clone(&self.read), first.clone());
            let bytes = match blocking(move || read(range)).await {
                Ok(Ok(bytes)) => bytes,
                Ok(Err(error)) => return unreadable(error).into_response(),
                Err(error) => return error.into_response(),
            };
            let (read, kept) = (Arc::clone(&self.read), Mutex::new(Some(bytes)));
            self.read = Arc::new(move |range| {
                let kept = if range == first { lock(&kept).take() } else { None };
                kept.map_or_else(|| read(range), Ok)
            });
        }
        self.respond(headers)
    }

    /// Grows the memory permit to what is sent at a time.
    ///
    /// # Errors
    /// 429 or 503.
    fn make_room(&mut self, bytes: u64) -> Result<(), ApiError> {
        self.room.grow_to(bytes.min(PIECE), 1).map_err(|full| {
            metrics::counter!("cager_rejections_total", "reason" => "download_memory").increment(1);
            full.refusal("memory for downloads")
        })
    }

    /// The response to a request with these headers; 416 for a range outside the content, 429 or 503 without memory.
    pub(crate) fn respond(mut self, headers: &HeaderMap) -> Response {
        let etag = format!("\"{}\"", self.etag);
        let scope = if self.public { "public" } else { "private" };
        let selection = match self.select(headers, &etag) {
            Ok(selection) => selection,
            Err(error) => {
                let mut response = error.into_response();
                insert(&mut response, header::CONTENT_RANGE, &format!("bytes */{}", self.length));
                return response;
            }
        };
        let sent = match &selection {
            Selection::All => self.length,
            Selection::Part(range) => range.end - range.start,
            Selection::NotModified => 0,
        };
        if let Err(refusal) = self.make_room(sent) {
            return refusal.into_response();
        }
        let mut response = match selection {
            Selection::NotModified => StatusCode::NOT_MODIFIED.into_response(),
            Selection::All => {
                let length = self.length;
                let mut response = self.body(0..length).into_response();
                response.headers_mut().insert(header::CONTENT_LENGTH, HeaderValue::from(length));
                response
            }
            Selection::Part(range) => {
                let (first, last) = (range.start, range.end - 1);
                let content_range = format!("bytes {first}-{last}/{}", self.length);
                let length = range.end - range.start;
                let mut response = (StatusCode::PARTIAL_CONTENT, self.body(range)).into_response();
                response.headers_mut().insert(header::CONTENT_LENGTH, HeaderValue::from(length));
                insert(&mut response, header::CONTENT_RANGE, &content_range);
                response
            }
        };
        insert(&mut response, header::ETAG, &etag);
        insert(&mut response, header::CACHE_CONTROL, &format!("{scope}, max-age=31536000, immutable"));
        insert(&mut response, header::ACCEPT_RANGES, "bytes");
        insert(&mut response, header::VARY, "accept, authorization");
        if response.status() != StatusCode::NOT_MODIFIED {
            response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type));
        }
        response
    }

    fn select(&self, headers: &HeaderMap, etag: &str) -> Result<Selection, ApiError> {
        if is_known(headers, etag) {
            return Ok(Selection::NotModified);
        }
        let text = |name| headers.get(name).and_then(|value: &HeaderValue| value.to_str().ok());
        if text(header::IF_RANGE).is_some_and(|tag| tag != etag) {
            return Ok(Selection::All);
        }
        match text(header::RANGE).and_then(|range| parse_range(range, self.length)) {
            None => Ok(Selection::All),
            Some(Some(range)) => Ok(Selection::Part(range)),
            Some(None) => {
                let detail = format!("there are {} bytes; ask for a range within them", self.length);
                Err(ApiError::new(problem::RANGE, detail).limit(self.length))
            }
        }
    }

    /// The memory permit is released when the body is dropped.
    fn body(&mut self, range: Range<u64>) -> Body {
        let read = Arc::clone(&self.read);
        let room = self.room.take();
        let pieces = futures_util::stream::unfold((range, room), move |(left, room)| {
            let read = Arc::clone(&read);
            async move {
                if left.is_empty() {
                    return None;
                }
                let piece = left.start..left.end.min(left.start + PIECE);
                let next = piece.end..left.end;
                let bytes = tokio::task::spawn_blocking(move || read(piece)).await;
                Some((bytes.map_err(io::Error::other).and_then(|bytes| bytes), (next, room)))
            }
        });
        // What compresses a body asks for more after its end.
        Body::from_stream(pieces.fuse())
    }
}

/// The response where the first bytes cannot be read.
fn unreadable(error: io::Error) -> ApiError {
    error.downcast::<ApiError>().unwrap_or_else(|error| {
        tracing::error!(%error, "what was asked for cannot be read");
        let detail = "the service's disk failed to read what was asked for; try again when the operator has checked it";
        ApiError::new(problem::STORAGE_FAILED, detail).retry_after(10)
    })
}

/// Whether the client says that it has the content with this tag.
pub(super) fn is_known(headers: &HeaderMap, etag: &str) -> bool {
    let known = headers.get(header::IF_NONE_MATCH).and_then(|value| value.to_str().ok()).unwrap_or_default();
    known.split(',').map(str::trim).any(|tag| tag == "*" || tag.trim_start_matches("W/") == etag)
}

enum Selection {
    All,
    Part(Range<u64>),
    NotModified,
}

/// Parses a single range: `None` if the header is to be ignored, `Some(None)` if the range is not satisfiable.
fn parse_range(text: &str, length: u64) -> Option<Option<Range<u64>>> {
    let (first, last) = text.trim().strip_prefix("bytes=")?.split_once('-')?;
    let (first, last) = (first.trim(), last.trim());
    if first.is_empty() {
        let count: u64 = last.parse().ok()?;
        return Some((count > 0 && length > 0).then(|| length.saturating_sub(count)..length));
    }
    let first: u64 = first.parse().ok()?;
    let last: u64 = if last.is_empty() { u64::MAX } else { last.parse().ok()? };
    if last < first {
        return None;
    }
    Some((first < length).then(|| first..last.saturating_add(1).min(length)))
}

fn insert(response: &mut Response, name: header::HeaderName, value: &str) {
    if let Ok(value) = HeaderValue::from_str(value) {
        response.headers_mut().insert(name, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_as_the_standard_says() {
        assert_eq!(parse_range("bytes=0-4", 10), Some(Some(0..5)));
        assert_eq!(parse_range("bytes=5-", 10), Some(Some(5..10)));
        assert_eq!(parse_range("bytes=-3", 10), Some(Some(7..10)));
        assert_eq!(parse_range("bytes=-30", 10), Some(Some(0..10)));
        assert_eq!(parse_range("bytes=2-99", 10), Some(Some(2..10)));
        assert_eq!(parse_range("bytes=10-", 10), Some(None));
        assert_eq!(parse_range("bytes=-0", 10), Some(None));
        assert_eq!(parse_range("bytes=0-", 0), Some(None));
        assert_eq!(parse_range("bytes=4-2", 10), None);
        assert_eq!(parse_range("bytes=0-1,3-4", 10), None);
        assert_eq!(parse_range("items=0-1", 10), None);
        assert_eq!(parse_range(&format!("bytes=1-{}", u64::MAX), 10), Some(Some(1..10)));
    }
}
