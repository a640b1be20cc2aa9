//! Another model within a session's rest cage, to be moved by its cages: the parts of a `decode` body that brings one.

use super::multipart::{ENVELOPE_BYTES, PIECE, Room, bad, broken, file_name};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::Session;
use crate::session::create::blocking;
use crate::session::prepare::{Choices, check_columns, read_part};
use axum::extract::{FromRequest, Multipart, Request};
use bytes::Bytes;
use cager_core::decode::Decoder;
use futures_util::StreamExt as _;
use futures_util::stream::{BoxStream, poll_fn};
use std::sync::Arc;
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
    service: &Service,
    request: Request,
) -> Result<(Uploaded, BoxStream<'static, Result<Bytes, ApiError>>), ApiError> {
    let mut body = Multipart::from_request(request, &())
        .await
        .map_err(|error| bad(format!("the multipart body cannot be read: {}", error.body_text())))?;
    let model = read_model(service, &mut body).await?;
    let (send, mut receive) = mpsc::channel(1);
    tokio::spawn(async move {
        if let Err(error) = pass_on(&mut body, &send).await {
            // The reader may be gone.
            let _ = send.send(Err(error)).await;
        }
    });
    Ok((model, poll_fn(move |context| receive.poll_recv(context)).boxed()))
}

async fn read_model(service: &Service, body: &mut Multipart) -> Result<Uploaded, ApiError> {
    let missing = || bad("part \"model\" is missing; send the model as a file, before the part \"cages\"".to_owned());
    let mut field = body.next_field().await.map_err(|e| broken(&e))?.ok_or_else(missing)?;
    if field.name() != Some("model") {
        return Err(missing());
    }
    let name = file_name(&field);
    let (mut bytes, mut room, mut granted) = (Vec::new(), Room::new(), 0);
    let limit = service.config.max_rest_bytes.saturating_add(ENVELOPE_BYTES);
    while let Some(chunk) = field.chunk().await.map_err(|e| broken(&e))? {
        let received = (bytes.len() + chunk.len()) as u64;
        if received > limit {
            service.rejected("body_too_large");
            let detail = format!("the model has more than {limit} bytes, the most that is taken; send a lighter one");
            return Err(ApiError::new(problem::TOO_LARGE, detail).limit(limit));
        }
        while granted < received {
            room.push(service.upload_memory.try_take(PIECE).ok_or_else(|| {
                service.rejected("upload_memory");
                let detail = "too many models are being uploaded at the moment; try again later";
                ApiError::new(problem::BUSY, detail).retry_after(5)
            })?);
            granted += PIECE;
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(Uploaded { name, bytes, _room: room })
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
        check_columns(model.points.len(), system.columns(&cage), service.config.max_prepare_bytes)?;
        let coordinates = service.solvers.pool().install(|| system.coordinates(&cage, &model.points));
        let found = coordinates.map_err(|error| ApiError::new(problem::INVALID_GEOMETRY, format!("model: {error}")))?;
        let decoder = Decoder::new(found.phi.as_ref(), cage.vertices().len());
        Ok(Bound { decoder: decoder.with_tied_normals(system.tied_normals(&cage)), outside: found.outside.len() })
    })
    .await?
}
