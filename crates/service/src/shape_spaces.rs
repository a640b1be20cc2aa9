//! Poses of models and the shapes between them, in memory: bounded for all tenants together, forgotten after a while without a request.

use crate::admission::{Budget, Permit};
use crate::idempotency::{Keyed, KnownKeys};
use crate::jobs::new_job;
use crate::preparation::{cage_of, check_extent, check_told, read_part};
use crate::problem::{self, ApiError};
use crate::store::{Idempotency, NamedFile};
use crate::sync::lock;
use cager_capture::decode::{self, Animation, DecodeError};
use cager_capture::origin::{move_to, own_origin};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem as _, MeanValue};
use cager_core::inversion::reject_far_points;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_motion::pose_cage;
use cager_motion::pose_faces::same_faces;
use cager_proto::container;
use cager_proto::shape_messages::{ShapeSpace as View, ShapeSpaceOptions, ShapesOn};
use cager_shape::ShapeError;
use cager_shape::interpolate::{CagedShapes, ShapeSpace};
use std::collections::{BTreeMap, HashSet};
use std::io::ErrorKind;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Poses that a shape space has at the most.
const MOST_POSES: usize = 64;

/// All shape spaces by id; ids are in order of creation.
pub(crate) struct ShapeSpaces {
    all: Mutex<Kept>,
    memory: Arc<Budget>,
    idle: Duration,
}

#[derive(Default)]
struct Kept {
    spaces: BTreeMap<String, Arc<KeptSpace>>,
    requests: KnownKeys,
}

impl Kept {
    /// Forgets the others, with the keys that they were made for.
    fn retain(&mut self, keeps: impl Fn(&KeptSpace) -> bool) {
        let Self { spaces, requests } = self;
        spaces.retain(|_, kept| {
            let stays = keeps(kept);
            if let Some(idempotency) = kept.idempotency.as_ref().filter(|_| !stays) {
                requests.forget(&kept.tenant, idempotency);
            }
            stays
        });
    }
}

/// A shape space in memory.
pub(crate) struct KeptSpace {
    tenant: String,
    idempotency: Option<Idempotency>,
    pub(crate) view: View,
    shapes: Shapes,
    used: Mutex<Instant>,
    _memory: Permit,
}

enum Shapes {
    Mesh(Box<ShapeSpace>),
    Cage(Box<CagedShapes>),
}

/// A request for a shape space.
pub(crate) struct Wanted<'a> {
    /// Where it will be.
    pub(crate) spaces: &'a ShapeSpaces,
    pub(crate) tenant: &'a str,
    pub(crate) options: &'a ShapeSpaceOptions,
    /// A cage that was sent.
    pub(crate) cage: Option<&'a NamedFile>,
}

/// What a shape space is made from.
pub(crate) struct Poses {
    /// The model, whose faces count.
    model: Model,
    /// A cage around it; none where shapes are found on the mesh, or where one is to be made.
    cage: Option<Cage>,
    poses: Vec<Vec<Point>>,
    /// What was subtracted from all of these.
    origin: Option<Point>,
    memory: Permit,
}

impl ShapeSpaces {
    /// None yet, for so much memory.
    pub(crate) fn new(memory: Arc<Budget>, idle_s: u64) -> Self {
        Self { all: Mutex::default(), memory, idle: Duration::from_secs(idle_s) }
    }

