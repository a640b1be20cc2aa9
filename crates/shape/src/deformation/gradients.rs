//! Deformation gradients of the triangles of a mesh (Sumner and Popović 2004).

use crate::points::area_vector;
use crate::points::welded;
use cager_geometry::linalg::nearest_rotation;
use cager_geometry::mesh::TriMesh;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Triangles at rest, for how each is turned and stretched in a pose, and their neighbours.
pub struct Gradients {
    triangles: Vec<[u32; 3]>,
    /// Inverse of the triangle's frame at rest; none for a triangle without an area.
    inverse: Vec<Option<DMat3>>,
    /// Neighbours over edges and their share in a mean, the triangle itself first; back to back.
    shares: Vec<(u32, f64)>,
    first: Vec<u32>,
    /// Twice the areas.
    areas: Vec<f64>,
}

/// A triangle without an area has a height below this share of its longest edge.
const NO_AREA: f64 = 1e-8;
/// Triangles that one task goes through.
const TASK: usize = 512;

impl Gradients {
    /// Of a mesh at rest. Vertices at the same place count as one where neighbours are looked for.
    pub fn new(rest: &TriMesh) -> Self {
        let corners = |t: &[u32; 3]| t.map(|v| DVec3::from(rest.vertices[v as usize]));
        let inverse = rest.triangles.iter().map(corners).map(|c| flatness(c).map(|_| frame(c).inverse()));
        let areas: Vec<f64> = rest.triangles.iter().map(|t| area_vector(corners(t)).length()).collect();
        let (shares, first) = shares(rest, &areas);
        Self { triangles: rest.triangles.clone(), inverse: inverse.collect(), shares, first, areas }
    }

    /// The gradient of each triangle in a pose; the identity where it has no area at rest.
    pub fn of(&self, pose: &[DVec3]) -> Vec<DMat3> {
        let gradient = |(t, inverse): (&[u32; 3], &Option<DMat3>)| match inverse {
            Some(inverse) => frame(t.map(|v| pose[v as usize])) * *inverse,
            None => DMat3::IDENTITY,
        };
        self.triangles.par_iter().zip(&self.inverse).with_min_len(TASK).map(gradient).collect()
    }

    /// Each value replaced by its mean with the neighbours', by area; `passes` times.
    pub fn smoothed(&self, mut values: Vec<DMat3>, passes: usize) -> Vec<DMat3> {
        for _ in 0..passes {
            let mean = |t: usize| -> DMat3 {
                let shares = &self.shares[self.first[t] as usize..self.first[t + 1] as usize];
                shares.iter().map(|&(other, share)| values[other as usize] * share).sum()
            };
            values = (0..values.len()).into_par_iter().with_min_len(TASK).map(mean).collect();
        }
        values
    }

    /// The nearest rotation of each value.
    pub fn rotations(values: &[DMat3]) -> Vec<DMat3> {
        values.par_iter().with_min_len(TASK).map(|&m| nearest_rotation(m)).collect()
    }

    /// Twice the area of each triangle at rest.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Whether a triangle has an area at rest, and so a gradient.
    pub fn has_area(&self, triangle: usize) -> bool {
        self.inverse[triangle].is_some()
    }

    /// Neighbours over edges of a triangle, without itself.
    pub fn neighbours(&self, triangle: usize) -> impl Iterator<Item = usize> + '_ {
        let shares = &self.shares[self.first[triangle] as usize..self.first[triangle + 1] as usize];
        shares.iter().skip(1).map(|&(other, _)| other as usize)
    }
}

/// Two edges, and the normal with the square root of its length.
fn frame([a, b, c]: [DVec3; 3]) -> DMat3 {
    let normal = area_vector([a, b, c]);
    DMat3::from_cols(b - a, c - a, normal / normal.length().max(f64::MIN_POSITIVE).sqrt())
}

/// The height of a triangle over its longest edge; none where it has no area.
pub(crate) fn flatness([a, b, c]: [DVec3; 3]) -> Option<f64> {
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    Some(area_vector([a, b, c]).length() / longest).filter(|height| *height > NO_AREA)
}

/// What each triangle and its neighbours count in their mean.
fn shares(rest: &TriMesh, areas: &[f64]) -> (Vec<(u32, f64)>, Vec<u32>) {
    let place = welded(&rest.vertices);
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * rest.triangles.len());
    for (t, triangle) in rest.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| place[v as usize]);
        edges.extend([[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], t as u32)));
    }
    edges.sort_unstable();
    let mut neighbours: Vec<Vec<u32>> = (0..rest.triangles.len() as u32).map(|t| vec![t]).collect();
    for pair in edges.windows(2).filter(|pair| pair[0].0 == pair[1].0 && pair[0].1 != pair[1].1) {
        neighbours[pair[0].1 as usize].push(pair[1].1);
        neighbours[pair[1].1 as usize].push(pair[0].1);
    }
    let mut first = vec![0];
    let mut shares = Vec::with_capacity(4 * neighbours.len());
    for list in &neighbours {
        let total: f64 = list.iter().map(|&t| areas[t as usize]).sum();
        let share = |t: u32| if total > 0.0 { areas[t as usize] / total } else { 1.0 / list.len() as f64 };
        shares.extend(list.iter().map(|&t| (t, share(t))));
        first.push(shares.len() as u32);
    }
    (shares, first)
}
