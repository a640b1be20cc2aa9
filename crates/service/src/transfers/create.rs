//! Creating a transfer.

use super::valid_options::ValidOptions;
use super::{Transfer, TransferJob};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::cage_job::samples;
use crate::idempotency::fingerprint_of_files;
use crate::jobs::{Checked, new_job};
use crate::preparation::{cage_of, check_extent, read_part};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::registry::Reserved;
use crate::store::{Idempotency, NamedFile, PAIRS, SOURCE, SOURCE_FRAMES, Spool, Store, StoredPart, TransferMeta};
use cager_capture::origin::own_origin;
use cager_core::inversion::reject_far_points;
use cager_motion::transfer::{MethodChoice, TransferFailed, read_pairs};
use cager_proto::container::ContainerReader;
use cager_proto::transfer_messages::TransferOptions;
use cager_shape::transfer::VertexPair;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::PathBuf;
use std::sync::Arc;

/// Most frames of a transfer.
const MAX_FRAMES: u32 = 100_000;

/// A request to move a motion.
pub(crate) struct NewTransfer {
    /// `target`, `cage`, [`PAIRS`] and `source_rest`, as far as they were sent.
    pub(crate) files: BTreeMap<&'static str, NamedFile>,
    /// The large part, [`SOURCE`] or [`SOURCE_FRAMES`], and the name of its file.
    pub(crate) large: Option<(&'static str, String, Spool)>,
    pub(crate) options: TransferOptions,
    pub(crate) idempotency_key: Option<String>,
    /// Permit for the memory of the files.
    pub(crate) room: Permit,
    /// Quota reserved for the large part.
    pub(crate) reserved: Reserved,
}

impl Service {
    /// Creates a transfer, durably, and queues it.
    ///
    /// # Errors
    /// Input that cannot be used, a quota or a queue that is full, and storage errors.
    pub(crate) async fn create_transfer(
        self: &Arc<Self>,
        tenant: &Arc<Tenant>,
        new: NewTransfer,
    ) -> Result<Arc<TransferJob>, ApiError> {
        // A request that is repeated may name a session that is gone by now.
        let session = match new.options.source_session.clone() {
            Some(id) => Some(self.completed_container(&tenant.name, &id).await),
            None => None,
        };
        self.create_job(tenant, (new, session), |(new, _)| request_of(new), |_| false, check).await
    }
}

/// The request with an idempotency key that this input is. Blocks.
fn request_of(new: &NewTransfer) -> Option<Idempotency> {
    let files = new.files.iter().map(|(part, file)| (*part, &file.name[..], blake3::hash(&file.bytes)));
    let large = new.large.iter().map(|(part, name, spool)| (*part, &name[..], spool.digest()));
    fingerprint_of_files(new.idempotency_key.clone(), files.chain(large), &new.options)
}

fn geometry(detail: String) -> ApiError {
    ApiError::new(problem::INVALID_GEOMETRY, detail)
}

/// The container of a session that was asked for.
type Session = Option<Result<PathBuf, ApiError>>;

/// Validates options and files, so that errors are reported in the response, and takes a session's container over. Blocks.
fn check(
    service: &Service,
    tenant: &Tenant,
    (mut new, session): (NewTransfer, Session),
    idempotency: Option<Idempotency>,
) -> Result<Checked<Transfer>, ApiError> {
    let bad = |detail: &str| Err(ApiError::new(problem::BAD_REQUEST, detail));
    let large = match (new.large.take(), session) {
        (Some(_), Some(session)) => {
            session?;
            return bad("source_session: a source is sent as well; leave out the parts or the option");
        }
        (None, Some(path)) => (SOURCE, "capture.cager".to_owned(), copied(service, tenant, &mut new.reserved, &path?)?),
        (Some(large), None) => large,
        (None, None) => {
            return bad(
                "the source is missing; send the parts source_rest and source_frames, or source, or name a completed session as options.source_session",
            );
        }
    };
    let cage = new.files.get("cage");
    let valid = ValidOptions::of(&new.options, cage.is_some())?;
    let Some(file) = new.files.get("target") else {
        return bad("part target is missing; send the model that is to move as a file");
    };
    let target = read_part("target", &file.name, &file.bytes)?;
    check_extent("target", &target)?;
    let origin = own_origin(&target.points);
    let is_fitted = valid.method == MethodChoice::Fitted;
    let (frames, source_points) = frames_of(&new, &large, is_fitted)?;
    if let Some(pairs) = new.files.get(PAIRS) {
        if !is_fitted {
            let detail = "pairs: belong to the method fitted; leave out the part, or take that method";
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        }
        pairs_of(pairs, [source_points, target.points.len()])?;
    }
    if new.options.detail && target.faces.is_empty() {
        return Err(geometry(format!("target: {}: {}", file.name, TransferFailed::NoFaces("target"))));
    }
    check_scratch(service, (target.points.len(), source_points), frames)?;
    if let Some(cage) = cage {
        cage_of(cage, origin.filter(|_| !is_fitted))?;
    }
    let NewTransfer { files, options, room, reserved, .. } = new;
    let described = |(name, file): (&&str, &NamedFile)| (String::from(*name), StoredPart::of(&file.name, &file.bytes));
    let mut parts: BTreeMap<String, StoredPart> = files.iter().map(described).collect();
    let (part, name, spool) = large;
    let blake3 = spool.digest().to_hex().to_string();
    parts.insert(part.to_owned(), StoredPart { name, bytes: spool.bytes(), blake3 });
    let (id, created_ms) = new_job();
    let (tenant, points) = (tenant.name.clone(), target.points.len() as u32);
    let meta = TransferMeta { id, tenant, created_ms, options, points, frames, origin, parts, idempotency };
    let unreserved = files.values().map(|file| file.bytes.len() as u64).sum();
    let store = Box::new(move |store: &Store, meta: &TransferMeta| store.create_transfer(meta, &files, (part, spool)));
    Ok(Checked { meta, store, room, reserved: Some(reserved), unreserved })
}

/// Refuses a motion whose positions on their way would fill the disk: four numbers of them at the most are kept, in double precision. Later it is too late, and
/// would be everybody's trouble.
fn check_scratch(service: &Service, (target, source): (usize, usize), frames: u32) -> Result<(), ApiError> {
    let needed = u64::from(frames) * 24 * (3 * target + source) as u64;
    let most = service.store.free_bytes() / 2;
    if needed <= most {
        return Ok(());
    }
    let detail = format!(
        "{frames} frames of a target of {target} points need {needed} bytes of disk on their way, and there are {most}; send fewer frames at a time"
    );
    Err(ApiError::new(problem::TOO_LARGE, detail).limit(most))
}

/// The numbers of frames and of points of the source, whose frames go with its rest pose, and this with the cage that fits it where the method is `fitted`.
fn frames_of(
    new: &NewTransfer,
    (part, name, spool): &(&'static str, String, Spool),
    fitted: bool,
) -> Result<(u32, usize), ApiError> {
    let of_source = |detail: String| geometry(format!("{part}: {name}: {detail}"));
    let (frames, points, has_faces, place) = match new.files.get("source_rest") {
        None if *part == SOURCE_FRAMES => {
            let detail = "part source_rest is missing; send the source in its rest pose, with faces, as a file";
            return Err(ApiError::new(problem::BAD_REQUEST, detail));
        }
        Some(_) if *part == SOURCE => {
            let detail =
                "part source_rest: a whole source is there as well, which has a rest pose; leave out one of them";
            return Err(ApiError::new(problem::BAD_REQUEST, detail));
        }
        Some(rest) => {
            let model = read_part("source_rest", &rest.name, &rest.bytes)?;
            check_extent("source_rest", &model)?;
            let points = model.points.len();
            let frames = samples::open(name, spool.stored(), spool.bytes(), points, new.options.frames)?.frames();
            if let Some(cage) = new.files.get("cage").filter(|_| fitted) {
                let far = reject_far_points(&cage_of(cage, None)?, &model.points);
                far.map_err(|error| geometry(format!("cage: {}: {error}", cage.name)))?;
            }
            (frames, points, !model.faces.is_empty(), format!("source_rest: {}", rest.name))
        }
        None => {
            let opened = ContainerReader::open(BufReader::new(spool.stored()));
            let mut container = opened.map_err(|error| of_source(error.to_string()))?;
            let rest = container.rest().map_err(|error| of_source(error.to_string()))?;
            (container.frames(), rest.points.len(), !rest.faces.is_empty(), format!("{part}: {name}"))
        }
    };
    if !has_faces {
        return Err(geometry(format!("{place}: {}", TransferFailed::NoFaces("source"))));
    }
    if frames == 0 {
        return Err(of_source(TransferFailed::NoFrames.to_string()));
    }
    if *part == SOURCE && new.options.frames.is_some() {
        let detail = "frames: a container says how many frames it has; leave the option out";
        return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
    }
    match u32::try_from(frames).ok().filter(|frames| *frames <= MAX_FRAMES) {
        Some(frames) => Ok((frames, points)),
        None => Err(of_source(format!(
            "has {frames} frames, and a transfer has at most {MAX_FRAMES}; make one for each part of the motion"
        ))),
    }
}

/// Pairs as they were sent, of a source and a target of so many points.
///
/// # Errors
/// What cannot be read, with its line.
pub(super) fn pairs_of(file: &NamedFile, points: [usize; 2]) -> Result<Vec<VertexPair>, ApiError> {
    let pairs = str::from_utf8(&file.bytes).map_err(|_| "is no text; send lines of two numbers".to_owned());
    let pairs = pairs.and_then(|text| read_pairs(text, points));
    pairs.map_err(|error| geometry(format!("pairs: {}: {error}", file.name)))
}

/// A copy of a session's container, since the session may be deleted. Blocks.
fn copied(service: &Service, tenant: &Tenant, reserved: &mut Reserved, path: &PathBuf) -> Result<Spool, ApiError> {
    let unreadable = |error: io::Error| {
        let detail = format!("source_session: its container cannot be read: {error}; try again later");
        ApiError::new(problem::STORAGE_FAILED, detail).retry_after(10)
    };
    let mut file = File::open(path).map_err(unreadable)?;
    service.reserve_more(tenant, reserved, file.metadata().map_err(unreadable)?.len())?;
    let mut spool = service.store.spool()?;
    io::copy(&mut file, &mut spool).map_err(unreadable)?;
    Ok(spool)
}
