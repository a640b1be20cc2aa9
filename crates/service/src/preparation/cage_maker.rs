//! Cages made around rest poses, where none was sent.

use super::read_part;
use crate::admission::{Budget, Permit};
use crate::problem::{self, ApiError};
use crate::store::{ContentKey, NamedFile};
use crate::sync::lock;
use crate::tasks::blocking;
use cager_cages::{EncloseError, EncloseOptions, enclose_watched};
use cager_geometry::mesh::{Model, TriMesh, bounds};
use std::collections::{HashMap, VecDeque};
use std::ops::{ControlFlow, RangeInclusive};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, Weak};

/// Default number of cage vertices.
const DEFAULT_VERTICES: usize = 350;
/// Allowed numbers of cage vertices: a closed surface has at least 4.
pub(crate) const VERTICES: RangeInclusive<u32> = 4..=cager_cages::MAX_VERTICES as u32;
/// Number of recently made cages kept in memory, so that sessions created at the same time share one.
const RECENT_CAGES: usize = 16;
/// File name of a cage that was not sent.
pub(crate) const CAGE_NAME: &str = "cage.obj";

/// Makes cages around rest poses, each once however many requests ask for it, and remembers the latest.
pub(crate) struct CageMaker {
    places: Arc<Budget>,
    pool: Arc<rayon::ThreadPool>,
    /// Cages that requests wait for. Each has a lock of its own, held while room is waited for and the cage is made, so that others wait
    /// for the same cage alone.
    wanted: Mutex<HashMap<ContentKey, Weak<tokio::sync::Mutex<()>>>>,
    recent: Mutex<VecDeque<(ContentKey, NamedFile)>>,
}

/// A rest pose with the cage made around it.
pub(crate) struct Enclosed {
    pub(crate) rest: NamedFile,
    pub(crate) cage: NamedFile,
    /// Digest of what the cage was made from.
    pub(crate) made: ContentKey,
}

impl CageMaker {
    /// Makes at most as many cages at a time as `places` has permits.
    pub(crate) fn new(places: Arc<Budget>, pool: Arc<rayon::ThreadPool>) -> Self {
        Self { places, pool, wanted: Mutex::default(), recent: Mutex::default() }
    }

    /// A cage enclosing the rest pose: one of the recent ones, one that `stored` finds by the digest of the inputs, or made now. A request
    /// that is dropped leaves the queue, and stops the making of its cage. `room` is the permit for the memory of the rest pose.
    ///
    /// # Errors
    /// A number of vertices outside [`VERTICES`]; a rest pose that cannot be enclosed.
    pub(crate) async fn enclose(
        &self,
        tenant: &str,
        rest: NamedFile,
        vertices: Option<u32>,
        room: &Arc<Permit>,
        stored: impl AsyncFnOnce(ContentKey) -> Option<NamedFile>,
    ) -> Result<Enclosed, ApiError> {
        if let Some(vertices) = vertices.filter(|vertices| !VERTICES.contains(vertices)) {
            return Err(refuse_cage(&vertices_detail(vertices)));
        }
        let (owner, held) = (tenant.to_owned(), Arc::clone(room));
        let (rest, made) = blocking(move || {
            let _held = held;
            let made = digest(&owner, &rest, vertices);
            (rest, made)
        })
        .await?;
        let turn = self.lock_of(made);
        let _one_of_its_kind = turn.lock().await;
        let recent = lock(&self.recent).iter().find(|(key, _)| *key == made).map(|(_, cage)| cage.clone());
        if let Some(cage) = recent {
            return Ok(Enclosed { rest, cage, made });
        }
        if let Some(cage) = stored(made).await {
            return Ok(Enclosed { rest, cage, made });
        }
        let held = (self.places.take(tenant, 1).await, Arc::clone(room));
        let (rest, cage) = self.make(held, rest, vertices).await?;
        let cage = NamedFile { name: CAGE_NAME.to_owned(), bytes: obj_of(&cage?) };
        let mut recent = lock(&self.recent);
        recent.push_front((made, cage.clone()));
        recent.truncate(RECENT_CAGES);
        Ok(Enclosed { rest, cage, made })
    }

