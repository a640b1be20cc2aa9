//! Arms and legs fitted in the wrong place: each is tried as in every example.
//!
//! Gauss–Newton does not bring an arm back that lies on the trunk: its own place is out of reach.

use super::matching::{MIN_COSINE, NORMAL_LENGTH, Observed, SCORE_CAP};
use super::model::PersonModel;
use crate::Similarity;
use crate::people::manifold::Manifold;
use crate::people::rig::{QUADS, deform};
use crate::registration::{Observation, OrientedPoints};
use crate::rotation::{exp, log};
use cager_geometry::mesh::Point;
use glam::DVec3;
use rayon::prelude::*;

/// Quads of each limb and the one of the trunk that it is at: left arm, left leg, right ones.
pub(super) const LIMBS: [([usize; 4], usize); 4] =
    [([5, 6, 7, 8], 2), ([9, 10, 11, 12], 0), ([13, 14, 15, 16], 2), ([17, 18, 19, 20], 0)];
/// Examples that are tried at the most.
const EXAMPLES: usize = 120;
/// One sample and chosen point in so many is looked at.
const THIN: usize = 3;
/// A limb is put elsewhere where it then lies better by this factor.
const BETTER: f64 = 0.97;

/// Mean distances of each limb, from those of its quads.
pub(super) fn limb_scores(parts: &[f64; QUADS]) -> [f64; 4] {
    LIMBS.map(|(quads, _)| quads.iter().map(|&quad| parts[quad]).sum::<f64>() / 4.0)
}

/// A placed pose with some limbs where they explain more; none where they are well as they are.
pub(super) fn pose_with_other_limbs(
    (model, manifold): (&PersonModel, &Manifold),
    observed: &Observed<'_>,
    (placement, pose): (&Similarity, &[f64]),
    limbs: &[usize],
) -> Option<Vec<f64>> {
    let count = manifold.examples().min(EXAMPLES);
    let examples: Vec<Vec<f64>> =
        (0..count).map(|k| manifold.pose(manifold.latent(k * manifold.examples() / count))).collect();
    let mut pose = pose.to_vec();
    let mut changed = false;
    for &limb in limbs {
        let cost = LimbCost::new(model, observed, placement, &pose, limb);
        let now = cost.of(&pose);
        let costs: Vec<(f64, Vec<f64>)> = examples
            .par_iter()
            .map(|example| {
                let tried = with_limb(&pose, example, limb);
                (cost.of(&tried), tried)
            })
            .collect();
        let best = costs.into_iter().reduce(|best, other| if other.0 < best.0 { other } else { best });
        if let Some((_, better)) = best.filter(|(least, _)| *least < BETTER * now) {
            (pose, changed) = (better, true);
        }
    }
    changed.then_some(pose)
}

/// A pose with a limb as it is in another one, relative to the trunk.
fn with_limb(pose: &[f64], other: &[f64], limb: usize) -> Vec<f64> {
    let (quads, trunk) = LIMBS[limb];
    let at = |pose: &[f64], quad: usize| {
        (DVec3::from_slice(&pose[6 * quad..]), exp(DVec3::from_slice(&pose[6 * quad + 3..])))
    };
    let ((here, turn), (there, other_turn)) = (at(pose, trunk), at(other, trunk));
    let back = turn * other_turn.transpose();
    let mut mixed = pose.to_vec();
    for quad in quads {
        let (position, rotation) = at(other, quad);
        mixed[6 * quad..6 * quad + 3].copy_from_slice(&(here + back * (position - there)).to_array());
        mixed[6 * quad + 3..6 * quad + 6].copy_from_slice(&log(back * rotation).to_array());
    }
    mixed
}

/// What is left unexplained by a limb in some pose, with the rest of the body where it is.
struct LimbCost<'a> {
    model: &'a PersonModel,
    observed: &'a Observed<'a>,
    placement: &'a Similarity,
    /// Samples of the limb.
    samples: Vec<usize>,
    /// Chosen points, and how far each is from the rest of the body.
    seen: Vec<(usize, f64)>,
}

impl<'a> LimbCost<'a> {
    fn new(
        model: &'a PersonModel,
        observed: &'a Observed<'a>,
        placement: &'a Similarity,
        pose: &[f64],
        limb: usize,
    ) -> Self {
        let (samples, others): (Vec<usize>, Vec<usize>) =
            (0..model.sample_count()).step_by(THIN).partition(|&s| LIMBS[limb].0.contains(&model.part(s)));
        let rest = model.sampled_at(&deform(model.rig(), pose, placement).vertices, &others);
        let cap = SCORE_CAP * model.height();
        let Observation { points, normals } = observed.observation;
        let chosen = observed.chosen.iter().step_by(THIN);
        let seen = if rest.points.is_empty() {
            chosen.map(|&p| (p, cap)).collect()
        } else {
            let tree = OrientedPoints::new(&rest.points, &rest.normals, NORMAL_LENGTH * model.diagonal());
            let distance = |p: usize| {
                let near = tree.nearest(points[p], normals[p]).0;
                apart((points[p], normals[p]), (rest.points[near], rest.normals[near]), cap)
            };
            chosen.map(|&p| (p, distance(p))).collect()
        };
        Self { model, observed, placement, samples, seen }
    }

    fn of(&self, pose: &[f64]) -> f64 {
        let model = self.model;
        let cap = SCORE_CAP * model.height();
        let sampled = model.sampled_at(&deform(model.rig(), pose, self.placement).vertices, &self.samples);
        let Observation { points, normals } = self.observed.observation;
        let own = || sampled.points.iter().copied().zip(sampled.normals.iter().copied());
        let forth: f64 = own()
            .map(|(p, n)| {
                let near = self.observed.tree.nearest(p, n).0;
                apart((p, n), (points[near], normals[near]), cap)
            })
            .sum();
        let back: f64 = self
            .seen
            .iter()
            .map(|&(p, far)| own().fold(far, |least, own| least.min(apart((points[p], normals[p]), own, far))))
            .sum();
        forth / (model.sample_count() / THIN) as f64 + back / self.seen.len() as f64
    }
}

/// The distance of two points, and `most` where it is more or they face apart.
fn apart((p, n): (Point, Point), (q, m): (Point, Point), most: f64) -> f64 {
    let distance2 = DVec3::from(p).distance_squared(q.into());
    if distance2 < most * most && DVec3::from(n).dot(m.into()) > MIN_COSINE { distance2.sqrt() } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::people::tests::{mannequin, poses};

    #[test]
    fn a_limb_of_another_pose_is_where_it_was_there_relative_to_the_trunk() {
        let rig = mannequin();
        let all = poses(&rig, 2);
        for (limb, (quads, trunk)) in LIMBS.into_iter().enumerate() {
            let mixed = with_limb(&all[0], &all[1], limb);
            assert!(with_limb(&all[0], &all[0], limb).iter().zip(&all[0]).all(|(a, b)| (a - b).abs() < 1e-9));
            let local = |pose: &[f64], quad: usize| {
                let at = |k: usize| DVec3::from_slice(&pose[k..]);
                exp(at(6 * trunk + 3)).transpose() * (at(6 * quad) - at(6 * trunk))
            };
            for quad in 0..QUADS {
                let like = if quads.contains(&quad) { &all[1] } else { &all[0] };
                assert!((local(&mixed, quad) - local(like, quad)).length() < 1e-9, "{limb} {quad}");
            }
        }
    }
}
