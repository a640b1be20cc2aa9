//! Which targets follow by a cage.

use crate::points::area_vector;
use crate::points::welded;
use cager_geometry::mesh::TriMesh;
use cager_geometry::topology::UnionFind;
use glam::DVec3;

/// More parts than these, none of which has most of the area, are a soup.
const MANY_PARTS: usize = 10;
/// Most of the area.
const MOST: f64 = 0.5;

/// Whether a target follows better through a cage: without triangles with an area, or as a soup of
/// many parts of which none has most of it. Vertices at the same place connect.
pub fn needs_cage(target: &TriMesh) -> bool {
    let place = welded(&target.vertices);
    let mut parts = UnionFind::new(place.len());
    for [a, b, c] in target.triangles.iter().map(|t| t.map(|v| place[v as usize])) {
        parts.join(a, b);
        parts.join(b, c);
    }
    let (part, count) = parts.numbered();
    let mut areas = vec![0.0; count as usize];
    for triangle in &target.triangles {
        let area = area_vector(triangle.map(|v| DVec3::from(target.vertices[v as usize]))).length();
        areas[part[place[triangle[0] as usize] as usize] as usize] += area;
    }
    let total: f64 = areas.iter().sum();
    let largest = areas.iter().copied().fold(0.0, f64::max);
    let with_area = areas.iter().filter(|&&area| area > 0.0).count();
    with_area == 0 || (with_area > MANY_PARTS && largest < MOST * total)
}
