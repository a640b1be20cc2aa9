//! Vertices of closed parts that touch in one place, moved a little into their own part.

use super::findings::same_place;
use cager_geometry::mesh::{TriMesh, diagonal};
use cager_geometry::spatial::self_intersections;
use glam::DVec3;

/// How far vertices go over the diagonal: the shortest after which no faces touch there.
const STEPS: [f64; 3] = [1e-3, 3e-3, 1e-2];
/// No vertex goes farther than this share of its shortest edge.
const OF_EDGE: f64 = 0.2;

/// Positions after it, and the farthest move over the diagonal; `None` where no vertices touch, or
/// nothing separates their faces.
pub(super) fn moved_apart(cage: &TriMesh) -> Option<(Vec<DVec3>, f64)> {
    let (_, touching) = same_place(cage, &cage.triangles);
    if touching.is_empty() {
        return None;
    }
    let positions: Vec<DVec3> = cage.vertices.iter().map(|&p| p.into()).collect();
    let (mut normal, mut to_neighbours) = (vec![DVec3::ZERO; positions.len()], vec![DVec3::ZERO; positions.len()]);
    let mut shortest = vec![f64::INFINITY; positions.len()];
    for triangle in &cage.triangles {
        for k in 0..3 {
            let [v, a, b] = [0, 1, 2].map(|i| triangle[(k + i) % 3] as usize);
            let (a, b) = (positions[a] - positions[v], positions[b] - positions[v]);
            // Weighted by the angle, as of pseudonormals (Bærentzen and Aanæs 2005).
            normal[v] += a.angle_between(b) * a.cross(b).normalize_or_zero();
            to_neighbours[v] += a.normalize_or_zero() + b.normalize_or_zero();
            shortest[v] = shortest[v].min(a.length()).min(b.length());
        }
    }
    let mut moving: Vec<usize> = touching.as_flattened().iter().map(|&v| v as usize).collect();
    moving.sort_unstable();
    moving.dedup();
    let is_moving = |f: u32| cage.triangles[f as usize].iter().any(|&v| moving.binary_search(&(v as usize)).is_ok());
    let touches = |vertices: &[DVec3]| {
        let vertices = vertices.iter().map(DVec3::to_array).collect();
        let pairs = self_intersections(&TriMesh { vertices, triangles: cage.triangles.clone() });
        pairs.iter().filter(|pair| pair.iter().any(|&f| is_moving(f))).count()
    };
    let extent = diagonal(&cage.vertices);
    let mut best: Option<(usize, Vec<DVec3>, f64)> = None;
    let inwards: Vec<DVec3> = normal.iter().map(|n| -*n).collect();
    for step in STEPS {
        for directions in [&inwards, &to_neighbours] {
            let (mut moved, mut farthest) = (positions.clone(), 0.0_f64);
            for &v in &moving {
                let length = (step * extent).min(OF_EDGE * shortest[v]);
                moved[v] += length * directions[v].normalize_or_zero();
                farthest = farthest.max(length);
            }
            let left = touches(&moved);
            if best.as_ref().is_none_or(|(least, ..)| left < *least) {
                best = Some((left, moved, farthest / extent));
            }
            if left == 0 {
                return best.map(|(_, moved, farthest)| (moved, farthest));
            }
        }
    }
    best.filter(|(left, ..)| *left < touches(&positions)).map(|(_, moved, farthest)| (moved, farthest))
}
