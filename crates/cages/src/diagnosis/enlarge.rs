//! Slight enlargement of a closed cage, only where points of the model are outside.

use cager_geometry::mesh::{Model, TriMesh, diagonal, vertex_normals};
use cager_geometry::spatial::{Surface, self_intersections};
use glam::DVec3;
use rayon::prelude::*;

/// Maximum displacement of a vertex, as a fraction of the diagonal.
const MAX_MOVE: f64 = 0.06;
/// Points end up this far inside, as a fraction of the diagonal.
const MARGIN: f64 = 5e-4;
/// Largest displacement of a vertex in a round, as a fraction of the diagonal.
const MAX_STEP: f64 = 0.01;
const MAX_ROUNDS: usize = 60;
/// Attempts of a round: in each, vertices of faces that would newly cut go so much less far.
const MAX_ATTEMPTS: usize = 6;
const SHORTER: f64 = 0.3;

/// Vertices moved out along their normals until all points are inside, if that takes little and
/// cuts no faces that were apart.
pub(super) fn enlarged(cage: &TriMesh, model: &Model) -> Option<Vec<DVec3>> {
    let extent = diagonal(&model.points);
    let start: Vec<DVec3> = cage.vertices.iter().map(|&p| p.into()).collect();
    let allowed = self_intersections(cage);
    let mut positions = start.clone();
    for _ in 0..MAX_ROUNDS {
        let surface = Surface::new(positions.clone(), cage.triangles.clone());
        let pushes = pushes(&surface, model, MARGIN * extent);
        if pushes.is_empty() {
            return Some(positions);
        }
        let normals = vertex_normals(positions.len(), |v| positions[v as usize], &cage.triangles);
        let normals: Vec<DVec3> = normals.into_iter().map(DVec3::normalize_or_zero).collect();
        let mut step = vec![0.0_f64; positions.len()];
        for (vertex, push) in pushes {
            step[vertex as usize] = step[vertex as usize].max(push.min(MAX_STEP * extent));
        }
        if !advance(&mut positions, &start, &normals, step, &allowed, cage, extent) {
            return None;
        }
    }
    None
}

/// Moves vertices, those of faces that would newly cut less far. Says whether any could move.
fn advance(
    positions: &mut [DVec3],
    start: &[DVec3],
    normals: &[DVec3],
    mut step: Vec<f64>,
    allowed: &[[u32; 2]],
    cage: &TriMesh,
    extent: f64,
) -> bool {
    for _ in 0..MAX_ATTEMPTS {
        let moved: Vec<DVec3> = (0..positions.len()).map(|v| positions[v] + step[v] * normals[v]).collect();
        let vertices = moved.iter().map(DVec3::to_array).collect();
        let cuts = self_intersections(&TriMesh { vertices, triangles: cage.triangles.clone() });
        let new: Vec<u32> = cuts.into_iter().filter(|c| allowed.binary_search(c).is_err()).flatten().collect();
        if new.is_empty() {
            let far = (0..moved.len()).any(|v| moved[v].distance(start[v]) > MAX_MOVE * extent);
            let any = step.iter().any(|&s| s > 0.0);
            positions.copy_from_slice(&moved);
            return any && !far;
        }
        for v in new.into_iter().flat_map(|f| cage.triangles[f as usize]) {
            step[v as usize] *= SHORTER;
        }
    }
    false
}

/// For the corners of the faces nearest to points outside or too close, how far to move out.
fn pushes(surface: &Surface, model: &Model, margin: f64) -> Vec<(u32, f64)> {
    let of_point = |p: &[f64; 3]| {
        let p = DVec3::from(*p);
        let inside = surface.contains(p);
        let limit = if inside { margin * (1.0 - 1e-6) } else { f64::INFINITY };
        let nearest = surface.nearest_within(p, limit)?;
        let depth = if inside { margin - nearest.distance } else { margin + nearest.distance };
        // The face moves by the weighted mean of its corners' steps.
        let squares: f64 = nearest.weights.iter().map(|w| w * w).sum();
        let corners = surface.triangles[nearest.face as usize];
        let share = move |k: usize| (corners[k], 1.1 * depth * nearest.weights[k] / squares);
        Some([share(0), share(1), share(2)])
    };
    let found: Vec<[(u32, f64); 3]> = model.points.par_iter().with_min_len(256).filter_map(of_point).collect();
    found.into_iter().flatten().filter(|(_, push)| *push > 0.0).collect()
}
