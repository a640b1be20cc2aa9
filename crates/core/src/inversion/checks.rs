//! What cannot be prepared: points, options and coordinates.

use super::{Handles, PrepareError, SolverOptions};
use crate::cage::Cage;
use crate::coordinates::{CoordinateSystem, CoordinatesError, MeanValue};
use cager_geometry::linalg::tall_product;
use cager_geometry::mesh::{Point, diagonal};
use cager_geometry::spatial::Surface;
use cager_geometry::vector::{norm, sub};
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Coordinates with a larger affine reproduction error, over the diagonal, are rejected.
const NOT_REPRODUCED: f64 = 1e-6;

/// Largest distance of a point from the cage, in diagonals of the cage. Beside those of a point
/// farther away, other coordinates may fall below
/// [`WEAK_SINGULAR_VALUE`](crate::regularize::WEAK_SINGULAR_VALUE).
const FAR: f64 = 1e5;

/// Points outside by at most this fraction of the diagonal count as lying on the cage.
const ON_THE_CAGE: f64 = 1e-9;

/// Rejects points so far from the cage that their coordinates are dominated by rounding.
pub fn reject_far_points(cage: &Cage, points: &[Point]) -> Result<(), PrepareError> {
    let [a, b, c] = cage.vertices()[0];
    for (point, p) in points.iter().enumerate() {
        let distance = norm([p[0] - a, p[1] - b, p[2] - c]) / cage.diagonal();
        if distance > FAR {
            return Err(PrepareError::TooFar { point, distance });
        }
    }
    Ok(())
}

/// Rejects a cage whose components are for another model or not for this system.
///
/// # Errors
/// Such a cage.
pub fn reject_carriers(system: &dyn CoordinateSystem, cage: &Cage, points: usize) -> Result<(), CoordinatesError> {
    match cage.carriers().last() {
        None => Ok(()),
        Some(_) if system.name() != MeanValue.name() => Err(CoordinatesError::ByComponent { system: system.name() }),
        Some(_) if cage.carries(points) => Ok(()),
        Some(last) => Err(CoordinatesError::Carried { carried: last.points.end, points }),
    }
}

/// Rejects a point whose coordinates are dominated by rounding.
pub(super) fn reject_missed((point, error): (usize, f64), cage: &Cage, diagonal: f64) -> Result<(), PrepareError> {
    let relative = error / diagonal.min(cage.diagonal());
    if relative.is_nan() || relative > NOT_REPRODUCED {
        return Err(PrepareError::NotReproduced { point, error: relative });
    }
    Ok(())
}

pub(super) fn check(
    points: &[Point],
    unknowns: usize,
    options: SolverOptions,
    memory: u64,
) -> Result<(), PrepareError> {
    if let Some(point) = points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
        return Err(PrepareError::NotFinite { point });
    }
    if points.len() < unknowns {
        return Err(PrepareError::TooFewPoints { points: points.len(), unknowns });
    }
    let diagonal = diagonal(points);
    if diagonal == 0.0 {
        return Err(PrepareError::NoExtent);
    }
    if !diagonal.is_finite() {
        return Err(PrepareError::TooLarge);
    }
    check_options(points.len(), unknowns, options, memory)
}

/// Checks options for so many points and unknowns; handles may take `memory` bytes.
pub fn check_options(points: usize, unknowns: usize, options: SolverOptions, memory: u64) -> Result<(), PrepareError> {
    if options.regularizer.has_threshold() && options.spectrum > unknowns {
        return Err(PrepareError::SpectrumTooLarge { spectrum: options.spectrum, unknowns });
    }
    if !(options.lambda.is_finite() && options.lambda >= 0.0) {
        return Err(PrepareError::BadLambda { lambda: options.lambda });
    }
    let count = options.handles.count(points, unknowns);
    if !(unknowns..=points).contains(&count) {
        return Err(PrepareError::HandleCount { count, unknowns, points });
    }
    // Their covariance, its factor, and what is solved with it.
    let needed = coordinates_bytes(count, 2 * count + 2 * unknowns, 1);
    if matches!(options.handles, Handles::Spread { .. }) && needed > memory {
        return Err(PrepareError::HandlesOutOfMemory { count, gigabytes: 1e-9 * needed as f64 });
    }
    Ok(())
}

/// Bytes of `copies` double-precision matrices n × m, to be compared with what is free: a system
/// may promise more memory than it has, and end the program where it is used.
pub fn coordinates_bytes(points: usize, unknowns: usize, copies: usize) -> u64 {
    [points, unknowns, copies].into_iter().fold(8, |bytes, factor| bytes.saturating_mul(factor as u64))
}

/// Of the points reported as outside, those neither on the cage nor inside a self-overlapping part
/// of it; and their largest distance over the diagonal.
pub(super) fn outside(cage: &Cage, points: &[Point], found: &[u32], diagonal: f64) -> (Vec<u32>, f64) {
    // Relative to a vertex, so that a cage far from the origin keeps its digits.
    let origin = cage.vertices()[0];
    let mut mesh = cage.mesh().clone();
    mesh.vertices.iter_mut().for_each(|p| *p = sub(*p, origin));
    let surface = Surface::from(&mesh);
    let at = |i: u32| sub(points[i as usize], origin).into();
    let distance = |i: u32| surface.nearest(at(i)).map_or(0.0, |found| found.distance) / diagonal;
    let enclosed = |i: u32| surface.contains(at(i));
    let measured: Vec<(u32, f64)> = found
        .par_iter()
        .map(|&i| (i, distance(i)))
        .filter(|&(i, distance)| distance > ON_THE_CAGE && !enclosed(i))
        .collect();
    let farthest = measured.iter().map(|&(_, distance)| distance).fold(0.0, f64::max);
    (measured.into_iter().map(|(i, _)| i).collect(), farthest)
}

/// The point of the largest `|Φ C − P|`, and that distance, about the cage's first vertex.
pub(super) fn reproduction_error(phi: MatRef<'_, f64>, rest: &[Point], cage: &Cage, points: &[Point]) -> (usize, f64) {
    let o = cage.vertices()[0];
    let c = about_first(rest, cage.vertices().len());
    let product = tall_product(phi, c.as_ref());
    let error =
        |(i, p): (usize, &Point)| (i, (0..3).map(|k| (product[(i, k)] - (p[k] - o[k])).powi(2)).sum::<f64>().sqrt());
    points.iter().enumerate().map(error).fold((0, 0.0), |a, b| if b.1 > a.1 || b.1.is_nan() { b } else { a })
}

/// Unknowns relative to the first vertex, m × 3, for precision.
pub(crate) fn about_first(unknowns: &[Point], positions: usize) -> Mat<f64> {
    Mat::from_fn(unknowns.len(), 3, |i, k| unknowns[i][k] - if i < positions { unknowns[0][k] } else { 0.0 })
}