    /// Makes a shape space, on the current rayon pool. Blocks.
    ///
    /// # Errors
    /// Poses that do not go together.
    pub(crate) fn create(
        &self,
        tenant: &str,
        options: ShapeSpaceOptions,
        poses: Poses,
        idempotency: Option<Idempotency>,
    ) -> Result<Arc<KeptSpace>, ApiError> {
        let Poses { model, cage, poses, origin, memory } = poses;
        let on = options.on.unwrap_or_default();
        let cage =
            match cage {
                None if on == ShapesOn::Cage => Some(pose_cage::around(&model).map_err(|error| {
                    geometry(format!("no cage can be made around the first pose: {error}; send one"))
                })?),
                given => given,
            };
        let cage_vertices = cage.as_ref().map(|cage| cage.vertices().len() as u32);
        let refuse = |error: ShapeError| geometry(error.to_string());
        let shapes = if let Some(cage) = &cage {
            let found = MeanValue.coordinates(cage, &model.points, None);
            let phi = found.map_err(|error| geometry(error.to_string()))?.phi;
            Shapes::Cage(Box::new(CagedShapes::new(cage, phi, &poses).map_err(refuse)?))
        } else {
            let mesh = TriMesh::from(&model);
            Shapes::Mesh(Box::new(ShapeSpace::new(&mesh.triangles, &poses).map_err(refuse)?))
        };
        let (id, created_ms) = new_job();
        let view = View {
            id: id.clone(),
            name: options.name,
            created: created_ms as f64 / 1e3,
            points: model.points.len() as u32,
            poses: poses.len() as u32,
            on,
            cage_vertices,
            origin,
        };
        let (tenant, used) = (tenant.to_owned(), Mutex::new(Instant::now()));
        let kept = Arc::new(KeptSpace { tenant, idempotency, view, shapes, used, _memory: memory });
        let mut all = lock(&self.all);
        if let Some(idempotency) = &kept.idempotency {
            all.requests.made(&kept.tenant, idempotency, &id);
        }
        all.spaces.insert(id, Arc::clone(&kept));
        Ok(kept)
    }

    /// Takes the memory of a shape space before its poses are read.
    ///
    /// # Errors
    /// More than one tenant can have, and no memory at the moment.
    fn reserve(&self, tenant: &str, points: u64, poses: usize, cage_vertices: Option<u64>) -> Result<Permit, ApiError> {
        let (needed, most) = (bytes(points, poses as u64, cage_vertices), self.memory.most());
        if needed > most {
            let detail = format!(
                "{poses} poses of {points} points need {needed} bytes of memory, and this service allows {most} (shape_bytes); send fewer poses, a lighter model or a coarser cage"
            );
            return Err(geometry(detail).limit(most));
        }
        self.forget_idle();
        self.memory.try_take(tenant, needed).map_err(|full| full.refusal("memory for shape spaces"))
    }

    /// A tenant's shape space, which counts as used.
    ///
    /// # Errors
    /// 404 where there is none.
    pub(crate) fn find(&self, tenant: &str, id: &str) -> Result<Arc<KeptSpace>, ApiError> {
        self.forget_idle();
        let found = lock(&self.all).spaces.get(id).filter(|kept| kept.tenant == tenant).cloned();
        let found = found.ok_or_else(|| {
            let detail = "there is no shape space with this id; they are forgotten after a while without a request, and when the service starts anew: make it again";
            ApiError::new(problem::NOT_FOUND, detail)
        })?;
        *lock(&found.used) = Instant::now();
        Ok(found)
    }

    /// A tenant's shape spaces, newest first.
    pub(crate) fn of(&self, tenant: &str) -> Vec<View> {
        self.forget_idle();
        let all = lock(&self.all);
        all.spaces.values().rev().filter(|kept| kept.tenant == tenant).map(|kept| kept.view.clone()).collect()
    }

    pub(crate) fn remove(&self, id: &str) {
        lock(&self.all).retain(|kept| kept.view.id != id);
    }

    /// Forgets those that nobody asked for in a while.
    pub(crate) fn forget_idle(&self) {
        lock(&self.all).retain(|kept| lock(&kept.used).elapsed() < self.idle);
    }

    pub(crate) fn count(&self) -> usize {
        lock(&self.all).spaces.len()
    }
}

impl Keyed<KeptSpace> for ShapeSpaces {
    fn requests<R>(&self, work: impl FnOnce(&mut KnownKeys) -> R) -> R {
        self.forget_idle();
        work(&mut lock(&self.all).requests)
    }

    fn made(&self, id: &str) -> Option<Arc<KeptSpace>> {
        let made = lock(&self.all).spaces.get(id).cloned()?;
        *lock(&made.used) = Instant::now();
        Some(made)
    }
}

