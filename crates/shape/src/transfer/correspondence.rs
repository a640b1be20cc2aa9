//! Which triangle of one surface lies where a triangle or point of another does.

use crate::points::area_vector;
use crate::registration::OrientedPoints;
use cager_geometry::vector::Point;
use glam::DVec3;
use rayon::prelude::*;

/// Triangles that can be asked for by position and normal.
pub(crate) struct Correspondence {
    tree: OrientedPoints,
}

/// What a normal counts, as a share of the size.
const NORMAL_LENGTH: f64 = 0.05;

impl Correspondence {
    /// Of a surface that was laid onto another one of this size.
    ///
    /// # Panics
    /// Without triangles.
    pub(crate) fn new(vertices: &[Point], triangles: &[[u32; 3]], size: f64) -> Self {
        let (centers, normals): (Vec<Point>, Vec<Point>) = triangles.iter().map(|t| middle(vertices, t)).unzip();
        Self { tree: OrientedPoints::new(&centers, &normals, NORMAL_LENGTH * size) }
    }

    /// The triangle for each of these points with unit normals.
    pub(crate) fn of_points(&self, points: &[Point], normals: &[Point]) -> Vec<u32> {
        points.par_iter().zip(normals).with_min_len(64).map(|(&p, &n)| self.tree.nearest(p, n).0 as u32).collect()
    }

    /// The triangle for each of these triangles.
    pub(crate) fn of_triangles(&self, vertices: &[Point], triangles: &[[u32; 3]]) -> Vec<u32> {
        let (centers, normals): (Vec<Point>, Vec<Point>) = triangles.iter().map(|t| middle(vertices, t)).unzip();
        self.of_points(&centers, &normals)
    }
}

/// Centroid and unit normal.
fn middle(vertices: &[Point], triangle: &[u32; 3]) -> (Point, Point) {
    let corners = triangle.map(|v| DVec3::from(vertices[v as usize]));
    let center = (corners[0] + corners[1] + corners[2]) / 3.0;
    (center.to_array(), area_vector(corners).normalize_or_zero().to_array())
}
