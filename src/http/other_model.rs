//! Another model within a session's rest cage, to be moved by its cages: the parts of a `decode` body that brings one.

use super::multipart::{ENVELOPE_BYTES, PIECE, Room, bad, broken, file_name};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::create::blocking;
use crate::session::prepare::{Choices, check_columns, read_part};
use crate::session::{Session, lock};
use axum::body::Body;
use axum::extract::{FromRequest, Multipart, Request};
use bytes::Bytes;
use cager_core::decode::Decoder;
use cager_core::inversion::refuse_far_points;
use futures_util::StreamExt as _;
use futures_util::stream::{BoxStream, poll_fn};
use std::sync::{Arc, Mutex};
use tokio::sync::mpsc;

/// The file of a model, and the room that it takes until it is dropped.
pub(super) struct Uploaded {
    name: String,
    bytes: Vec<u8>,
    _room: Room,
}

/// What turns cages into positions of another model.
pub(super) struct Bound {
    pub(super) decoder: Decoder,
    /// Points that lie outside the rest cage.
    pub(super) outside: usize,
}

/// Reads the part `model`, which comes first, and gives the part `cages` as it arrives.
///
/// # Errors
/// Parts that are missing, unknown or in another order; a model that is too large; no room.
pub(super) async fn read(
    service: &Arc<Service>,
    request: Request,
) -> Result<(Uploaded, BoxStream<'static, Result<Bytes, ApiError>>), ApiError> {
    let metered =
        Arc::new(Mutex::new(Metered { room: Room::new(), received: 0, granted: 0, refused: None, done: false }));
    let (counting, counted) = (Arc::clone(service), Arc::clone(&metered));
    let request = request.map(|body| {
        Body::from_stream(body.into_data_stream().map(move |piece| {
            let piece = piece?;
            let mut metered = lock(&counted);
            metered.take(&counting, piece.len()).map(|()| piece).map_err(|error| {
                metered.refused = Some(error);
                axum::Error::new("it was refused")
            })
        }))
    });
    let mut body = Multipart::from_request(request, &())
        .await
        .map_err(|error| bad(format!("the multipart body cannot be read: {}", error.body_text())))?;
    let model = read_model(&mut body).await;
    let (name, bytes) = {
        let mut metered = lock(&metered);
        // The cages that follow wait on the disk, under a limit of their own.
        metered.done = true;
        metered.refused.take().map_or(model, Err)?
    };
    let room = std::mem::take(&mut lock(&metered).room);
    let model = Uploaded { name, bytes, _room: room };
    let (send, mut receive) = mpsc::channel(1);
    tokio::spawn(async move {
        if let Err(error) = pass_on(&mut body, &send).await {
            // The reader may be gone.
            let _ = send.send(Err(error)).await;
        }
    });
    Ok((model, poll_fn(move |context| receive.poll_recv(context)).boxed()))
}

/// The bytes of a body until the model is read, counted as they come: until a part is found, all that came is kept.
struct Metered {
    room: Room,
    received: u64,
    granted: u64,
    /// Why no more was taken.
    refused: Option<ApiError>,
    done: bool,
}

impl Metered {
    fn take(&mut self, service: &Service, bytes: usize) -> Result<(), ApiError> {
        if self.done {
            return Ok(());
        }
        self.received += bytes as u64;
        let limit = service.config.max_rest_bytes;
        if self.received > limit.saturating_add(ENVELOPE_BYTES) {
            service.rejected("body_too_large");
            let detail = format!("the model has more than {limit} bytes, the most that is taken; send a lighter one");
            return Err(ApiError::new(problem::TOO_LARGE, detail).limit(limit));
        }
        while self.granted < self.received {
            self.room.push(service.upload_memory.try_take(PIECE).ok_or_else(|| {
                service.rejected("upload_memory");
                let detail = "too many models are being uploaded at the moment; try again later";
                ApiError::new(problem::BUSY, detail).retry_after(5)
            })?);
            self.granted += PIECE;
        }
        Ok(())
    }
}

async fn read_model(body: &mut Multipart) -> Result<(String, Vec<u8>), ApiError> {
    let missing = || bad("part \"model\" is missing; send the model as a file, before the part \"cages\"".to_owned());
    let mut field = body.next_field().await.map_err(|e| broken(&e))?.ok_or_else(missing)?;
    if field.name() != Some("model") {
        return Err(missing());
    }
    let (name, mut bytes) = (file_name(&field), Vec::new());
    while let Some(chunk) = field.chunk().await.map_err(|e| broken(&e))? {
        bytes.extend_from_slice(&chunk);
    }
    Ok((name, bytes))
}

/// Sends the bytes of the part `cages` on, until nobody wants them.
async fn pass_on(body: &mut Multipart, send: &mpsc::Sender<Result<Bytes, ApiError>>) -> Result<(), ApiError> {
    let field = body.next_field().await.map_err(|e| broken(&e))?;
    let Some(mut field) = field.filter(|field| field.name() == Some("cages")) else {
        return Err(bad("part \"cages\" is missing; send the cages after the part \"model\"".to_owned()));
    };
    while let Some(chunk) = field.chunk().await.map_err(|e| broken(&e))? {
        if send.send(Ok(chunk)).await.is_err() {
            return Ok(());
        }
    }
    Ok(())
}

/// Binds a model to the session's rest cage, by the coordinates of the session.
///
/// # Errors
/// A model that cannot be read, is too large, or for which the coordinates do not exist.
pub(super) async fn bind(
    service: &Arc<Service>,
    session: &Arc<Session>,
    tenant: &str,
    uploaded: Uploaded,
) -> Result<Bound, ApiError> {
    let place = service.solvers.place(tenant).await;
    let (service, session) = (Arc::clone(service), Arc::clone(session));
    blocking(move || {
        let _place = place;
        let model = read_part("model", &uploaded.name, &uploaded.bytes)?;
        let (cage, system) = (session.rest_cage()?, Choices::of(&session.meta.options)?.system);
        refuse_far_points(&cage, &model.points)
            .map_err(|error| ApiError::new(problem::INVALID_GEOMETRY, format!("model: {error}")))?;
        check_columns(model.points.len(), system.columns(&cage), service.config.max_prepare_bytes)?;
        let coordinates = service.solvers.pool().install(|| system.coordinates(&cage, &model.points));
        let found = coordinates.map_err(|error| ApiError::new(problem::INVALID_GEOMETRY, format!("model: {error}")))?;
        let decoder = Decoder::new(found.phi.as_ref(), cage.vertices().len());
        Ok(Bound { decoder: decoder.with_tied_normals(system.tied_normals(&cage)), outside: found.outside.len() })
    })
    .await?
}
