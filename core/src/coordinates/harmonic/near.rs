//! How much of the error that the densities leave on the surface reaches each point.

use super::evaluate::Solution;
use super::surface::{Foot, Side};
use crate::mesh::{self, Point, distance2_to_triangle};
use crate::simd::{LANES, Lanes};
use rayon::prelude::*;

/// Points, and how much of the error at its foot each is freed from.
pub(super) struct Near<'a> {
    pub(super) points: &'a [Point],
    pub(super) feet: &'a [Foot],
    /// From 0 inside to 1 on the surface.
    pub(super) shares: Vec<f64>,
    /// How far inside of the surface its values are taken.
    inwards: f64,
}

impl<'a> Near<'a> {
    pub(super) fn new(solution: &Solution<'_>, points: &'a [Point], feet: &'a [Foot]) -> Self {
        // The error of a density of degree p changes its sign about p times along an element.
        let reaches: Vec<f64> = solution
            .unknowns
            .elements
            .iter()
            .map(|element| 0.5 * element.triangle.diameter() / (element.degree + 1) as f64)
            .collect();
        let farthest = reaches.iter().copied().fold(0.0, f64::max);
        let touching = solution.surface.thickness();
        let share = |foot: &Foot| {
            if foot.side == Side::On {
                return 1.0;
            } else if foot.distance >= farthest {
                return 0.0;
            }
            // All elements that meet at the foot, so that the order of faces does not count.
            let meet = solution.unknowns.elements.iter().zip(&reaches).filter(|(element, _)| {
                let triangle = &element.triangle;
                let apart = mesh::norm([0, 1, 2].map(|k| triangle.centre[k] - foot.place[k]));
                apart <= triangle.radius + touching
                    && distance2_to_triangle(triangle.corners, foot.place) <= touching * touching
            });
            let reach = meet.map(|(_, &reach)| reach).fold(f64::INFINITY, f64::min);
            (1.0 - foot.distance / reach).max(0.0).powi(3)
        };
        let shares = feet.par_iter().map(share).collect();
        Self { points, feet, shares, inwards: solution.surface.thickness() }
    }

    /// Eight points, those places on the surface from which their shares come, just inside, and the shares; the last point again where
    /// there are no more. Points on the surface need nothing of themselves, which the last lanes say.
    pub(super) fn group(&self, first: usize) -> Group {
        let mut group = Group { x: [Lanes::ZERO; 3], y: [Lanes::ZERO; 3], share: Lanes::ZERO, own: Lanes::ZERO };
        for l in 0..LANES {
            let i = (first + l).min(self.points.len() - 1);
            let (x, foot) = (self.points[i], &self.feet[i]);
            let on_surface = foot.side == Side::On;
            group.own.0[l] = if on_surface { 0.0 } else { 1.0 };
            group.share.0[l] = if on_surface { 0.0 } else { self.shares[i] };
            for k in 0..3 {
                group.x[k].0[l] = x[k];
                let inwards = self.inwards / foot.distance.max(self.inwards);
                group.y[k].0[l] =
                    if self.shares[i] > 0.0 { foot.place[k] + inwards * (x[k] - foot.place[k]) } else { x[k] };
            }
        }
        group
    }
}

/// Eight points at once.
pub(super) struct Group {
    /// The points, and the places on the surface whose error they are freed from.
    pub(super) x: [Lanes; 3],
    pub(super) y: [Lanes; 3],
    /// How much of it, and whether the points need something of themselves.
    pub(super) share: Lanes,
    pub(super) own: Lanes,
}
