//! Colours of the surfaces on the template: the mean, over all frames, at each of its points.

use super::surfaces::Colored;
use cager_geometry::mesh::Point;
use cager_shape::registration::NearestPoints;
use rayon::prelude::*;

/// Colours farther from a point than this share of the diagonal are not its own.
const MAX_REACH: f64 = 0.02;

/// Adds up colours.
pub(super) struct Painter {
    /// Sums of each point, and how many there are.
    sums: Vec<([f64; 3], f64)>,
    reach: f64,
}

impl Painter {
    pub(super) fn new(points: usize, diagonal: f64) -> Self {
        Self { sums: vec![([0.0; 3], 0.0); points], reach: MAX_REACH * diagonal }
    }

    /// A frame, where the template has these points. The nearer a colour is, the more it counts.
    pub(super) fn add(&mut self, positions: &[Point], seen: &Colored) {
        let Self { sums, reach } = self;
        sums.par_iter_mut().zip(positions).with_min_len(64).for_each(|((sum, weight), &p)| {
            let (nearest, distance2) = seen.tree.nearest(p);
            let near = 1.0 - distance2 / (*reach * *reach);
            if near > 0.0 {
                sum.iter_mut().zip(seen.colors[nearest]).for_each(|(sum, x)| *sum += near * f64::from(x));
                *weight += near;
            }
        });
    }

    /// The means; points where nothing was seen are like the nearest one at rest. None without any.
    pub(super) fn colors(&self, rest: &[Point]) -> Option<Vec<[u8; 3]>> {
        let seen: Vec<usize> = (0..rest.len()).filter(|&v| self.sums[v].1 > 0.0).collect();
        if seen.is_empty() {
            return None;
        }
        let tree = NearestPoints::new(seen.iter().map(|&v| rest[v]));
        let color = |v: usize| {
            let (sum, weight) = self.sums[v];
            let (sum, weight) = if weight > 0.0 { (sum, weight) } else { self.sums[seen[tree.nearest(rest[v]).0]] };
            sum.map(|x| (x / weight).round() as u8)
        };
        Some((0..rest.len()).into_par_iter().with_min_len(256).map(color).collect())
    }
}
