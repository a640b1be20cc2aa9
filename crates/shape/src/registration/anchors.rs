//! Points of a template whose places on the surface are known.

use cager_geometry::linalg::{gram, tall_product, transposed_product};
use cager_geometry::vector::Point;
use faer::Mat;
use glam::DVec3;

use crate::points::{matrix, row_points};

/// Points of a template that are pulled to given places, with a weight beside all matches one way.
#[derive(Clone, Debug)]
pub struct Anchors {
    /// Coordinates of the points, k × m.
    coordinates: Mat<f64>,
    /// Where they belong, k × 3.
    places: Mat<f64>,
    /// Of each row, over the squared diagonal.
    weight: f64,
}

const BLOCK_ROWS: usize = 256;

impl Anchors {
    /// Points with these coordinates, one row a point, that belong to these places.
    ///
    /// # Panics
    /// With another number of places than of rows.
    pub fn new(coordinates: Mat<f64>, places: &[Point], weight: f64) -> Self {
        assert_eq!(coordinates.nrows(), places.len(), "a place for each point");
        let weight = weight / places.len().max(1) as f64;
        Self { coordinates, places: Mat::from_fn(places.len(), 3, |i, k| places[i][k]), weight }
    }

    /// What pulls a cage of a template of this diagonal.
    pub(crate) fn pull(&self, cage: &[DVec3], diagonal: f64) -> Vec<DVec3> {
        self.forces(&(&self.places - self.positions(cage)), diagonal)
    }

    /// Half the Hessian, m × m, its lower triangle.
    pub(crate) fn hessian(&self, diagonal: f64) -> Mat<f64> {
        faer::Scale(self.weight / (diagonal * diagonal)) * gram(self.coordinates.as_ref(), BLOCK_ROWS)
    }

    /// The Hessian times a change of the cage.
    pub(crate) fn hessian_times(&self, x: &[DVec3], diagonal: f64) -> Vec<DVec3> {
        self.forces(&self.positions(x), diagonal)
    }

    fn positions(&self, cage: &[DVec3]) -> Mat<f64> {
        tall_product(self.coordinates.as_ref(), matrix(cage).as_ref())
    }

    fn forces(&self, by: &Mat<f64>, diagonal: f64) -> Vec<DVec3> {
        let forces = transposed_product(self.coordinates.as_ref(), by.as_ref(), BLOCK_ROWS);
        row_points((faer::Scale(self.weight / (diagonal * diagonal)) * forces).as_ref())
    }
}
