//! The cage of a new session: as it was sent, designed before, or made around the rest pose.

use super::create::blocking;
use super::lock;
use super::prepare::read_part;
use crate::admission::Budget;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Content, ContentKey, NamedFile};
use cager_cages::{EncloseError, EncloseOptions, enclose};
use cager_core::mesh::{Model, Polygons, TriMesh, bounds};
use cager_proto::messages::{CageSource, SessionOptions};
use std::collections::VecDeque;
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex};

/// Default number of cage vertices.
const DEFAULT_VERTICES: usize = 350;
/// Allowed numbers of cage vertices: a closed surface has at least 4.
pub(crate) const VERTICES: RangeInclusive<u32> = 4..=cager_cages::MOST_VERTICES as u32;
/// Number of recently made cages kept in memory, so that sessions created at the same time share one.
const RECENT_CAGES: usize = 16;
/// File name of a cage that was not sent.
const NAME: &str = "cage.obj";

/// The files of a request that creates a session.
pub(crate) struct Uploaded {
    pub(crate) rest: NamedFile,
    pub(crate) cage: Option<NamedFile>,
    pub(crate) matrix: Option<NamedFile>,
}

/// Makes cages around rest poses, each once however many requests ask for it, and remembers the latest.
pub(crate) struct CageMaker {
    places: Arc<Budget>,
    /// One lock per shard of digests (first byte modulo 16), taken while a cage is made.
    locks: [tokio::sync::Mutex<()>; 16],
    recent: Mutex<VecDeque<(ContentKey, NamedFile)>>,
}

impl CageMaker {
    /// Makes at most as many cages at a time as `places` has permits.
    pub(crate) fn new(places: Arc<Budget>) -> Self {
        Self { places, locks: Default::default(), recent: Mutex::default() }
    }

    fn recent(&self, made: &ContentKey) -> Option<NamedFile> {
        lock(&self.recent).iter().find(|(key, _)| key == made).map(|(_, cage)| cage.clone())
    }

    fn keep(&self, made: ContentKey, cage: NamedFile) {
        let mut recent = lock(&self.recent);
        recent.push_front((made, cage));
        recent.truncate(RECENT_CAGES);
    }
}

impl Service {
    /// The content of a new session with its cage; and, where the cage was made here, the digest of the inputs that it was made from.
    ///
    /// # Errors
    /// Options that contradict each other or the cage, a design that is unknown or not completed, a rest pose that cannot be enclosed.
    pub(crate) async fn resolve_cage(
        &self,
        tenant: &str,
        uploaded: Uploaded,
        options: &SessionOptions,
    ) -> Result<(Content, Option<ContentKey>), ApiError> {
        let Uploaded { rest, cage, matrix } = uploaded;
        let (rest, cage, made) = match (cage, options.cage.clone()) {
            (Some(cage), None) => (rest, cage, None),
            (Some(_), Some(_)) => {
                return Err(refuse("a cage is sent as well; leave out the part or the option"));
            }
            (None, Some(CageSource { vertices: Some(_), id: Some(_) })) => {
                return Err(refuse("give vertices to make a cage, or id to take a designed one, not both"));
            }
            (None, Some(CageSource { id: Some(id), .. })) => (rest, self.designed_cage(tenant, &id).await?, None),
            (None, source) => {
                let vertices = source.and_then(|source| source.vertices);
                let (rest, cage, made) = self.made_cage(tenant, rest, vertices).await?;
                (rest, cage, Some(made))
            }
        };
        Ok((Content { rest, cage, matrix }, made))
    }

    async fn designed_cage(&self, tenant: &str, id: &str) -> Result<NamedFile, ApiError> {
        let job = self.cage_jobs.find(tenant, id).map_err(|_| {
            refuse(&format!("id: there is no cage design {:?}; list yours at /v1/cages", shortened(id)))
        })?;
        let store = self.store.clone();
        let bytes = blocking(move || job.completed_cage(&store)).await??;
        Ok(NamedFile { name: NAME.to_owned(), bytes: bytes.to_vec() })
    }

