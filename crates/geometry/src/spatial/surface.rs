//! A triangle mesh with a tree over its faces: nearest points, and the side that a point is on.

use super::distance::{closest_on_triangle, point_triangle2};
use super::predicates::{orient2d, orient3d};
use super::{Aabb, Bvh};
use crate::mesh::{Point, TriMesh};
use glam::DVec3;
use rayon::prelude::*;

/// A triangle mesh that can be asked for distances and winding numbers. Corners may coincide: a
/// triangle may be a point or a segment.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Positions.
    pub vertices: Vec<DVec3>,
    /// Triangles over them.
    pub triangles: Vec<[u32; 3]>,
    /// Tree over the triangles.
    pub tree: Bvh,
}

/// The point of a surface nearest to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The triangle.
    pub face: u32,
    /// Weights of its corners.
    pub weights: [f64; 3],
    /// The point.
    pub point: DVec3,
    /// How far away it is.
    pub distance: f64,
}

impl Surface {
    /// A surface of some triangles, all of whose corners exist.
    pub fn new(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let around = |t: &[u32; 3]| Aabb::around(t.map(|v| vertices[v as usize]));
        let boxes: Vec<Aabb> = triangles.par_iter().with_min_len(1024).map(around).collect();
        let tree = Bvh::new(&boxes);
        Self { vertices, triangles, tree }
    }

    /// Corners of a triangle.
    #[inline]
    pub fn corners(&self, face: u32) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[face as usize];
        [self.vertices[a as usize], self.vertices[b as usize], self.vertices[c as usize]]
    }

    /// The nearest point of the surface; `None` for a surface without triangles.
    pub fn nearest(&self, p: DVec3) -> Option<Nearest> {
        self.nearest_within(p, f64::INFINITY)
    }

    /// The nearest point of the surface that is less than `limit` away.
    pub fn nearest_within(&self, p: DVec3, limit: f64) -> Option<Nearest> {
        let (face, d2) = self.tree.nearest(p, limit * limit, |face| point_triangle2(p, self.corners(face)))?;
        let corners = self.corners(face);
        let weights = closest_on_triangle(p, corners);
        let point = weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2];
        Some(Nearest { face, weights, point, distance: d2.sqrt() })
    }

    /// Distance to the surface where it is less than `limit`.
    pub fn distance_within(&self, p: DVec3, limit: f64) -> Option<f64> {
        self.tree.nearest(p, limit * limit, |face| point_triangle2(p, self.corners(face))).map(|(_, d2)| d2.sqrt())
    }

    /// Winding number of a closed surface around `p`: 1 inside an outward-oriented cage, 0 outside.
    /// Counts the faces that a ray along x crosses, exactly, the point moved by infinitely little.
    pub fn winding(&self, p: DVec3) -> i32 {
        let ray = Aabb { low: p, high: DVec3::new(f64::INFINITY, p.y, p.z) };
        let mut winding = 0;
        self.tree.visit(&ray, |face| {
            winding += crossing(p, self.corners(face));
            true
        });
        winding
    }

    /// Whether a closed, outward-oriented surface has `p` inside.
    pub fn contains(&self, p: DVec3) -> bool {
        self.winding(p) > 0
    }
}

impl From<&TriMesh> for Surface {
    fn from(mesh: &TriMesh) -> Self {
        Self::new(mesh.vertices.iter().map(|&p| p.into()).collect(), mesh.triangles.clone())
    }
}

/// The points outside a closed, outward-oriented cage, ascending, each with its distance from it.
pub fn outside(cage: &TriMesh, points: &[Point]) -> Vec<(u32, f64)> {
    let surface = Surface::from(cage);
    let farness = |(i, p): (usize, &Point)| {
        let p = DVec3::from(*p);
        (!surface.contains(p)).then(|| (i as u32, surface.nearest(p).map_or(f64::INFINITY, |n| n.distance)))
    };
    points.par_iter().enumerate().with_min_len(256).filter_map(farness).collect()
}

/// +1 where the ray from `p` along x leaves through a triangle, −1 where it enters, else 0.
#[inline]
pub fn crossing(p: DVec3, [a, b, c]: [DVec3; 3]) -> i32 {
    if p.y < a.y.min(b.y).min(c.y) || p.y > a.y.max(b.y).max(c.y) {
        return 0;
    }
    if p.z < a.z.min(b.z).min(c.z) || p.z > a.z.max(b.z).max(c.z) || p.x > a.x.max(b.x).max(c.x) {
        return 0;
    }
    let turns = [turn(a, b, p), turn(b, c, p), turn(c, a, p)];
    if turns[0] == 0 || turns[0] != turns[1] || turns[1] != turns[2] {
        return 0;
    }
    // All of the triangle lies ahead.
    if p.x < a.x.min(b.x).min(c.x) {
        return turns[0];
    }
    // The ray leaves where p lies behind the plane, as seen along the normal's x.
    let side = orient3d(a, b, c, p);
    match turns[0] {
        1 if side < 0.0 => 1,
        -1 if side > 0.0 => -1,
        _ => 0,
    }
}

/// Sign of the turn a, b, p in the y–z plane with `p` moved by (ε, ε²); 0 where a and b coincide.
fn turn(a: DVec3, b: DVec3, p: DVec3) -> i32 {
    let sign = |x: f64| {
        if x > 0.0 {
            1
        } else if x < 0.0 {
            -1
        } else {
            0
        }
    };
    let exact = sign(orient2d(a, b, p, 0));
    if exact != 0 {
        exact
    } else if a.z != b.z {
        sign(a.z - b.z)
    } else {
        sign(b.y - a.y)
    }
}
