//! Correction near the surface: the densities leave an error in the boundary values, which decays
//! over the length of an element. A share of the error at the closest point is subtracted.

use super::elements::Unknowns;
use super::surface::{ClosestPoint, Side, Surface};
use crate::simd::{LANES, Lanes};
use cager_geometry::mesh::{Point, distance2_to_triangle};
use cager_geometry::vector;
use rayon::prelude::*;

/// Points with their closest points of the surface and shares.
pub(super) struct Near<'a> {
    pub(super) points: &'a [Point],
    pub(super) closest_points: &'a [ClosestPoint],
    /// From 0 inside to 1 on the surface.
    pub(super) shares: Vec<f64>,
    /// Distance inside the surface at which its values are taken.
    inwards: f64,
}

impl<'a> Near<'a> {
    pub(super) fn new(
        surface: &Surface<'_>,
        unknowns: &Unknowns,
        points: &'a [Point],
        closest_points: &'a [ClosestPoint],
    ) -> Self {
        // The error of a density of degree p changes its sign about p times along an element.
        let reaches: Vec<f64> = unknowns
            .elements
            .iter()
            .map(|element| 0.5 * element.triangle.diameter() / (element.degree + 1) as f64)
            .collect();
        let farthest = reaches.iter().copied().fold(0.0, f64::max);
        let touching = surface.thickness();
        let share = |closest: &ClosestPoint| {
            if closest.side == Side::On {
                return 1.0;
            } else if closest.distance >= farthest {
                return 0.0;
            }
            // All elements that meet at the closest, so that the order of faces does not count.
            let meet = unknowns.elements.iter().zip(&reaches).filter(|(element, _)| {
                let triangle = &element.triangle;
                let apart = vector::norm(vector::sub(triangle.centre, closest.place));
                apart <= triangle.radius + touching
                    && distance2_to_triangle(triangle.corners, closest.place) <= touching * touching
            });
            let reach = meet.map(|(_, &reach)| reach).fold(f64::INFINITY, f64::min);
            (1.0 - closest.distance / reach).max(0.0).powi(3)
        };
        let shares = closest_points.par_iter().map(share).collect();
        Self { points, closest_points, shares, inwards: surface.thickness() }
    }

    /// Eight points, their closest points moved just inside, and the shares; the last point is
    /// repeated. `off_surface` marks the points that are not evaluated on the surface alone.
    pub(super) fn group(&self, first: usize) -> Group {
        let mut group =
            Group { x: [Lanes::ZERO; 3], y: [Lanes::ZERO; 3], share: Lanes::ZERO, off_surface: Lanes::ZERO };
        for l in 0..LANES {
            let i = (first + l).min(self.points.len() - 1);
            let (x, closest) = (self.points[i], &self.closest_points[i]);
            let on_surface = closest.side == Side::On;
            group.off_surface.0[l] = if on_surface { 0.0 } else { 1.0 };
            group.share.0[l] = if on_surface { 0.0 } else { self.shares[i] };
            for k in 0..3 {
                group.x[k].0[l] = x[k];
                let inwards = self.inwards / closest.distance.max(self.inwards);
                group.y[k].0[l] =
                    if self.shares[i] > 0.0 { closest.place[k] + inwards * (x[k] - closest.place[k]) } else { x[k] };
            }
        }
        group
    }
}

/// Eight points at once.
pub(super) struct Group {
    /// The points, and their closest points on the surface, whose error is subtracted.
    pub(super) x: [Lanes; 3],
    pub(super) y: [Lanes; 3],
    /// Share of that error, and 1 for points off the surface, 0 for points on it.
    pub(super) share: Lanes,
    pub(super) off_surface: Lanes,
}