    fn lock_of(&self, made: ContentKey) -> Arc<tokio::sync::Mutex<()>> {
        let mut wanted = lock(&self.wanted);
        wanted.retain(|_, turn| turn.strong_count() > 0);
        let turn = wanted.get(&made).and_then(Weak::upgrade).unwrap_or_default();
        wanted.insert(made, Arc::downgrade(&turn));
        turn
    }

    /// Makes a cage; dropping the future stops it. Its place and the memory of the rest pose are free when the work has ended, not when nobody
    /// waits for it any more.
    async fn make(
        &self,
        held: (Permit, Arc<Permit>),
        rest: NamedFile,
        vertices: Option<u32>,
    ) -> Result<(NamedFile, Result<TriMesh, ApiError>), ApiError> {
        let (pool, given_up) = (Arc::clone(&self.pool), StopOnDrop::default());
        let stopped = Arc::clone(&given_up.0);
        blocking(move || {
            let _held = held;
            let mut watch = || if stopped.load(Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
            let model = read_part("rest", &rest.name, &rest.bytes);
            let cage = model.and_then(|model| pool.install(|| make(&model, vertices, &mut watch)));
            (rest, cage)
        })
        .await
    }
}

/// Set when it is dropped.
#[derive(Default)]
struct StopOnDrop(Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

fn make(
    rest: &Model,
    vertices: Option<u32>,
    watch: &mut (dyn FnMut() -> ControlFlow<()> + Send),
) -> Result<TriMesh, ApiError> {
    check_extent("rest", rest)?;
    // With more vertices than half the points, the data could not determine the cage.
    let usual = DEFAULT_VERTICES.min(rest.points.len() / 2).max(*VERTICES.start() as usize);
    let vertices = vertices.map_or(usual, |vertices| vertices as usize);
    let options = EncloseOptions { vertices, ..EncloseOptions::default() };
    enclose_watched(rest, &options, watch).map_err(|error| match error {
        EncloseError::TooFewVertices { .. } => refuse_cage(&format!("vertices: {error}")),
        error => ApiError::new(problem::INVALID_GEOMETRY, format!("rest: {error}")),
    })
}

/// Refuses a model that has no points, or whose bounding box has no extent.
///
/// # Errors
/// `INVALID_GEOMETRY`.
pub(crate) fn check_extent(part: &str, rest: &Model) -> Result<(), ApiError> {
    let error = if rest.points.is_empty() {
        EncloseError::Empty
    } else {
        let (low, high) = bounds(&rest.points);
        if low != high {
            return Ok(());
        }
        EncloseError::NoExtent
    };
    Err(ApiError::new(problem::INVALID_GEOMETRY, format!("{part}: {error}")))
}

/// A mesh as the bytes of an OBJ file.
pub(crate) fn obj_of(mesh: &TriMesh) -> Vec<u8> {
    cager_formats::obj_bytes(&mesh.clone().into())
}

/// Error detail for a vertex count outside the allowed range.
pub(crate) fn vertices_detail(vertices: u32) -> String {
    format!("vertices: is {vertices}; give a number from {} to {}", VERTICES.start(), VERTICES.end())
}

/// The response for an option of the cage.
pub(crate) fn refuse_cage(detail: &str) -> ApiError {
    ApiError::new(problem::INVALID_OPTIONS, format!("cage: {detail}"))
}

/// BLAKE3 digest of everything that a made cage depends on. It includes the tenant, so that one tenant cannot detect another's uploads.
fn digest(tenant: &str, rest: &NamedFile, vertices: Option<u32>) -> ContentKey {
    let extension = rest.name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    let vertices = format!("{vertices:?}");
    ContentKey::of([b"made cage", tenant.as_bytes(), extension.as_bytes(), &rest.bytes, vertices.as_bytes()])
}
