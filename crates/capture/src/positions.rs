//! Positions in single precision, as cages are decoded to them.

use cager_core::decode::Decoder;
use cager_core::inversion::BATCH;
use cager_geometry::mesh::Point;

/// Where cages take the points of a model, three coordinates a point.
pub(crate) fn decoded(decoder: &Decoder, cages: &[&[f32]]) -> Vec<Vec<f32>> {
    let mut positions = vec![Vec::new(); cages.len()];
    for (cages, positions) in cages.chunks(BATCH).zip(positions.chunks_mut(BATCH)) {
        decoder.decode(cages, positions);
    }
    positions
}

/// Three coordinates each as points.
pub(crate) fn points(single: &[f32]) -> Vec<Point> {
    single.as_chunks().0.iter().map(|point: &[f32; 3]| point.map(f64::from)).collect()
}

/// The first point that is not finite or too large for single precision.
pub(crate) fn not_single(points: &[Point]) -> Option<usize> {
    points.iter().position(|point| !point.iter().all(|x| x.abs() <= f64::from(f32::MAX)))
}
