//! People: a template followed by its rig and the manifold of usual poses.

use super::finish::Finisher;
use super::gait::{GaitCurve, gait};
use super::report::How;
use super::surfaces::Surfaces;
use super::{Finished, RecoverError, RecoverProgress, Watch};
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::vector::{distance, norm};
use cager_shape::people::joints::{CagedJoints, MarkedJoints};
use cager_shape::people::manifold::Manifold;
use cager_shape::people::rig::Rig;
use cager_shape::people::{COORDINATES, FitOptions, PersonFit, PersonModel, PersonTracker, SAMPLES};

/// What is known of a person.
pub struct Person<'a> {
    /// Its rig, where the template is.
    pub rig: &'a Rig,
    /// Its usual poses.
    pub manifold: &'a Manifold,
    /// How it is fitted.
    pub options: FitOptions,
}

/// Frames per second of joints where nobody tells.
pub const JOINTS_RATE: f64 = 30.0;

/// Joints in every frame.
pub struct Joints {
    caged: CagedJoints,
    frames: Vec<Vec<Point>>,
    /// The rig's up axis.
    up: Point,
}

impl Joints {
    /// A table, `frame,joint,x,y,z`, by the numbers of the frames.
    pub fn csv(&self, numbers: &[f64]) -> String {
        self.caged.csv(numbers, &self.frames)
    }

    /// How high feet are.
    pub(super) fn gait(&self) -> Vec<GaitCurve> {
        gait(&self.frames, self.up)
    }

    /// A BVH file of so many frames per second.
    pub fn bvh(&self, frame_rate: f64) -> Vec<u8> {
        self.caged.bvh(&self.frames, 1.0 / frame_rate)
    }
}

/// What fits a person.
///
/// # Errors
/// It is no rig.
pub fn rig_of(bytes: &[u8]) -> Result<Rig, String> {
    Rig::from_json(bytes).map_err(|error| error.to_string())
}

/// A manifold learned for this rig: the waist is at its place in the pelvis's frame.
///
/// # Errors
/// It is no manifold, or one of another rig.
pub fn manifold_of(bytes: &[u8], rig: &Rig) -> Result<Manifold, String> {
    let manifold = Manifold::from_json(bytes).map_err(|error| error.to_string())?;
    let (pose, rest) = (manifold.pose(&vec![0.0; manifold.dims()]), rig.rest_pose());
    let waist = |pose: &[f64]| [6, 7, 8].map(|k| pose[k] - pose[k - 6]);
    let (found, own) = (waist(&pose), waist(&rest));
    if distance(found, own).is_nan() || distance(found, own) > 0.01 * norm(own) {
        return Err("was learned for another rig; run `cager manifold` with this one".to_owned());
    }
    Ok(manifold)
}

impl Person<'_> {
    /// Forwards and backwards through all frames.
    pub(super) fn follow<'f>(
        &self,
        rest: &TriMesh,
        surfaces: &Surfaces<'_>,
        finisher: &dyn Fn(usize) -> Result<Finisher<'f>, RecoverError>,
        watch: &Watch<'_>,
    ) -> Result<Finished, RecoverError> {
        let model = surfaces.on_pool(|| PersonModel::new(rest, self.rig, COORDINATES, SAMPLES))?;
        let fit = PersonFit { model: &model, manifold: self.manifold, options: self.options };
        let caged = CagedJoints::new(MarkedJoints::of_rig(self.rig), model.cage(), COORDINATES)?;
        let (mut tracker, mut numbers, mut frames) = (PersonTracker::new(&fit), Vec::new(), 0);
        surfaces.each(0.., |frame, seen| {
            frames += 1;
            // A frame without a surface stays as the one before it.
            let how = match seen {
                Some(followed) => {
                    numbers.push(frame);
                    How::of_person(tracker.follow(&followed.seen.observation))
                }
                None => How::NO_SURFACE,
            };
            let cage = tracker.frames().last().map_or(model.cage().vertices(), |frame| &frame.fit.vertices);
            watch(how.first_look(frame, cage, &caged.positions(cage)));
            Ok(())
        })?;
        if numbers.is_empty() {
            let first = "it held a surface when it was looked at first, and was changed since".to_owned();
            return Err(RecoverError::NoSurface { frames, first });
        }
        surfaces.each((0..frames).rev(), |frame, seen| {
            if let (Some(followed), Ok(at)) = (seen, numbers.binary_search(&frame)) {
                tracker.refit(at, &followed.seen.observation);
            }
            Ok(())
        })?;
        let tracked = tracker.into_frames();
        let mut finisher = finisher(frames)?;
        let (mut reports, mut joints, mut cages) = (Vec::new(), Vec::new(), Vec::new());
        surfaces.each(0..frames, |frame, seen| {
            // A frame without a surface is as the one before it, or as the first that has one.
            let at = numbers.partition_point(|&number| number <= frame).saturating_sub(1);
            let vertices = &tracked[at].fit.vertices;
            let how = if seen.is_some() { How::of_person(&tracked[at]) } else { How::NO_SURFACE };
            reports.push(finisher.finish(frame, model.deformed(vertices), how, seen.as_ref())?);
            joints.push(caged.positions(vertices));
            cages.push(vertices.clone());
            watch(RecoverProgress::Refined(reports.len()));
            Ok(())
        })?;
        let joints = Some(Joints { caged, frames: joints, up: self.rig.up });
        Ok(Finished { reports, cages, joints, written: finisher.into_frames(surfaces.origin)? })
    }
}
