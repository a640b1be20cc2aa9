//! Another model within a session's rest cage, to be moved by its cages: the parts of a `decode` body that brings one.

use super::form::Form;
use super::metered::Metered;
use super::multipart::{bad, broken, file_name};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::preparation::{ValidOptions, check_model, read_part};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::Session;
use crate::tasks::blocking;
use axum::extract::Request;
use bytes::Bytes;
use cager_core::coordinates::{CoordinateSystem as _, MeanValue};
use cager_core::decode::{self, Decoder, beside_poles};
use cager_core::inversion::reject_far_points;
use cager_geometry::mesh::TriMesh;
use futures_util::StreamExt as _;
use futures_util::stream::{BoxStream, poll_fn};
use std::sync::Arc;
use tokio::sync::mpsc;

/// The file of a model, and the room that it takes until it is dropped.
pub(super) struct UploadedModel {
    name: String,
    bytes: Vec<u8>,
    _room: Permit,
}

/// What turns cages into positions of another model.
pub(super) struct Bound {
    pub(super) decoder: Decoder,
    /// Points that lie outside the rest cage.
    pub(super) outside: usize,
    /// Points that lie beside poles of the coordinates, and are bound to the session's own model.
    pub(super) bound: usize,
}

/// Reads the part `model`, which comes first, and gives the part `cages` as it arrives.
///
/// # Errors
/// Parts that are missing, unknown or in another order; a model that is too large; no room.
pub(super) async fn read(
    service: &Arc<Service>,
    tenant: &Tenant,
    request: Request,
) -> Result<(UploadedModel, BoxStream<'static, Result<Bytes, ApiError>>), ApiError> {
    let (metered, request) = Metered::new(service, tenant, request, "the model has");
    let mut body = Form::of(request).await?;
    // The cages that follow wait on the disk, under a limit of their own.
    let ((name, bytes), room) = metered.finish(read_model(&mut body).await)?;
    let model = UploadedModel { name, bytes, _room: room };
    let (send, mut receive) = mpsc::channel(1);
    tokio::spawn(async move {
        if let Err(error) = pass_on(&mut body, &send).await {
            // The reader may be gone.
            let _ = send.send(Err(error)).await;
        }
    });
    Ok((model, poll_fn(move |context| receive.poll_recv(context)).boxed()))
}

async fn read_model(body: &mut Form) -> Result<(String, Vec<u8>), ApiError> {
    let missing = || bad("part \"model\" is missing; send the model as a file, before the part \"cages\"".to_owned());
    let mut field = body.next().await?.ok_or_else(missing)?;
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
async fn pass_on(body: &mut Form, send: &mpsc::Sender<Result<Bytes, ApiError>>) -> Result<(), ApiError> {
    let field = body.next().await?;
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
    uploaded: UploadedModel,
) -> Result<Bound, ApiError> {
    let prepared = service.solver(session).await?;
    let place = service.solvers.place(tenant).await;
    let (service, session) = (Arc::clone(service), Arc::clone(session));
    blocking(move || {
        let _place = place;
        let model = read_part("model", &uploaded.name, &uploaded.bytes)?;
        let (cage, system) = (session.rest_cage()?, ValidOptions::of(&session.meta.options)?.system);
        reject_far_points(&cage, &model.points)
            .map_err(|error| ApiError::new(problem::INVALID_GEOMETRY, format!("model: {error}")))?;
        check_model(model.points.len(), system, &cage, service.config.max_prepare_bytes)?;
        // On the elements of the session's own coordinates, where it has any, as in its container.
        let plan = prepared.solver.preparation().plan.as_ref();
        let coordinates = service.solvers.pool().install(|| system.coordinates(&cage, &model.points, plan));
        let found = coordinates.map_err(|error| ApiError::new(problem::INVALID_GEOMETRY, format!("model: {error}")))?;
        let mut bound = decode::Bound::none();
        if let Some(pointwise) = system.pointwise().filter(|_| system.name() == MeanValue.name()) {
            let beside = beside_poles(found.phi.as_ref());
            if !beside.is_empty() {
                let fitted = TriMesh::from(&session.geometry()?.rest);
                let bind = || decode::Bound::new(pointwise, &cage, &fitted, &model.points, &beside);
                bound = service
                    .solvers
                    .pool()
                    .install(bind)
                    .map_err(|error| ApiError::new(problem::INVALID_GEOMETRY, format!("model: {error}")))?;
            }
        }
        let count = bound.places.len();
        let decoder = Decoder::new(found.phi.as_ref(), cage.vertices().len()).with_bound(bound);
        Ok(Bound {
            decoder: decoder.with_dependent_normals(system.values(&cage).dependent_normals),
            outside: found.outside.len(),
            bound: count,
        })
    })
    .await?
}
