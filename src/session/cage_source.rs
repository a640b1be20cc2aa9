//! The cage of a new session: as it was sent, designed before, or made around the rest pose.

use super::create::blocking;
use super::lock;
use super::prepare::read_part;
use crate::admission::Budget;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{CageFile, Content, ContentKey, MatrixFile};
use cager_cages::{EncloseError, EncloseOptions, enclose};
use cager_core::mesh::{Model, Polygons, TriMesh, bounds};
use cager_proto::messages::{CageSource, SessionOptions};
use std::collections::VecDeque;
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex};

/// Vertices of a cage where nothing is said of them.
const USUAL_VERTICES: usize = 350;
/// How many vertices may be asked for: no closed surface has fewer, and no cage of a model more.
pub(crate) const VERTICES: RangeInclusive<u32> = 4..=cager_cages::MOST_VERTICES as u32;
/// Cages made last that are kept, so that sessions created at once share one.
const KEPT: usize = 16;
/// File name of a cage that was not sent.
const NAME: &str = "cage.obj";

/// What a request brought.
pub(crate) struct Uploaded {
    pub(crate) rest_name: String,
    pub(crate) rest: Vec<u8>,
    pub(crate) cage: Option<CageFile>,
    pub(crate) matrix: Option<MatrixFile>,
}

/// Cages being made, and those made last.
pub(crate) struct CageMaker {
    places: Arc<Budget>,
    /// Held while a cage is made, by the first byte of its digest.
    flights: [tokio::sync::Mutex<()>; 16],
    recent: Mutex<VecDeque<(ContentKey, CageFile)>>,
}

impl CageMaker {
    /// One that makes so many at a time.
    pub(crate) fn new(places: Arc<Budget>) -> Self {
        Self { places, flights: Default::default(), recent: Mutex::default() }
    }

    fn recent(&self, made: &ContentKey) -> Option<CageFile> {
        lock(&self.recent).iter().find(|(key, _)| key == made).map(|(_, cage)| cage.clone())
    }

    fn keep(&self, made: ContentKey, cage: CageFile) {
        let mut recent = lock(&self.recent);
        recent.push_front((made, cage));
        recent.truncate(KEPT);
    }
}

impl Service {
    /// The content of a new session, and the digest of what its cage was made from where it was made here.
    ///
    /// # Errors
    /// Options that contradict each other or the cage, a design that is unknown or not completed, a rest pose that cannot be enclosed.
    pub(crate) async fn with_cage(
        &self,
        tenant: &str,
        uploaded: Uploaded,
        options: &SessionOptions,
    ) -> Result<(Content, Option<ContentKey>), ApiError> {
        let Uploaded { rest_name, rest, cage, matrix } = uploaded;
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
                let (rest, cage, made) = self.made_cage(tenant, &rest_name, rest, vertices).await?;
                (rest, cage, Some(made))
            }
        };
        Ok((Content { rest_name, rest, cage_name: cage.name, cage: cage.bytes, matrix }, made))
    }

    async fn designed_cage(&self, tenant: &str, id: &str) -> Result<CageFile, ApiError> {
        let job = self.cage_jobs.find(tenant, id).map_err(|_| {
            refuse(&format!("id: there is no cage design {:?}; list yours at /v1/cages", shortened(id)))
        })?;
        let store = self.store.clone();
        let bytes = blocking(move || job.completed_cage(&store)).await??;
        Ok(CageFile { name: NAME.to_owned(), bytes: bytes.to_vec() })
    }

    /// A cage around the rest pose, made now unless a session or a request just before has the same.
    async fn made_cage(
        &self,
        tenant: &str,
        rest_name: &str,
        rest: Vec<u8>,
        vertices: Option<u32>,
    ) -> Result<(Vec<u8>, CageFile, ContentKey), ApiError> {
        if let Some(vertices) = vertices.filter(|vertices| !VERTICES.contains(vertices)) {
            return Err(refuse(&vertices_detail(vertices)));
        }
        let (rest, made) = {
            let (tenant, name) = (tenant.to_owned(), rest_name.to_owned());
            blocking(move || {
                let made = digest(&tenant, &name, &rest, vertices);
                (rest, made)
            })
            .await?
        };
        let _one_of_its_kind = self.cage_maker.flights[usize::from(made.0[0]) % 16].lock().await;
        if let Some(cage) = self.cage_maker.recent(&made) {
            return Ok((rest, cage, made));
        }
        if let Some(key) = self.registry.made_cage(tenant, &made) {
            let store = self.store.clone();
            // Where it cannot be read it is made again.
            if let Ok(Some(cage)) = blocking(move || store.content_cage(&key)).await? {
                return Ok((rest, cage, made));
            }
        }
        let _place = self.cage_maker.places.take(tenant, 1).await;
        let (pool, name) = (self.solvers.pool(), rest_name.to_owned());
        let (rest, cage) = blocking(move || {
            let cage = read_part("rest", &name, &rest).and_then(|model| pool.install(|| make(&model, vertices)));
            (rest, cage)
        })
        .await?;
        let cage = CageFile { name: NAME.to_owned(), bytes: obj_of(&cage?) };
        self.cage_maker.keep(made, cage.clone());
        Ok((rest, cage, made))
    }
}

fn make(rest: &Model, vertices: Option<u32>) -> Result<TriMesh, ApiError> {
    check_extent(rest)?;
    // A cage of more vertices than the model has points could not be told from them.
    let usual = USUAL_VERTICES.min(rest.points.len() / 2).max(*VERTICES.start() as usize);
    let vertices = vertices.map_or(usual, |vertices| vertices as usize);
    enclose(rest, &EncloseOptions { vertices, ..EncloseOptions::default() }).map_err(|error| match error {
        EncloseError::TooFewVertices { .. } => refuse(&format!("vertices: {error}")),
        error => ApiError::new(problem::INVALID_GEOMETRY, format!("rest: {error}")),
    })
}

/// Refuses a model without points, or with all of them in one place.
///
/// # Errors
/// Which of them it is.
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
    cager_formats::obj_bytes(&Model { points: mesh.vertices.clone(), faces })
}

/// What is said of a number of vertices that no cage can have.
pub(crate) fn vertices_detail(vertices: u32) -> String {
    format!("vertices: is {vertices}; give a number from {} to {}", VERTICES.start(), VERTICES.end())
}

fn refuse(detail: &str) -> ApiError {
    ApiError::new(problem::INVALID_OPTIONS, format!("cage: {detail}"))
}

fn shortened(id: &str) -> String {
    id.chars().take(80).collect()
}

/// What a made cage depends on, and whose it is: what one tenant uploaded is never known to another.
fn digest(tenant: &str, rest_name: &str, rest: &[u8], vertices: Option<u32>) -> ContentKey {
    let extension = rest_name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    let mut hasher = blake3::Hasher::new();
    for part in
        ["made cage".as_bytes(), tenant.as_bytes(), extension.as_bytes(), rest, format!("{vertices:?}").as_bytes()]
    {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    ContentKey(*hasher.finalize().as_bytes())
}
