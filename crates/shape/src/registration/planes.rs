//! Squared distances of points from the planes of those that they match on a surface, and back.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::matching::{KnownMatches, OrientedPoints};
use super::target::Target;
use crate::points::outer;

/// Weighted squared distances along normals, by point: `½ xᵢᵀ Bᵢ xᵢ − bᵢᵀ xᵢ` of its displacement.
pub(crate) struct PlaneDistances {
    pub(crate) hessians: Vec<DMat3>,
    pub(crate) pulls: Vec<DVec3>,
}

/// What counts as a match, and how much.
pub(crate) struct MatchWeights {
    /// The weight of all matches one way.
    pub(crate) total: f64,
    /// Distance at which a match counts a quarter.
    pub(crate) reach: f64,
    /// Points that face further apart than this cosine do not match.
    pub(crate) min_cosine: f64,
    /// One observed point in so many is matched back, from this one on.
    pub(crate) every: usize,
    pub(crate) first: usize,
}

impl PlaneDistances {
    /// Of points with these unit normals and a surface. Matches are looked for near the last ones.
    pub(crate) fn new(
        (points, normals): (&[DVec3], &[DVec3]),
        surface: &Target,
        weights: &MatchWeights,
        known: &mut KnownMatches,
    ) -> Self {
        known.keep_if_of(points.len(), surface.points.len());
        let &MatchWeights { total, reach, min_cosine, every, first } = weights;
        let term = |own: DVec3, normal: DVec3, offset: DVec3, share: f64| {
            let (cosine, far) = (own.dot(normal), offset.length_squared() / (reach * reach));
            let weight = if cosine > min_cosine { cosine / (1.0 + far).powi(2) } else { 0.0 };
            let weighted = share * weight * normal;
            (outer(weighted, normal), -offset.dot(normal) * weighted)
        };
        let share = total / points.len() as f64;
        let (mut hessians, mut pulls): (Vec<DMat3>, Vec<DVec3>) = points
            .par_iter()
            .zip(normals)
            .zip(&mut known.there)
            .with_min_len(64)
            .map(|((&p, &n), known)| {
                let (j, _) = surface.tree.nearest_again(p, n, known);
                term(n, surface.normals[j], p - surface.points[j], share)
            })
            .unzip();
        let tree = OrientedPoints::new(points, normals, surface.normal_length);
        let back = known.back.par_iter_mut().enumerate().skip(first).step_by(every).with_min_len(64);
        let share = total / back.len() as f64;
        let terms: Vec<(usize, (DMat3, DVec3))> = back
            .map(|(k, known)| {
                let (point, normal) = (surface.points[k], surface.normals[k]);
                let (i, _) = tree.nearest_again(point, normal, known);
                (i, term(normals[i], normal, points[i] - point, share))
            })
            .collect();
        for (i, (hessian, pull)) in terms {
            hessians[i] += hessian;
            pulls[i] += pull;
        }
        Self { hessians, pulls }
    }
}
