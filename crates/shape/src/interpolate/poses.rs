//! Poses as they are given: what can be wrong with them, and which of their vertices are one.

use std::collections::HashMap;

use crate::points::welded;
use cager_geometry::mesh::{Point, diagonal};
use cager_geometry::vector::distance;
use glam::DVec3;

use crate::deformation::rows::Rows;
use crate::error::ShapeError;

/// Two poses or more, of as many points each, all finite.
pub(super) fn check_poses(poses: &[Vec<Point>]) -> Result<(), ShapeError> {
    if poses.len() < 2 {
        return Err(ShapeError::TooFewPoses(poses.len()));
    }
    let expected = poses[0].len();
    for (pose, points) in poses.iter().enumerate() {
        if points.len() != expected {
            return Err(ShapeError::OtherPoints { pose, points: points.len(), expected });
        }
        if let Some(point) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(ShapeError::NotFinite { pose, point });
        }
    }
    Ok(())
}

/// Vertices at the same place in every pose, as along the seams of textures.
pub(super) struct Seams {
    /// The first vertex at the place of each.
    place: Vec<u32>,
    /// Vertices that are not exactly where the first one is, and by how much, in each pose.
    apart: Vec<(u32, Vec<DVec3>)>,
}

/// Vertices that are one at rest stay so within this share of the diagonal: positions are rounded.
const TOGETHER: f64 = 1e-5;

impl Seams {
    pub(super) fn new(poses: &[Vec<Point>]) -> Self {
        let mut place = welded(&poses[0]);
        let limits: Vec<f64> = poses.iter().map(|pose| TOGETHER * diagonal(pose)).collect();
        let together = |a: usize, b: usize| poses.iter().zip(&limits).all(|(p, limit)| distance(p[a], p[b]) <= *limit);
        let mut apart = Vec::new();
        // Of each place at rest, the vertices at which some are found in all poses.
        let mut places: HashMap<u32, Vec<u32>> = HashMap::new();
        for v in 0..place.len() {
            let known = places.entry(place[v]).or_default();
            let Some(&first) = known.iter().find(|&&first| together(v, first as usize)) else {
                known.push(v as u32);
                place[v] = v as u32;
                continue;
            };
            place[v] = first;
            let offset = |pose: &Vec<Point>| DVec3::from(pose[v]) - DVec3::from(pose[first as usize]);
            let offsets: Vec<DVec3> = poses.iter().map(offset).collect();
            if offsets.iter().any(|offset| *offset != DVec3::ZERO) {
                apart.push((v as u32, offsets));
            }
        }
        Self { place, apart }
    }

    /// The vertices that stay together.
    pub(super) fn rows(&self) -> Rows {
        Rows::new(&self.place)
    }

    /// Moves vertices that were solved as one by how far the poses have them apart.
    pub(super) fn part(&self, points: &mut [DVec3], weights: &[f64]) {
        for (v, offsets) in &self.apart {
            points[*v as usize] += weights.iter().zip(offsets).map(|(&w, offset)| w * *offset).sum::<DVec3>();
        }
    }
}
