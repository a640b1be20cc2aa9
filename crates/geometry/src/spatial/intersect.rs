//! Intersections of triangles, decided by exact predicates. Touching counts as intersecting.

use super::predicates::{orient2d, orient3d};
use super::{Aabb, Bvh};
use crate::mesh::TriMesh;
use glam::DVec3;
use rayon::prelude::*;

/// Pairs of one face after which no more are looked for: thousands of parts may be in one place.
const MAX_PAIRS_OF_FACE: usize = 1_000;
/// Pairs of all faces likewise.
pub const MAX_PAIRS: usize = 1_000_000;
/// Faces that are looked at before their pairs are counted.
const FACES_AT_A_TIME: usize = 1 << 10;

/// Pairs of faces that cut, touch or overlap beyond the vertices and edges that they share,
/// ascending; also faces folded flat onto a neighbour, and doubled ones. Left out are faces with
/// vertices that do not exist, and pairs beyond a thousand of one face and a million in all.
pub fn self_intersections(mesh: &TriMesh) -> Vec<[u32; 2]> {
    let vertices: Vec<DVec3> = mesh.vertices.iter().map(|&p| p.into()).collect();
    let valid = |t: &[u32; 3]| t.iter().all(|&v| vertices.get(v as usize).is_some_and(|p| p.is_finite()));
    let corners = |t: [u32; 3]| t.map(|v| vertices[v as usize]);
    let boxes: Vec<Aabb> =
        mesh.triangles.iter().map(|t| if valid(t) { Aabb::around(corners(*t)) } else { Aabb::EMPTY }).collect();
    let tree = Bvh::new(&boxes);
    let pairs_of = |first: usize| {
        let mut pairs = Vec::new();
        tree.visit(&boxes[first], |second| {
            let other = second as usize;
            if other > first && boxes[first].overlaps(&boxes[other]) {
                let faces = [mesh.triangles[first], mesh.triangles[other]];
                if triangles_intersect(faces, faces.map(corners)) {
                    pairs.push([first as u32, second]);
                }
            }
            pairs.len() < MAX_PAIRS_OF_FACE
        });
        pairs.sort_unstable();
        pairs
    };
    let mut found: Vec<[u32; 2]> = Vec::new();
    for first in (0..boxes.len()).step_by(FACES_AT_A_TIME) {
        let faces = first..boxes.len().min(first + FACES_AT_A_TIME);
        found.par_extend(faces.into_par_iter().with_min_len(64).flat_map_iter(pairs_of));
        if found.len() >= MAX_PAIRS {
            found.truncate(MAX_PAIRS);
            break;
        }
    }
    found
}

/// Whether two triangles have a point in common beyond the vertices and the edge that they share.
pub fn triangles_intersect(faces: [[u32; 3]; 2], corners: [[DVec3; 3]; 2]) -> bool {
    let [first, second] = faces;
    let shared = |v: &u32| second.contains(v);
    match first.iter().filter(|v| shared(v)).count() {
        0 => disjoint_intersect(corners[0], corners[1]),
        1 => {
            let i = first.iter().position(shared).unwrap_or(0);
            let j = second.iter().position(|v| *v == first[i]).unwrap_or(0);
            let [a, b] = [corners[0][(i + 1) % 3], corners[0][(i + 2) % 3]];
            let [c, d] = [corners[1][(j + 1) % 3], corners[1][(j + 2) % 3]];
            segment_triangle(a, b, corners[1]) || segment_triangle(c, d, corners[0])
        }
        2 => {
            let i = first.iter().position(|v| !shared(v)).unwrap_or(0);
            let j = second.iter().position(|v| !first.contains(v)).unwrap_or(0);
            let [a, b, c] = [0, 1, 2].map(|k| corners[0][(i + k) % 3]);
            folded(b, c, a, corners[1][j])
        }
        _ => true,
    }
}

/// Whether two triangles without a common vertex intersect.
pub fn disjoint_intersect(first: [DVec3; 3], second: [DVec3; 3]) -> bool {
    let apart = |t: [DVec3; 3], u: [DVec3; 3]| {
        let sides = u.map(|p| orient3d(t[0], t[1], t[2], p));
        sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)
    };
    if apart(first, second) || apart(second, first) {
        return false;
    }
    let edges = |t: [DVec3; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    edges(first).iter().any(|&[p, q]| segment_triangle(p, q, second))
        || edges(second).iter().any(|&[p, q]| segment_triangle(p, q, first))
}

/// Whether the closed segment `p`–`q` meets a closed triangle.
pub fn segment_triangle(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let (sp, sq) = (orient3d(a, b, c, p), orient3d(a, b, c, q));
    if (sp > 0.0 && sq > 0.0) || (sp < 0.0 && sq < 0.0) {
        return false;
    }
    if sp == 0.0 && sq == 0.0 {
        return coplanar_segment_triangle(p, q, [a, b, c]);
    }
    let turns = [orient3d(p, q, a, b), orient3d(p, q, b, c), orient3d(p, q, c, a)];
    turns.iter().all(|s| *s >= 0.0) || turns.iter().all(|s| *s <= 0.0)
}

/// Whether triangles (b, c, a) and (c, b, d) lie in one plane on the same side of `b`–`c`.
fn folded(b: DVec3, c: DVec3, a: DVec3, d: DVec3) -> bool {
    if orient3d(b, c, a, d) != 0.0 {
        return false;
    }
    let axis = major_axis((c - b).cross(a - b));
    let sides = [a, d].map(|p| orient2d(b, c, p, axis));
    sides[0] * sides[1] >= 0.0
}

fn coplanar_segment_triangle(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    if normal == DVec3::ZERO {
        // A triangle without area: its edges are all there is of it.
        return [[a, b], [b, c], [c, a]]
            .iter()
            .any(|&[s, e]| orient3d(p, q, s, e) == 0.0 && (0..3).all(|axis| segments_meet([p, q], [s, e], axis)));
    }
    let axis = major_axis(normal);
    if [[a, b], [b, c], [c, a]].iter().any(|&edge| segments_meet([p, q], edge, axis)) {
        return true;
    }
    let turns = [[a, b], [b, c], [c, a]].map(|[s, e]| orient2d(s, e, p, axis));
    turns.iter().all(|s| *s >= 0.0) || turns.iter().all(|s| *s <= 0.0)
}

/// Whether two closed segments meet in the projection along an axis.
fn segments_meet([p, q]: [DVec3; 2], [s, e]: [DVec3; 2], axis: usize) -> bool {
    let within = |a: DVec3, b: DVec3, x: DVec3| {
        [(axis + 1) % 3, (axis + 2) % 3].iter().all(|&k| a[k].min(b[k]) <= x[k] && x[k] <= a[k].max(b[k]))
    };
    let (o1, o2) = (orient2d(p, q, s, axis), orient2d(p, q, e, axis));
    let (o3, o4) = (orient2d(s, e, p, axis), orient2d(s, e, q, axis));
    let crosses = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
    (crosses(o1, o2) && crosses(o3, o4))
        || (o1 == 0.0 && within(p, q, s))
        || (o2 == 0.0 && within(p, q, e))
        || (o3 == 0.0 && within(s, e, p))
        || (o4 == 0.0 && within(s, e, q))
}

fn major_axis(normal: DVec3) -> usize {
    let n = normal.abs();
    if n.x >= n.y && n.x >= n.z { 0 } else { 1 + usize::from(n.z > n.y) }
}
