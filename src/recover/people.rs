//! People: a template followed by its rig and the manifold of usual poses.

use super::finish::Finisher;
use super::report::{FrameReport, How};
use super::surfaces::{Followed, SurfaceFiles};
use super::{RecoverError, RecoverProgress, each};
use cager_geometry::mesh::{Point, TriMesh};
use cager_recover::joints::{CagedJoints, MarkedJoints};
use cager_recover::manifold::Manifold;
use cager_recover::people::{FitOptions, PersonFit, PersonModel, track};
use cager_recover::rig::Rig;
use cager_registration::Observation;

/// What is known of a person.
pub struct Person<'a> {
    /// Its rig, where the template is.
    pub rig: &'a Rig,
    /// Its usual poses.
    pub manifold: &'a Manifold,
    /// How it is fitted.
    pub options: FitOptions,
}

/// Joints in every frame.
pub struct Joints {
    caged: CagedJoints,
    frames: Vec<Vec<Point>>,
}

impl Joints {
    /// A table, `frame,joint,x,y,z`, by the numbers of the frames.
    pub fn csv(&self, numbers: &[f64]) -> String {
        self.caged.csv(numbers, &self.frames)
    }

    /// A BVH file of so many frames per second.
    pub fn bvh(&self, frame_rate: f64) -> Vec<u8> {
        self.caged.bvh(&self.frames, 1.0 / frame_rate)
    }
}

/// A person that was followed.
pub(super) struct FollowedPerson {
    pub(super) reports: Vec<FrameReport>,
    pub(super) joints: Joints,
}

impl Person<'_> {
    /// Forwards and backwards through all frames. The points that are looked at of all of them are held in memory.
    pub(super) fn follow(
        &self,
        rest: &TriMesh,
        surfaces: &SurfaceFiles<'_>,
        finisher: &mut Finisher<'_>,
        force: bool,
        progress: &dyn Fn(RecoverProgress),
    ) -> Result<FollowedPerson, RecoverError> {
        let model = PersonModel::new(rest, self.rig, self.options.system, self.options.samples)?;
        let fit = PersonFit { model: &model, manifold: self.manifold, options: self.options };
        let (mut observations, mut numbers): (Vec<Observation>, Vec<usize>) = (Vec::new(), Vec::new());
        each(surfaces, (0..surfaces.files.len()).collect(), force, |frame, seen| {
            if let Some(Followed { target, .. }) = seen {
                observations.push(target.observation());
                numbers.push(frame);
            }
            Ok(())
        })?;
        if numbers.is_empty() {
            let first = "its file was there when it was looked at first".to_owned();
            return Err(RecoverError::NoSurface { frames: surfaces.files.len(), first });
        }
        let tracked = track(&fit, &observations, true, |done, _| progress(RecoverProgress::Followed(done + 1)));
        drop(observations);
        let caged = CagedJoints::new(MarkedJoints::of_rig(self.rig), model.cage(), self.options.system.system())?;
        let (mut reports, mut joints) = (Vec::new(), Vec::new());
        each(surfaces, (0..surfaces.files.len()).collect(), force, |frame, seen| {
            // A frame without a surface stays as the one before it, or is as the first that has one.
            let at = numbers.partition_point(|&number| number <= frame).saturating_sub(1);
            let vertices = &tracked[at].fit.vertices;
            let how = if seen.is_some() { How::of_person(&tracked[at]) } else { How::NO_SURFACE };
            reports.push(finisher.finish(frame, model.deformed(vertices), how, seen.as_ref())?);
            joints.push(caged.positions(vertices));
            progress(RecoverProgress::Refined(reports.len()));
            Ok(())
        })?;
        Ok(FollowedPerson { reports, joints: Joints { caged, frames: joints } })
    }
}
