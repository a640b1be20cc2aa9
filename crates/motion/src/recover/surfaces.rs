//! Observed surfaces, made ready to be followed.

use super::RecoverError;
use super::source::{Arrival, SurfaceSource};
use super::spread::leave_out_strays;
use cager_capture::origin::move_to;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::spatial::Surface;
use cager_shape::registration::{
    NearestPoints, Observation, ObservationError, ObservationNotes, ObservationOptions, Target,
};
use std::sync::mpsc::sync_channel;

/// The surfaces of a recovery, as they are read.
#[derive(Clone, Copy)]
pub(super) struct Surfaces<'a> {
    pub(super) source: &'a dyn SurfaceSource,
    /// Where reading and fitting is done; on the usual threads without.
    pub(super) pool: Option<&'a rayon::ThreadPool>,
    /// Points that are looked at of each.
    pub(super) points: usize,
    /// The template's diagonal.
    pub(super) diagonal: f64,
    /// Subtracted from all points.
    pub(super) origin: Option<Point>,
    /// Whether frames without a surface are passed over.
    pub(super) force: bool,
    /// Whether colours are kept.
    pub(super) colors: bool,
}

/// A surface as it was read.
pub(super) struct Seen {
    pub(super) observation: Observation,
    pub(super) notes: ObservationNotes,
    /// Points that were left out.
    pub(super) strays: usize,
    /// Its triangles, to measure distances to; none of a cloud.
    pub(super) surface: Option<Surface>,
    pub(super) colored: Option<Colored>,
}

/// Points of a surface with their colours.
pub(super) struct Colored {
    pub(super) tree: NearestPoints<3>,
    pub(super) colors: Vec<[u8; 3]>,
}

impl Colored {
    fn of(model: &Model) -> Option<Self> {
        let tree = || NearestPoints::new(model.points.iter().copied());
        (!model.colors.is_empty()).then(|| Self { tree: tree(), colors: model.colors.clone() })
    }
}

/// A surface that can be followed and measured.
pub(super) struct Followed {
    pub(super) seen: Seen,
    pub(super) target: Target,
}

/// What is looked at of a frame. The points that are drawn of it depend on its number alone.
///
/// # Errors
/// There is no surface in it.
pub fn observed(
    model: &Model,
    frame: usize,
    points: usize,
) -> Result<(Observation, ObservationNotes), ObservationError> {
    let options = ObservationOptions { points, seed: 1000 + frame as u64 };
    if model.faces.is_empty() {
        Observation::of_cloud(&model.points, &model.normals, &options)
    } else {
        Observation::of_mesh(&model.points, &model.faces.triangulated(), &options)
    }
}

/// Tells files whose contents are no surface from those that cannot be read.
fn unusable(error: RecoverError) -> RecoverError {
    use cager_formats::Error::{Damaged, Invalid, NonFinite};
    match error {
        RecoverError::Formats(cause @ (Damaged { .. } | Invalid { .. } | NonFinite { .. })) => {
            RecoverError::Unusable(cause)
        }
        other => other,
    }
}

/// Whether a frame may be passed over.
fn holds_no_surface(error: &RecoverError) -> bool {
    matches!(error, RecoverError::Surface { .. } | RecoverError::Unusable(_))
}

impl Surfaces<'_> {
    /// Does work on the threads that are for it.
    pub(super) fn on_pool<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    /// Reads a frame.
    fn read(&self, frame: usize) -> Result<Seen, RecoverError> {
        let mut model = self.source.read(frame).map_err(unusable)?;
        move_to(self.origin, &mut model.points);
        let strays = if model.faces.is_empty() { leave_out_strays(&mut model) } else { 0 };
        let found = observed(&model, frame, self.points);
        let path = || self.source.file(frame);
        let (observation, notes) = found.map_err(|cause| RecoverError::Surface { path: path(), frame, cause })?;
        let surface = (!model.faces.is_empty()).then(|| Surface::from(&TriMesh::from(&model)));
        let colored = self.colors.then(|| Colored::of(&model)).flatten();
        Ok(Seen { observation, notes, strays, surface, colored })
    }

    /// Reads a frame for a template; nothing of one that has no surface, where that is allowed.
    fn follow(&self, frame: usize) -> Result<Option<Followed>, RecoverError> {
        match self.read(frame) {
            Ok(seen) => Ok(Some(Followed { target: Target::new(&seen.observation, self.diagonal), seen })),
            Err(error) if self.force && holds_no_surface(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The first frame that holds a surface, when it is there.
    pub(super) fn first(&self) -> Result<(usize, Seen), RecoverError> {
        let (mut frames, mut first_error) = (0, None);
        for frame in 0.. {
            match self.source.wait_for(frame) {
                Arrival::There => frames = frame + 1,
                Arrival::End => break,
                Arrival::Stopped => return Err(RecoverError::Stopped),
            }
            match self.on_pool(|| self.read(frame)) {
                Ok(seen) => return Ok((frame, seen)),
                Err(error) if !self.force || !holds_no_surface(&error) => return Err(error),
                Err(error) => {
                    first_error.get_or_insert(error);
                }
            }
        }
        let first = first_error.map_or_else(String::new, |error| error.to_string());
        Err(RecoverError::NoSurface { frames, first })
    }

    /// Calls `work` with frames in an order, each read while the one before is worked on; with
    /// nothing for those without a surface, where that is allowed.
    pub(super) fn each(
        &self,
        order: impl Iterator<Item = usize> + Send,
        mut work: impl FnMut(usize, Option<Followed>) -> Result<(), RecoverError> + Send,
    ) -> Result<(), RecoverError> {
        std::thread::scope(|scope| {
            let (send, read) = sync_channel(1);
            scope.spawn(move || {
                for frame in order {
                    let read = match self.source.wait_for(frame) {
                        Arrival::There => self.on_pool(|| self.follow(frame)),
                        Arrival::End => break,
                        Arrival::Stopped => Err(RecoverError::Stopped),
                    };
                    let failed = read.is_err();
                    // Nobody waits where the work failed.
                    if send.send(read.map(|seen| (frame, seen))).is_err() || failed {
                        break;
                    }
                }
            });
            for read in read {
                let (frame, seen) = read?;
                self.on_pool(|| work(frame, seen))?;
            }
            Ok(())
        })
    }
}
