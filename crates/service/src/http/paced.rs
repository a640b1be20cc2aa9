//! Multipart bodies that are read as they come, and given up where the parser buffers without finding a part.

use super::multipart::{bad, broken};
use crate::config::MULTIPART_OVERHEAD_BYTES;
use crate::problem::ApiError;
use crate::sync::lock;
use axum::body::Body;
use axum::extract::Request;
use axum::extract::multipart::Field;
use bytes::Bytes;
use futures_util::StreamExt as _;
use std::sync::{Arc, Mutex};

/// Progress of the multipart parser relative to the body.
#[derive(Clone, Default)]
pub(super) struct Paced(Arc<Mutex<ParserBacklog>>);

#[derive(Default)]
struct ParserBacklog {
    /// Bytes received that belong to no part yet; the parser buffers them.
    unused: u64,
    /// Whether that limit was exceeded.
    stuck: bool,
}

impl Paced {
    /// Watches the body of a request.
    pub(super) fn new(request: Request) -> (Self, Request) {
        let pace = Self::default();
        let counted = pace.clone();
        let count = move |piece: Result<Bytes, axum::Error>| {
            let piece = piece?;
            let mut pace = lock(&counted.0);
            pace.unused += piece.len() as u64;
            pace.stuck |= pace.unused > 2 * MULTIPART_OVERHEAD_BYTES;
            if pace.stuck { Err(axum::Error::new("it has no parts")) } else { Ok(piece) }
        };
        (pace, request.map(|body| Body::from_stream(body.into_data_stream().map(count))))
    }

    /// The next bytes of a part.
    ///
    /// # Errors
    /// The body broke off.
    pub(super) async fn chunk(&self, field: &mut Field<'_>) -> Result<Option<Bytes>, ApiError> {
        let chunk = field.chunk().await.map_err(|e| broken(&e))?;
        if let Some(chunk) = &chunk {
            let mut pace = lock(&self.0);
            pace.unused = pace.unused.saturating_sub(chunk.len() as u64);
        }
        Ok(chunk)
    }

    /// What was read, or why the body was given up.
    ///
    /// # Errors
    /// That of `read`, or that there is no part.
    pub(super) fn finish<T>(&self, read: Result<T, ApiError>) -> Result<T, ApiError> {
        if lock(&self.0).stuck {
            return Err(bad("the multipart body has no parts; check its boundary".to_owned()));
        }
        read
    }
}
