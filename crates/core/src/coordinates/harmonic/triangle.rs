//! Triangles with what integrals over them need.

use cager_geometry::mesh::Point;
use cager_geometry::vector;

/// A triangle with a density; 1 − α − β, α and β belong to its corners in order.
#[derive(Clone, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [Point; 3],
    pub(super) centre: Point,
    /// Largest distance of a corner from the centre.
    pub(super) radius: f64,
    pub(super) area: f64,
    pub(super) normal: Point,
    /// Gradients of α and β.
    pub(super) gradients: [Point; 2],
    /// Along the edges from corner 0 to 1, 1 to 2 and 0 to 2, their outward normals, and lengths.
    pub(super) along: [Point; 3],
    pub(super) outward: [Point; 3],
    pub(super) lengths: [f64; 3],
}

impl Triangle {
    pub(super) fn new(corners: [Point; 3]) -> Self {
        let [a, b, c] = corners;
        let normal = vector::cross(vector::sub(b, a), vector::sub(c, a));
        let double_area = vector::norm(normal);
        let normal = normal.map(|x| x / double_area);
        let centre = vector::centroid(corners);
        let radius = corners.iter().map(|&p| vector::norm(vector::sub(p, centre))).fold(0.0, f64::max);
        let sides = [vector::sub(b, a), vector::sub(c, b), vector::sub(c, a)];
        let lengths = sides.map(vector::norm);
        let along = [0, 1, 2].map(|e| sides[e].map(|x| x / lengths[e]));
        let outward = [
            vector::cross(along[0], normal),
            vector::cross(along[1], normal),
            vector::cross(along[2], normal).map(|x| -x),
        ];
        let gradient = |opposite: Point| vector::cross(normal, opposite).map(|x| x / double_area);
        let gradients = [gradient(vector::sub(a, c)), gradient(vector::sub(b, a))];
        Self { corners, centre, radius, area: 0.5 * double_area, normal, gradients, along, outward, lengths }
    }

    /// The point with α and β as second and third barycentric coordinate.
    pub(super) fn point(&self, alpha: f64, beta: f64) -> Point {
        let [a, b, c] = self.corners;
        [0, 1, 2].map(|k| a[k] + alpha * (b[k] - a[k]) + beta * (c[k] - a[k]))
    }

    /// Height over the longest side.
    pub(super) fn height(&self) -> f64 {
        2.0 * self.area / self.diameter()
    }

    /// Length of the longest side.
    pub(super) fn diameter(&self) -> f64 {
        self.lengths.iter().copied().fold(0.0, f64::max)
    }
}
