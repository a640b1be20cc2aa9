//! A person without a frame before: many starts, of which ever fewer are refined ever further.

use super::fit::{FrameFit, PersonFit, Rounds};
use super::matching::Observed;
use super::options::{FIRST_ROUNDS, Method};
use super::search::search;
use super::stages::{LatentStage, QuadStage, Stage};
use crate::Similarity;
use glam::DVec3;
use rayon::prelude::*;

/// Starts whose latent numbers are fitted to few points, in earnest, and all the way.
const KEPT: [usize; 3] = [24, 6, 2];
/// Starts of those fitted in earnest that face about the same way.
const ALIKE: usize = 2;
/// Cosine of headings that are about the same.
const SAME_WAY: f64 = 0.5;

/// A start on its way.
struct Start<'a> {
    score: f64,
    stage: LatentStage<'a>,
}

impl<'a> PersonFit<'a> {
    /// The fit of an observation, beginning at examples of the manifold.
    pub(super) fn first_fit(&self, observed: &Observed<'_>) -> FrameFit {
        let starts = search(self.model, self.manifold, KEPT[0], observed);
        if self.options.method == Method::Paper {
            let (placement, latent) = starts.into_iter().next().unwrap_or_else(|| self.middle());
            return self.finish(observed, self.latent_stage(placement, latent), FIRST_ROUNDS);
        }
        let mut all: Vec<Start<'a>> = starts
            .into_par_iter()
            .map(|(placement, latent)| {
                let mut stage = self.latent_stage(placement, latent);
                self.run(&mut stage, observed, Rounds { count: 6, thin: 5, reach: [20.0, 8.0] });
                let score = self.matching(observed, 5).score(&stage.linearized().vertices).mean;
                Start { score, stage }
            })
            .collect();
        all.sort_by(|a, b| a.score.total_cmp(&b.score));
        let mut some = self.different(all);
        some.par_iter_mut().for_each(|start| self.improve(observed, start));
        some.sort_by(|a, b| a.score.total_cmp(&b.score));
        some.truncate(KEPT[2]);
        let [_, quads, vertices] = FIRST_ROUNDS;
        let finished = some.into_iter().map(|start| {
            let fit = self.finish(observed, start.stage, [quads, quads, vertices]);
            self.refit_with_other_limbs(observed, fit, &[0, 1, 2, 3])
        });
        // The examples of a manifold are never none, so there is a start.
        finished.reduce(|best, fit| if fit.score < best.score { fit } else { best }).unwrap_or_else(|| {
            let (placement, latent) = self.middle();
            self.finish(observed, self.latent_stage(placement, latent), [0; 3])
        })
    }

    fn middle(&self) -> (Similarity, Vec<f64>) {
        (Similarity::IDENTITY, vec![0.0; self.manifold.dims()])
    }

    /// The best starts, of which only some face the same way: the best may face the wrong one.
    fn different(&self, starts: Vec<Start<'a>>) -> Vec<Start<'a>> {
        let forward = DVec3::from(self.model.rig().forward);
        let mut some: Vec<Start<'a>> = Vec::with_capacity(KEPT[1]);
        for start in starts {
            let facing = |start: &Start<'_>| start.stage.placement.rotation * forward;
            let alike = some.iter().filter(|other| facing(other).dot(facing(&start)) > SAME_WAY).count();
            if some.len() < KEPT[1] && alike < ALIKE {
                some.push(start);
            }
        }
        some
    }

    /// Latent numbers and quads of a start, twice: the second time from its offset off the
    /// manifold.
    fn improve(&self, observed: &Observed<'_>, start: &mut Start<'a>) {
        let (rig, height) = (self.model.rig(), self.model.height());
        for count in [12, 6] {
            self.run(&mut start.stage, observed, Rounds { count, thin: 3, reach: [10.0, 5.0] });
            let mut quads = QuadStage::new(rig, height, &self.options, start.stage.placement, start.stage.pose());
            self.run(&mut quads, observed, Rounds { count: 6, thin: 3, reach: [8.0, 4.0] });
            start.stage.offset = vec![0.0; start.stage.offset.len()];
            start.stage.offset = self.offset(&start.stage, &quads.pose);
            start.stage.placement = quads.placement;
            start.score = self.matching(observed, 2).score(&quads.linearized().vertices).mean;
        }
    }
}
