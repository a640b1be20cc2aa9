//! Request bodies whose bytes are counted and admitted to the memory budget as they arrive, before the multipart parser buffers them.

use super::waiting::{SLOWEST_BYTES_PER_SECOND, too_slow};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::config::MULTIPART_OVERHEAD_BYTES;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::sync::lock;
use axum::body::Body;
use axum::extract::Request;
use futures_util::StreamExt as _;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A body that is counted.
pub(super) struct Metered(Arc<Mutex<MeterState>>);

struct MeterState {
    room: Permit,
    received: u64,
    began: Instant,
    /// Subject of the error message for a body that is too large.
    what: String,
    /// The error that ended the body.
    refused: Option<ApiError>,
    done: bool,
}

impl Metered {
    /// Counts the body of a request; `what` is the subject of the error message for a body that is too large.
    pub(super) fn new(
        service: &Arc<Service>,
        tenant: &Tenant,
        request: Request,
        what: impl Into<String>,
    ) -> (Self, Request) {
        let counted = MeterState {
            room: Permit::empty(&service.upload_memory, &tenant.name),
            received: 0,
            began: Instant::now(),
            what: what.into(),
            refused: None,
            done: false,
        };
        let counted = Arc::new(Mutex::new(counted));
        let (service, counting) = (Arc::clone(service), Arc::clone(&counted));
        let request = request.map(|body| {
            Body::from_stream(body.into_data_stream().map(move |piece| {
                let piece = piece?;
                let mut counted = lock(&counting);
                counted.take(&service, piece.len()).map(|()| piece).map_err(|error| {
                    counted.refused = Some(error);
                    axum::Error::new("it was refused")
                })
            }))
        });
        (Self(counted), request)
    }

    /// Ends counting; returns `read` with its memory permit, or the error that ended the body.
    pub(super) fn finish<T>(&self, read: Result<T, ApiError>) -> Result<(T, Permit), ApiError> {
        let mut counted = lock(&self.0);
        counted.done = true;
        let read = counted.refused.take().map_or(read, Err)?;
        Ok((read, counted.room.take()))
    }
}

impl MeterState {
    fn take(&mut self, service: &Service, bytes: usize) -> Result<(), ApiError> {
        if self.done {
            return Ok(());
        }
        self.received += bytes as u64;
        // The body occupies memory from its first byte on, so it must not be too slow.
        let patience = Duration::from_secs(service.config.body_timeout_s);
        let due = self.began.elapsed().saturating_sub(patience).as_secs() * SLOWEST_BYTES_PER_SECOND;
        if self.received < due {
            return Err(too_slow());
        }
        let limit = service.config.max_rest_bytes;
        if self.received > limit.saturating_add(MULTIPART_OVERHEAD_BYTES) {
            service.rejected("body_too_large");
            let detail = format!("{} more than {limit} bytes, the most that is taken; send a lighter model", self.what);
            return Err(ApiError::new(problem::TOO_LARGE, detail).limit(limit));
        }
        service.make_room(&mut self.room, self.received)
    }
}