    /// A cage enclosing the rest pose: from the recent ones, from a session of the same tenant with the same inputs, or made now.
    async fn made_cage(
        &self,
        tenant: &str,
        rest: NamedFile,
        vertices: Option<u32>,
    ) -> Result<(NamedFile, NamedFile, ContentKey), ApiError> {
        if let Some(vertices) = vertices.filter(|vertices| !VERTICES.contains(vertices)) {
            return Err(refuse(&vertices_detail(vertices)));
        }
        let (rest, made) = {
            let tenant = tenant.to_owned();
            blocking(move || {
                let made = digest(&tenant, &rest, vertices);
                (rest, made)
            })
            .await?
        };
        let _one_of_its_kind = self.cage_maker.locks[usize::from(made.0[0]) % 16].lock().await;
        if let Some(cage) = self.cage_maker.recent(&made) {
            return Ok((rest, cage, made));
        }
        if let Some(key) = self.registry.made_cage(tenant, &made) {
            let store = self.store.clone();
            // An unreadable cage is made again.
            if let Ok(Some(cage)) = blocking(move || store.content_cage(&key)).await? {
                return Ok((rest, cage, made));
            }
        }
        let _place = self.cage_maker.places.take(tenant, 1).await;
        let pool = self.solvers.pool();
        let (rest, cage) = blocking(move || {
            let cage =
                read_part("rest", &rest.name, &rest.bytes).and_then(|model| pool.install(|| make(&model, vertices)));
            (rest, cage)
        })
        .await?;
        let cage = NamedFile { name: NAME.to_owned(), bytes: obj_of(&cage?) };
        self.cage_maker.keep(made, cage.clone());
        Ok((rest, cage, made))
    }
}

fn make(rest: &Model, vertices: Option<u32>) -> Result<TriMesh, ApiError> {
    check_extent(rest)?;
    // With more vertices than half the points, the data could not determine the cage.
    let usual = DEFAULT_VERTICES.min(rest.points.len() / 2).max(*VERTICES.start() as usize);
    let vertices = vertices.map_or(usual, |vertices| vertices as usize);
    enclose(rest, &EncloseOptions { vertices, ..EncloseOptions::default() }).map_err(|error| match error {
        EncloseError::TooFewVertices { .. } => refuse(&format!("vertices: {error}")),
        error => ApiError::new(problem::INVALID_GEOMETRY, format!("rest: {error}")),
    })
}

/// Refuses a model that has no points, or whose bounding box has no extent.
///
/// # Errors
/// `INVALID_GEOMETRY`.
pub(crate) fn check_extent(rest: &Model) -> Result<(), ApiError> {
    let error = if rest.points.is_empty() {
        EncloseError::Empty
    } else {
        let (low, high) = bounds(&rest.points);
        if low != high {
            return Ok(());
        }
        EncloseError::NoExtent
    };
    Err(ApiError::new(problem::INVALID_GEOMETRY, format!("rest: {error}")))
}

/// A mesh as the bytes of an OBJ file.
pub(crate) fn obj_of(mesh: &TriMesh) -> Vec<u8> {
    let mut faces = Polygons::new();
    mesh.triangles.iter().for_each(|triangle| faces.push(triangle));
    cager_formats::obj_bytes(&Model { points: mesh.vertices.clone(), faces, ..Model::default() })
}

/// Error detail for a vertex count outside the allowed range.
pub(crate) fn vertices_detail(vertices: u32) -> String {
    format!("vertices: is {vertices}; give a number from {} to {}", VERTICES.start(), VERTICES.end())
}

fn refuse(detail: &str) -> ApiError {
    ApiError::new(problem::INVALID_OPTIONS, format!("cage: {detail}"))
}

fn shortened(id: &str) -> String {
    id.chars().take(80).collect()
}

/// BLAKE3 digest of everything that a made cage depends on. It includes the tenant, so that one tenant cannot detect another's uploads.
fn digest(tenant: &str, rest: &NamedFile, vertices: Option<u32>) -> ContentKey {
    let extension = rest.name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    let vertices = format!("{vertices:?}");
    ContentKey::of([b"made cage", tenant.as_bytes(), extension.as_bytes(), &rest.bytes, vertices.as_bytes()])
}
