//! Where to begin: every example of the manifold under eight headings about the up axis.

use super::matching::{NORMAL_LENGTH, Observed, SCORE_CAP};
use super::model::PersonModel;
use crate::Similarity;
use crate::people::manifold::Manifold;
use crate::people::rig::deform;
use crate::points::vectors;
use crate::registration::{Observation, OrientedPoints};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Headings that are tried.
const HEADINGS: usize = 8;
/// Examples that are tried at the most.
const EXAMPLES: usize = 96;
/// One sample and chosen point in so many is looked at.
const THIN: usize = 20;

/// Placements and latent numbers of the best starts, best first.
pub(super) fn search(
    model: &PersonModel,
    manifold: &Manifold,
    count: usize,
    observed: &Observed<'_>,
) -> Vec<(Similarity, Vec<f64>)> {
    let tried = manifold.examples().min(EXAMPLES);
    let examples: Vec<usize> = (0..tried).map(|k| k * manifold.examples() / tried).collect();
    let up = DVec3::from(model.rig().up);
    let Observation { points, normals } = observed.observation;
    let some: Vec<DVec3> = observed.chosen.iter().map(|&p| points[p].into()).collect();
    let seen: Vec<usize> = observed.chosen.iter().copied().step_by(THIN).collect();
    let cap = SCORE_CAP * model.height();
    let center = middle(&some);
    let mut starts: Vec<(f64, Similarity, usize, usize)> = examples
        .par_iter()
        .flat_map_iter(|&example| {
            let vertices =
                deform(model.rig(), &manifold.pose(manifold.latent(example)), &Similarity::IDENTITY).vertices;
            let sampled = model.sampled(&vertices, THIN);
            let (at, facing) = (vectors(&sampled.points), vectors(&sampled.normals));
            let tree = OrientedPoints::new(&at, &facing, NORMAL_LENGTH * model.diagonal());
            (0..HEADINGS)
                .map(|heading| {
                    let rotation = DMat3::from_axis_angle(up, TAU * heading as f64 / HEADINGS as f64);
                    let turned: Vec<DVec3> = at.iter().map(|&p| rotation * p).collect();
                    let translation = center - middle(&turned);
                    let placement = Similarity { rotation, translation, ..Similarity::IDENTITY };
                    let forth = at.iter().zip(&facing).map(|(&p, &n)| {
                        let p = placement.apply(p);
                        let found = observed.tree.nearest(p, rotation * n).0;
                        p.distance(points[found].into()).min(cap)
                    });
                    let back = seen.iter().map(|&s| {
                        let turned = rotation.transpose() * (DVec3::from(points[s]) - placement.translation);
                        let normal = rotation.transpose() * DVec3::from(normals[s]);
                        let found = tree.nearest(turned, normal).0;
                        turned.distance(at[found]).min(cap)
                    });
                    let cost = forth.sum::<f64>() / at.len() as f64 + back.sum::<f64>() / seen.len() as f64;
                    (cost, placement, heading, example)
                })
                .collect::<Vec<_>>()
        })
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Several of each heading, since the nearest of all may face the wrong way.
    let mut taken = [0; HEADINGS];
    let each = count.div_ceil(HEADINGS / 2).max(1);
    let mut chosen = Vec::new();
    for (_, placement, heading, example) in starts {
        if taken[heading] < each && chosen.len() < count.max(1) {
            taken[heading] += 1;
            chosen.push((placement, manifold.latent(example).to_vec()));
        }
    }
    chosen
}

/// Median along each axis, which points far away do not move.
fn middle(points: &[DVec3]) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| {
        let mut along: Vec<f64> = points.iter().map(|p| p[k]).collect();
        let half = along.len() / 2;
        if along.is_empty() { 0.0 } else { *along.select_nth_unstable_by(half, f64::total_cmp).1 }
    }))
}
