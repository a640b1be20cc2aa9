//! Observed surfaces, and which of their points belong to which of the template's: the nearest in six dimensions, of position and normal.

use cager_geometry::mesh::Point;
use cager_geometry::spatial::{Aabb, Bvh};
use glam::DVec3;

/// A surface as it was seen once: points of it with outward unit normals, as many of each.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// The points.
    pub points: Vec<Point>,
    /// Their unit normals.
    pub normals: Vec<Point>,
}

/// Points with normals, by both.
pub(super) struct OrientedPoints {
    tree: Bvh,
    points: Vec<(DVec3, DVec3)>,
    /// Square of the distance that counts as much as a normal's length.
    normal2: f64,
}

impl OrientedPoints {
    /// A normal counts as much as a distance of `normal_length`.
    pub(super) fn new(points: &[Point], normals: &[Point], normal_length: f64) -> Self {
        let points: Vec<(DVec3, DVec3)> = points.iter().zip(normals).map(|(&p, &n)| (p.into(), n.into())).collect();
        let boxes: Vec<Aabb> = points.iter().map(|&(p, _)| Aabb { low: p, high: p }).collect();
        Self { tree: Bvh::new(&boxes), points, normal2: normal_length * normal_length }
    }

    /// The nearest point, by number; boxes of positions alone bound distances in six dimensions from below.
    pub(super) fn nearest(&self, point: Point, normal: Point) -> usize {
        let (p, n) = (DVec3::from(point), DVec3::from(normal));
        let distance2 = |item: u32| {
            let (q, m) = self.points[item as usize];
            p.distance_squared(q) + self.normal2 * n.distance_squared(m)
        };
        self.tree.nearest(p, f64::INFINITY, distance2).map_or(0, |(item, _)| item as usize)
    }
}
