//! Cross-sections of a surface, and distances along it.

use crate::deformation::rows::Rows;
use crate::edge_distances::nearest_sources;
use crate::points::welded;
use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::topology::{Adjacency, UnionFind};
use glam::DVec3;
use std::collections::HashMap;

/// A surface of a person, left along x, up along y, forward along z; vertices in one place are one.
pub(super) struct Body {
    pub(super) points: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Axis-aligned extent of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Extent {
    pub(super) const NONE: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    pub(super) fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::NONE, |e, p| Self { low: e.low.min(p), high: e.high.max(p) })
    }

    pub(super) fn and(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub(super) fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    pub(super) fn size(&self) -> DVec3 {
        self.high - self.low
    }

    pub(super) fn is_none(&self) -> bool {
        self.low.x > self.high.x
    }
}

impl Body {
    /// Joins vertices that share their position exactly.
    pub(super) fn new(points: &[Point], triangles: &[[u32; 3]]) -> Self {
        let rows = Rows::new(&welded(points));
        let points = rows.gathered(&points.iter().map(|&p| p.into()).collect::<Vec<_>>());
        Self { points, triangles: triangles.iter().map(|&t| rows.of(t)).collect() }
    }

    /// The connected parts of a plane section, each as the points where it crosses edges.
    pub(super) fn section(&self, through: DVec3, normal: DVec3) -> Vec<Vec<DVec3>> {
        let height: Vec<f64> = self.points.iter().map(|p| (*p - through).dot(normal)).collect();
        let mut numbers: HashMap<[u32; 2], usize> = HashMap::new();
        let mut crossings: Vec<DVec3> = Vec::new();
        let mut pairs: Vec<[usize; 2]> = Vec::new();
        for triangle in &self.triangles {
            let above = triangle.map(|v| height[v as usize] >= 0.0);
            if above[0] == above[1] && above[1] == above[2] {
                continue;
            }
            let mut ends = [0; 2];
            let mut found = 0;
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                if above[k] != above[(k + 1) % 3] && found < 2 {
                    let (a, b) = (a.min(b), a.max(b));
                    ends[found] = *numbers.entry([a, b]).or_insert_with(|| {
                        let (h, k) = (height[a as usize], height[b as usize]);
                        crossings.push(self.points[a as usize].lerp(self.points[b as usize], h / (h - k)));
                        crossings.len() - 1
                    });
                    found += 1;
                }
            }
            if found == 2 {
                pairs.push(ends);
            }
        }
        let mut parts = UnionFind::new(crossings.len());
        for [a, b] in pairs {
            parts.join(a as u32, b as u32);
        }
        let (part, count) = parts.numbered();
        let mut loops = vec![Vec::new(); count as usize];
        for (point, part) in crossings.into_iter().zip(part) {
            loops[part as usize].push(point);
        }
        loops
    }

    /// Distances along edges from one vertex; infinite in other parts.
    pub(super) fn distances(&self, from: usize) -> Vec<f64> {
        let adjacency = Adjacency::new(&Polygons::of_triangles(&self.triangles), self.points.len());
        nearest_sources(&self.points, &adjacency, &[from as u32]).1
    }
}
