//! The order of points along a space-filling curve.

use cager_geometry::mesh::{Point, bounds};
use rayon::prelude::*;

/// Indices of all points in Morton order.
pub(crate) fn morton_order(points: &[Point]) -> Vec<u32> {
    const CELLS: f64 = 1024.0;
    let (low, high) = bounds(points);
    let widest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let scale = if widest > 0.0 { CELLS / widest } else { 0.0 };
    let cell = |x: f64| (x * scale).min(CELLS - 1.0) as u32;
    let mut order: Vec<(u32, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(i, p)| {
            let code = (0..3).fold(0, |code, k| code | interleave_zeros(cell(p[k] - low[k])) << k);
            (code, i as u32)
        })
        .collect();
    order.par_sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

/// Inserts two zeros between each of the lowest ten bits.
fn interleave_zeros(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}
