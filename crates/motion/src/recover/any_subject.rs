//! Any subject: a template followed by its cage alone.

use super::finish::Finisher;
use super::report::{FrameReport, How};
use super::surfaces::{Followed, Surfaces};
use super::{Finished, RecoverError, RecoverProgress, Watch};
use cager_core::cage::Cage;
use cager_geometry::linalg::tall_product;
use cager_geometry::mesh::Point;
use cager_shape::registration::Template;
use cager_shape::tracking::{SecondPass, TrackedFrame, Tracker, smoothed};
use faer::Mat;
use std::collections::VecDeque;

/// A template that is followed.
pub(super) struct Recovering<'a> {
    pub(super) phi: &'a Mat<f64>,
    pub(super) template: Template,
}

impl Recovering<'_> {
    /// The first pass, from the first frame.
    pub(super) fn follow(
        &self,
        surfaces: &Surfaces<'_>,
        cage: &Cage,
        watch: &Watch<'_>,
    ) -> Result<Vec<TrackedFrame>, RecoverError> {
        let mut tracker = Tracker::new(&self.template, cage.vertices().to_vec());
        let mut tracked = Vec::new();
        surfaces.each(0.., |frame, seen| {
            let found = match seen {
                Some(seen) => tracker.follow(&seen.target),
                None => tracker.skip(),
            };
            watch(How::of(&found).first_look(frame, &found.cage, &[]));
            tracked.push(found);
            Ok(())
        })?;
        Ok(tracked)
    }

    /// Where the template's points are in a cage.
    pub(super) fn positions(&self, cage: &[Point]) -> Vec<Point> {
        let cage = Mat::from_fn(cage.len(), 3, |i, k| cage[i][k]);
        let found = tall_product(self.phi.as_ref(), cage.as_ref());
        (0..found.nrows()).map(|i| std::array::from_fn(|k| found[(i, k)])).collect()
    }

    /// The second pass, from the last frame: frames refitted from the next one, smoothed, measured,
    /// written.
    pub(super) fn refine(
        &self,
        surfaces: &Surfaces<'_>,
        mut tracked: Vec<TrackedFrame>,
        mut finisher: Finisher<'_>,
        watch: &Watch<'_>,
    ) -> Result<Finished, RecoverError> {
        let pass = SecondPass::new(&self.template, &tracked);
        let mut reports: VecDeque<FrameReport> = VecDeque::with_capacity(tracked.len());
        let mut finish = |frame: usize, seen: Option<&Followed>, tracked: &[TrackedFrame]| {
            let positions = self.positions(&tracked[frame].cage);
            reports.push_front(finisher.finish(frame, positions, How::of(&tracked[frame]), seen)?);
            watch(RecoverProgress::Refined(reports.len()));
            Ok::<_, RecoverError>(())
        };
        // The frame after the one that is looked at, which waits for its other neighbour.
        let mut waiting: Option<(usize, Option<Followed>)> = None;
        surfaces.each((0..tracked.len()).rev(), |frame, seen| {
            if let Some(seen) = seen.as_ref().filter(|_| pass.wants(frame)) {
                let (at, after) = tracked[frame..].split_at_mut(1);
                let after: Vec<&[Point]> = after.iter().take(2).map(|frame| &frame.cage[..]).collect();
                pass.refit(&seen.target, &mut at[0], &after);
            }
            pass.judge(&mut tracked[frame]);
            if let Some((later, at)) = waiting.replace((frame, seen)) {
                if let (Some(at), Some(beyond)) = (&at, tracked.get(later + 1)) {
                    let beside = [&tracked[frame].cage[..], &beyond.cage[..]];
                    let cage = smoothed(&self.template, &at.target, &tracked[later].cage, beside);
                    tracked[later].cage = cage;
                }
                finish(later, at.as_ref(), &tracked)?;
            }
            Ok(())
        })?;
        if let Some((frame, seen)) = waiting {
            surfaces.on_pool(|| finish(frame, seen.as_ref(), &tracked))?;
        }
        let cages = tracked.into_iter().map(|frame| frame.cage).collect();
        Ok(Finished { reports: reports.into(), cages, joints: None, written: finisher.into_frames(surfaces.origin)? })
    }
}
