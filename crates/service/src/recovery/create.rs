//! Creating a recovery.

use super::valid_options::ValidOptions;
use super::{Recovery, RecoveryJob};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::idempotency::{extension, fingerprint};
use crate::jobs::{Checked, new_job};
use crate::preparation::{cage_of, check_extent, read_part};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Idempotency, JobMeta as _, NamedFile, RecoveryMeta, RecoveryParts, Store, StoredPart};
use cager_capture::origin::own_origin;
use cager_core::cage::Cage;
use cager_geometry::mesh::Point;
use cager_motion::recover::{manifold_of, rig_of};
use cager_proto::recovery_messages::RecoveryOptions;
use std::convert::Infallible;
use std::sync::Arc;

/// A request to recover an animation.
pub(crate) struct NewRecovery {
    pub(crate) parts: RecoveryParts<NamedFile>,
    pub(crate) options: RecoveryOptions,
    pub(crate) idempotency_key: Option<String>,
    /// Permit for the memory of the files.
    pub(crate) room: Permit,
}

impl Service {
    /// Creates a recovery, durably. Its files are looked at only as long as the client waits.
    ///
    /// # Errors
    /// Input that cannot be used, a quota that is used up, and storage errors.
    pub(crate) async fn create_recovery(
        self: &Arc<Self>,
        tenant: &Arc<Tenant>,
        new: NewRecovery,
    ) -> Result<Arc<RecoveryJob>, ApiError> {
        // Fingerprints of recoveries have been the same in all versions.
        self.create_job(tenant, new, request_of, |_| false, checked).await
    }
}

/// A recovery whose input can be used. Blocks.
fn checked(
    _: &Service,
    tenant: &Tenant,
    new: NewRecovery,
    idempotency: Option<Idempotency>,
) -> Result<Checked<Recovery>, ApiError> {
    let (points, origin) = check(&new)?;
    let NewRecovery { parts: files, options, room, .. } = new;
    let Ok(parts) = files.map(|_, part| Ok::<_, Infallible>(StoredPart::of(&part.name, &part.bytes)));
    let (id, created_ms) = new_job();
    let tenant = tenant.name.clone();
    let meta = RecoveryMeta { id, tenant, created_ms, options, points, origin, parts, idempotency };
    let unreserved = meta.sent_bytes();
    let store = Box::new(move |store: &Store, meta: &RecoveryMeta| store.create_recovery(meta, &files));
    Ok(Checked { meta, store, room, reserved: None, unreserved })
}

/// The request with an idempotency key that this input is. Blocks.
fn request_of(new: &NewRecovery) -> Option<Idempotency> {
    let parts: Vec<_> = new.parts.named().map(|(name, part)| (name, extension(&part.name), &part.bytes)).collect();
    let sent = parts.iter().flat_map(|(name, extension, bytes)| [name.as_bytes(), extension.as_bytes(), bytes]);
    fingerprint(new.idempotency_key.clone(), sent, &new.options)
}

/// Validates options and files, so that errors are reported in the response; the template's number of points, and its origin. Blocks.
fn check(new: &NewRecovery) -> Result<(u32, Option<Point>), ApiError> {
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_GEOMETRY, detail));
    let RecoveryParts { template: file, cage, rig, manifold } = &new.parts;
    ValidOptions::of(&new.options, rig.is_some())?;
    let template = read_part("template", &file.name, &file.bytes)?;
    if template.faces.is_empty() {
        return refuse(format!("template: {}: has no faces, and a template is a mesh; give one with faces", file.name));
    }
    check_extent("template", &template)?;
    let origin = own_origin(&template.points);
    match (rig, manifold) {
        (Some(_), Some(_)) if cage.is_some() => {
            return refuse("cage: a rig makes the cage; send a cage, or a rig and a manifold".to_owned());
        }
        (Some(_), Some(_)) if origin.is_some() => {
            let detail = format!(
                "template: {}: lies far away from the origin, where rigs are not exact; move it and the frames there",
                file.name
            );
            return refuse(detail);
        }
        (Some(rig), Some(manifold)) => {
            let read = rig_of(&rig.bytes).map_err(|what| format!("rig: {}: {what}", rig.name)).and_then(|found| {
                Cage::new(found.cage()).map_err(|error| format!("rig: {}: {error}", rig.name))?;
                manifold_of(&manifold.bytes, &found).map_err(|what| format!("manifold: {}: {what}", manifold.name))
            });
            if let Err(detail) = read {
                return refuse(detail);
            }
        }
        (None, None) => {}
        (Some(_), None) => {
            return refuse("rig: is followed by a manifold; send one too, from `cager manifold`".to_owned());
        }
        (None, Some(_)) => return refuse("manifold: is of a rig; send the rig too, from `cager rig`".to_owned()),
    }
    if let Some(cage) = cage {
        cage_of(cage, origin)?;
    }
    Ok((template.points.len() as u32, origin))
}
