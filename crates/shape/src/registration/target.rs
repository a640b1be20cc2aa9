//! A surface made ready to be matched.

use glam::DVec3;

use super::matching::OrientedPoints;
use super::observation::Observation;
use crate::points::vectors;

/// A surface made ready to be matched.
pub struct Target {
    pub(crate) points: Vec<DVec3>,
    pub(crate) normals: Vec<DVec3>,
    pub(crate) tree: OrientedPoints,
    pub(crate) normal_length: f64,
}

/// What a normal counts in matches, as a share of the diagonal.
pub(crate) const NORMAL_LENGTH: f64 = 0.02;

impl Target {
    /// An observation for a template of this diagonal.
    ///
    /// # Panics
    /// Where it has no points.
    pub fn new(observation: &Observation, diagonal: f64) -> Self {
        Self::with_normal_length(observation, NORMAL_LENGTH * diagonal)
    }

    /// An observation in whose matches a normal counts as much as a distance of `normal_length`.
    pub(crate) fn with_normal_length(observation: &Observation, normal_length: f64) -> Self {
        Self {
            points: vectors(&observation.points),
            normals: vectors(&observation.normals),
            tree: OrientedPoints::new(&observation.points, &observation.normals, normal_length),
            normal_length,
        }
    }
}
