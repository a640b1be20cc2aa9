//! A cage's mirror symmetry, kept while it moves.

use cager_geometry::mesh::{TriMesh, diagonal};
use glam::DVec3;

/// How far a vertex may be from its mirror image, as a fraction of the diagonal.
const TOLERANCE: f64 = 1e-3;

/// Which vertex mirrors which.
pub(super) struct Symmetry {
    axis: usize,
    /// The vertex at each one's mirror image; itself on the plane of symmetry.
    mirror: Vec<u32>,
}

impl Symmetry {
    /// The symmetry across the plane of an axis through the middle of the bounding box; the first
    /// vertex without a mirror image where there is none.
    pub(super) fn new(mesh: &TriMesh, axis: usize) -> Result<Self, usize> {
        let (low, high) = cager_geometry::mesh::bounds(&mesh.vertices);
        let center = low[axis] + high[axis];
        let limit = TOLERANCE * diagonal(&mesh.vertices);
        let at = |v: usize| DVec3::from(mesh.vertices[v]);
        let mut mirror = Vec::with_capacity(mesh.vertices.len());
        for v in 0..mesh.vertices.len() {
            let mut image = at(v);
            image[axis] = center - image[axis];
            let nearest = (0..mesh.vertices.len())
                .min_by(|&a, &b| at(a).distance_squared(image).total_cmp(&at(b).distance_squared(image)));
            match nearest.filter(|&w| at(w).distance(image) <= limit) {
                Some(w) => mirror.push(w as u32),
                None => return Err(v),
            }
        }
        match (0..mirror.len()).find(|&v| mirror[mirror[v] as usize] as usize != v) {
            Some(v) => Err(v),
            None => Ok(Self { axis, mirror }),
        }
    }

    /// Symmetrises the moves and their limits.
    pub(super) fn apply(&self, moves: &mut [DVec3], most: &mut [f64]) {
        for v in 0..moves.len() {
            let w = self.mirror[v] as usize;
            if w < v {
                continue;
            }
            let flipped = |mut m: DVec3| {
                m[self.axis] = -m[self.axis];
                m
            };
            let mean = 0.5 * (moves[v] + flipped(moves[w]));
            (moves[v], moves[w]) = (mean, flipped(mean));
            if v == w {
                moves[v][self.axis] = 0.0;
            }
            let least = most[v].min(most[w]);
            (most[v], most[w]) = (least, least);
        }
    }
}
