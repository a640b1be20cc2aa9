//! Decodes request bodies with a `Content-Encoding` (RFC 9110, §8.4) as a stream, so that size limits apply to the decoded bytes.

use crate::problem::{self, ApiError};
use async_compression::tokio::bufread::{GzipDecoder, ZstdDecoder};
use async_compression::zstd::DParameter;
use axum::body::Body;
use axum::extract::Request;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::TryStreamExt as _;
use http::{HeaderValue, header};
use std::io;
use tokio_util::io::{ReaderStream, StreamReader};

/// Largest window of zstd, as a power of two: 8 MiB, which every decoder must have (RFC 9659). Without a bound a small body takes 128 MiB.
const WINDOW_LOG: u32 = 23;

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
            let mut decoder = GzipDecoder::new(reader(body));
            decoder.multiple_members(true);
            Body::from_stream(ReaderStream::new(decoder))
        },
        "zstd" => |body| {
            let window = [DParameter::window_log_max(WINDOW_LOG)];
            Body::from_stream(ReaderStream::new(ZstdDecoder::with_params(reader(body), &window)))
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

fn reader(body: Body) -> impl tokio::io::AsyncBufRead + Send + Unpin + 'static {
    StreamReader::new(Box::pin(body.into_data_stream().map_err(io::Error::other)))
}