impl KeptSpace {
    /// The shape with these weights, or its cage.
    ///
    /// # Errors
    /// Weights that name no shape.
    pub(crate) fn shape(&self, weights: &[f64], of_cage: bool) -> Result<Vec<Point>, ApiError> {
        let clock = Instant::now();
        let shape = match &self.shapes {
            Shapes::Cage(shapes) if of_cage => shapes.cage(weights),
            Shapes::Cage(shapes) => shapes.shape(weights),
            Shapes::Mesh(_) if of_cage => {
                let detail = "of: shapes are found on the mesh here, without a cage; leave it out, or make the shape space on a cage";
                return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
            }
            Shapes::Mesh(shapes) => shapes.shape(weights),
        };
        metrics::histogram!("cager_shape_seconds").record(clock.elapsed().as_secs_f64());
        shape.map_err(|error| ApiError::new(problem::INVALID_OPTIONS, format!("weights: {error}")))
    }
}

impl Wanted<'_> {
    /// Poses that were sent as meshes, the first with faces. Blocks.
    ///
    /// # Errors
    /// Files that cannot be read or used, and no memory.
    pub(crate) fn of_files(&self, files: &[NamedFile]) -> Result<Poses, ApiError> {
        self.check_cage()?;
        if !self.options.frames.is_empty() {
            let detail = "frames: belong to source or source_session; leave them out where the poses are meshes";
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        }
        if files.len() > MOST_POSES {
            let detail = format!("pose: there are {} poses, of at most {MOST_POSES}; send fewer", files.len());
            return Err(geometry(detail));
        }
        let Some((first, others)) = files.split_first().filter(|(_, others)| !others.is_empty()) else {
            return Err(geometry(ShapeError::TooFewPoses(files.len()).to_string()));
        };
        let read = |file: &NamedFile| read_part("pose", &file.name, &file.bytes);
        let mut model = read(first)?;
        check_extent("pose", &model)?;
        let origin = own_origin(&model.points);
        move_to(origin, &mut model.points);
        let cage = self.given_cage(origin)?;
        if let Some(cage) = &cage {
            check_place(cage, &model)?;
        }
        let points = model.points.len();
        let made = || pose_cage::vertices(points) as u64;
        let vertices = self.on_cage().then(|| vertices_of(cage.as_ref()).unwrap_or_else(made));
        let memory = self.spaces.reserve(self.tenant, points as u64, files.len(), vertices)?;
        let mut poses = vec![model.points.clone()];
        for file in others {
            let mut pose = read(file)?;
            if pose.points.len() != points {
                let error = ShapeError::OtherPoints { pose: poses.len(), points: pose.points.len(), expected: points };
                return Err(geometry(format!("pose: {}: {error}", file.name)));
            }
            same_faces((&file.name, &pose.faces), (&first.name, &model.faces))
                .map_err(|error| geometry(format!("pose: {error}")))?;
            move_to(origin, &mut pose.points);
            poses.push(pose.points);
        }
        Ok(Poses { model, cage, poses, origin, memory })
    }

    /// Poses that are frames of a container. Blocks.
    ///
    /// # Errors
    /// A container that cannot be read, frames that it does not have, and no memory.
    pub(crate) fn of_container(&self, path: &Path) -> Result<Poses, ApiError> {
        self.check_cage()?;
        let refuse = |error: DecodeError| unreadable(path, &error);
        let fail = |cause| refuse(DecodeError::container(path, cause));
        let frames = &self.options.frames;
        let mut container = decode::open(path).map_err(refuse)?;
        let there = container.frames();
        if let Some(frame) = frames.iter().find(|&&frame| frame as usize >= there) {
            let detail = format!("frames: {frame} is none of the {there} frames, which count from 0");
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        }
        if frames.len() < 2 {
            let detail = "frames: give the numbers of two frames or more, which are the poses";
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        }
        let header = container.header();
        let (points, own_vertices, origin) = (header.points, header.cage_vertices, header.origin);
        let given = self.given_cage(origin)?;
        let vertices = self.on_cage().then(|| vertices_of(given.as_ref()).unwrap_or(own_vertices));
        let memory = self.spaces.reserve(self.tenant, points, frames.len(), vertices)?;
        let model = container.rest().map_err(fail)?;
        let cage = match given {
            Some(cage) => {
                check_place(&cage, &model)?;
                Some(cage)
            }
            None if self.on_cage() => {
                let cage = Cage::new(container.cage().map_err(fail)?);
                Some(cage.map_err(|error| geometry(format!("source: {error}")))?)
            }
            None => None,
        };
        drop(container);
        let mut positions = Animation::open(path).map_err(refuse)?;
        let mut poses = Vec::with_capacity(frames.len());
        for &frame in frames {
            let found = positions.read(&[frame as usize]).map_err(refuse)?.concat();
            poses.push(found.as_chunks::<3>().0.iter().map(|point| point.map(f64::from)).collect());
        }
        Ok(Poses { model, cage, poses, origin, memory })
    }

    fn on_cage(&self) -> bool {
        self.options.on.unwrap_or_default() == ShapesOn::Cage
    }

    /// Refuses a cage that would not be used.
    fn check_cage(&self) -> Result<(), ApiError> {
        if self.cage.is_some() && !self.on_cage() {
            let detail = "cage: belongs to on: cage; leave it out, or ask for that";
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        }
        Ok(())
    }

    /// The cage that was sent.
    fn given_cage(&self, origin: Option<Point>) -> Result<Option<Cage>, ApiError> {
        self.cage.map(|cage| cage_of(cage, origin)).transpose()
    }
}

