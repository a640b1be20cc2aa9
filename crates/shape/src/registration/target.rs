//! A surface made ready to be matched.

use glam::DVec3;

use super::matching::OrientedPoints;
use super::observation::Observation;
use crate::points::{plain, vectors};

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
    ///
    /// # Panics
    /// Where it has no points.
    pub fn with_normal_length(observation: &Observation, normal_length: f64) -> Self {
        Self {
            points: vectors(&observation.points),
            normals: vectors(&observation.normals),
            tree: OrientedPoints::new(&observation.points, &observation.normals, normal_length),
            normal_length,
        }
    }

    /// The observation.
    pub fn observation(&self) -> Observation {
        Observation { points: plain(&self.points), normals: plain(&self.normals) }
    }

    /// The observed points.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Their unit normals.
    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// The observed point that a point with this unit normal matches.
    pub fn nearest(&self, point: DVec3, normal: DVec3) -> usize {
        self.tree.nearest(point.to_array(), normal.to_array()).0
    }

    /// [`Self::nearest`], where the number of a point is known that is near already.
    pub fn nearest_from(&self, point: DVec3, normal: DVec3, known: usize) -> usize {
        self.tree.nearest_from(point.to_array(), normal.to_array(), known).0
    }

    /// What a normal counts in matches, in the unit of the points.
    pub fn normal_length(&self) -> f64 {
        self.normal_length
    }
}
