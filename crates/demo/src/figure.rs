//! The figure that moves.

use cager_geometry::mesh::Point;
use std::f64::consts::TAU;

/// Height of the figure; all other lengths here are in the same unit.
pub(super) const HEIGHT: f64 = 2.0;

/// Half-width of the figure by height, both as fractions: hem, waist, shoulders, neck, head.
const SILHOUETTE: [(f64, f64); 12] = [
    (0.00, 0.310),
    (0.08, 0.305),
    (0.18, 0.240),
    (0.32, 0.165),
    (0.46, 0.100),
    (0.53, 0.088),
    (0.63, 0.108),
    (0.72, 0.118),
    (0.79, 0.075),
    (0.84, 0.054),
    (0.92, 0.080),
    (1.00, 0.078),
];

pub(super) fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-9 { 1.0 } else { x.sin() / x }
}

/// Horizontal position of the spine, the centre of the slice at height `z`: she stands on one leg.
pub(super) fn spine(z: f64) -> [f64; 2] {
    let h = z / HEIGHT;
    [0.07 * (4.6 * h).sin(), 0.05 * (3.4 * h + 0.5).sin()]
}

/// Mean radius of the slice at height `z`, zero at the poles.
pub(super) fn mean_radius(z: f64) -> f64 {
    let h = (z / HEIGHT).clamp(0.0, 1.0);
    // Elliptic caps close the silhouette with a horizontal tangent plane.
    let cap = |depth: f64| (1.0 - (1.0 - depth).max(0.0).powi(2)).max(0.0).sqrt();
    HEIGHT * silhouette(h) * cap(h / 0.10) * cap((1.0 - h) / 0.08)
}

/// Outward normal of the silhouette at height `z`: its horizontal and its vertical part.
pub(super) fn silhouette_normal(z: f64) -> [f64; 2] {
    let step = 1e-4 * HEIGHT;
    let rise = mean_radius(z + step) - mean_radius(z - step);
    let length = rise.hypot(2.0 * step);
    [2.0 * step / length, -rise / length]
}

/// Moves a point of the figure along the silhouette's normal.
pub(super) fn pushed_out([x, y, z]: Point, distance: f64) -> Point {
    let [cx, cy] = spine(z);
    let (dx, dy) = (x - cx, y - cy);
    let [out, up] = silhouette_normal(z);
    let scale = distance * out / dx.hypot(dy).max(1e-12);
    [x + scale * dx, y + scale * dy, z + distance * up]
}

/// Cubic Hermite interpolation of [`SILHOUETTE`].
pub(super) fn silhouette(h: f64) -> f64 {
    let last = SILHOUETTE.len() - 1;
    let slope = |k: usize| {
        let (a, b) = (SILHOUETTE[k.saturating_sub(1)], SILHOUETTE[(k + 1).min(last)]);
        (b.1 - a.1) / (b.0 - a.0)
    };
    let k = SILHOUETTE[1..last].iter().take_while(|knot| knot.0 <= h).count();
    let ((h0, r0), (h1, r1)) = (SILHOUETTE[k], SILHOUETTE[k + 1]);
    let (width, s) = (h1 - h0, (h - h0) / (h1 - h0));
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * r0
        + (3.0 * s2 - 2.0 * s3) * r1
        + width * ((s3 - 2.0 * s2 + s) * slope(k) + (s3 - s2) * slope(k + 1))
}

/// Radius of the figure at height `z` and angle `v` about the spine.
pub(super) fn radius(z: f64, v: f64) -> f64 {
    let h = (z / HEIGHT).clamp(0.0, 1.0);
    let bump = |centre: f64, width: f64| (-((h - centre) / width).powi(2)).exp();
    let pleats =
        0.24 * (1.0 - h / 0.5).max(0.0).powf(1.3) * ((5.0 * v + 5.5 * h).cos() + 0.25 * (10.0 * v + 11.0 * h).cos());
    let shoulders = 0.34 * bump(0.70, 0.09) * (2.0 * v).cos();
    let train = 0.16 * bump(0.12, 0.25) * (v - 4.2).cos();
    mean_radius(z) * (1.0 + pleats + shoulders + train)
}

/// Position at height `z`, angle `v` and distance `r` from the spine.
pub(super) fn place(centre: [f64; 2], r: f64, v: f64, z: f64) -> Point {
    [centre[0] + r * v.cos(), centre[1] + r * v.sin(), z]
}

/// Heights of `rings` slices, evenly spaced along the silhouette, poles not included.
pub(super) fn heights(rings: usize) -> Vec<f64> {
    const STEPS: usize = 4096;
    // Steps crowd towards the poles, where the radius changes fastest.
    let height = |i: usize| 0.5 * HEIGHT * (1.0 - (0.5 * TAU * i as f64 / STEPS as f64).cos());
    let mut lengths = vec![0.0; STEPS + 1];
    for i in 1..=STEPS {
        let step = (mean_radius(height(i)) - mean_radius(height(i - 1))).hypot(height(i) - height(i - 1));
        lengths[i] = lengths[i - 1] + step;
    }
    (1..=rings)
        .map(|k| {
            let target = lengths[STEPS] * k as f64 / (rings + 1) as f64;
            let i = lengths.partition_point(|&length| length < target).clamp(1, STEPS);
            let s = (target - lengths[i - 1]) / (lengths[i] - lengths[i - 1]);
            height(i - 1) + s * (height(i) - height(i - 1))
        })
        .collect()
}