/// Validates options alone.
///
/// # Errors
/// An option that is out of range.
pub(crate) fn check_options(options: &ShapeSpaceOptions) -> Result<(), ApiError> {
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
    check_told(options.name.as_deref(), None, None)?;
    let frames = &options.frames;
    if frames.len() > MOST_POSES {
        return refuse(format!("frames: there are {} poses, of at most {MOST_POSES}; name fewer", frames.len()));
    }
    let mut there = HashSet::new();
    if let Some(frame) = frames.iter().find(|&&frame| !there.insert(frame)) {
        return refuse(format!("frames: {frame} is there twice; name each frame once"));
    }
    Ok(())
}

/// Refuses a cage that lies far from the model.
fn check_place(cage: &Cage, model: &Model) -> Result<(), ApiError> {
    reject_far_points(cage, &model.points).map_err(|error| geometry(format!("cage: {error}")))
}

fn vertices_of(cage: Option<&Cage>) -> Option<u64> {
    cage.map(|cage| cage.vertices().len() as u64)
}

/// The response for a container that cannot be read, without its path. What the machine refuses is no fault of the container.
fn unreadable(path: &Path, error: &DecodeError) -> ApiError {
    match error {
        DecodeError::Memory { .. } | DecodeError::Container { cause: container::Error::Memory { .. }, .. } => {
            ApiError::internal(error)
        }
        DecodeError::Formats(cager_formats::Error::Io { cause, .. }) if cause.kind() != ErrorKind::UnexpectedEof => {
            ApiError::internal(error)
        }
        error => geometry(format!("source: {}", error.without(path))),
    }
}

/// About how much memory a shape space takes: its poses and what the cage misses of them, and with a cage its coordinates, on the mesh gradients, features
/// and factors.
fn bytes(points: u64, poses: u64, cage_vertices: Option<u64>) -> u64 {
    let on_mesh = |vertices: u64| vertices.saturating_mul(4000 + 400 * poses);
    let shapes = match cage_vertices {
        Some(vertices) => points.saturating_mul(8).saturating_mul(vertices).saturating_add(on_mesh(vertices)),
        None => on_mesh(points),
    };
    points.saturating_mul(48 * poses).saturating_add(shapes)
}

fn geometry(detail: String) -> ApiError {
    ApiError::new(problem::INVALID_GEOMETRY, detail)
}
