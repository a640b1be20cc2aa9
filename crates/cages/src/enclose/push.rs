//! Moves a cage outwards where points are outside.

use cager_core::cage::Cage;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::{Surface, self_intersections};
use glam::DVec3;
use rayon::prelude::*;

/// How often points that are still outside are looked for.
const ROUNDS: usize = 4;
/// Sweeps of corrections in each.
const SWEEPS: usize = 4;
/// How much farther than to a point its face is moved, over the diagonal of the model.
const MARGIN: f64 = 2e-4;

/// The place on the cage nearest to a point that should be inside.
struct Pushed {
    vertices: [u32; 3],
    weights: [f64; 3],
    /// Outwards, and how far the place has to move along it.
    normal: DVec3,
    missing: f64,
}

/// A cage with all points inside, at least `clearance` away, near one with most inside; `None`
/// where it would cut itself or points stay outside. Distances are over `diagonal`.
pub(super) fn pushed_outwards(mut cage: TriMesh, points: &[Point], clearance: f64, diagonal: f64) -> Option<TriMesh> {
    for _ in 0..ROUNDS {
        let surface = Surface::from(&cage);
        let pushed: Vec<Pushed> = points
            .par_iter()
            .with_min_len(256)
            .filter_map(|&p| pushed(&surface, p.into(), clearance * diagonal, MARGIN * diagonal))
            .collect();
        if pushed.is_empty() {
            return (self_intersections(&cage).is_empty() && Cage::new(cage.clone()).is_ok()).then_some(cage);
        }
        let mut moves = vec![DVec3::ZERO; cage.vertices.len()];
        for _ in 0..SWEEPS {
            pushed.iter().for_each(|place| place.correct(&mut moves));
        }
        cage.vertices.iter_mut().zip(moves).for_each(|(v, by)| *v = (DVec3::from(*v) + by).into());
    }
    None
}

/// `None` for a point that is inside.
fn pushed(surface: &Surface, p: DVec3, clearance: f64, margin: f64) -> Option<Pushed> {
    let is_inside = surface.contains(p);
    if is_inside && (clearance == 0.0 || surface.distance_within(p, clearance).is_none()) {
        return None;
    }
    let nearest = surface.nearest(p)?;
    let [a, b, c] = surface.corners(nearest.face);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let beyond = if is_inside { -nearest.distance } else { nearest.distance };
    let vertices = surface.triangles[nearest.face as usize];
    Some(Pushed { vertices, weights: nearest.weights, normal, missing: beyond + clearance + margin })
}

impl Pushed {
    /// Adds what is missing to the moves of the corners, in the shares that change them least.
    fn correct(&self, moves: &mut [DVec3]) {
        let at = |k: usize| self.vertices[k] as usize;
        let moved: f64 = (0..3).map(|k| self.weights[k] * self.normal.dot(moves[at(k)])).sum();
        let missing = self.missing - moved;
        if missing > 0.0 {
            let sum: f64 = self.weights.iter().map(|w| w * w).sum();
            (0..3).for_each(|k| moves[at(k)] += self.normal * (self.weights[k] * missing / sum));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::spatial::outside;

    /// A cube from -1 to 1.
    fn cube() -> TriMesh {
        let vertices = (0..8).map(|v| [0, 1, 2].map(|k| f64::from(2 * (v >> k & 1) - 1))).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        TriMesh { vertices, triangles }
    }

    #[test]
    fn points_a_little_outside_come_inside_and_what_is_inside_stays() {
        let points: Vec<Point> =
            vec![[1.01, 0.3, 0.2], [1.02, -0.4, 0.1], [0.1, -1.03, 0.9], [0.0; 3], [-0.9, 0.9, 0.9]];
        let pushed = pushed_outwards(cube(), &points, 0.0, 3.5).expect("a cage");
        assert!(outside(&pushed, &points).is_empty());
        let moved = pushed.vertices.iter().zip(cube().vertices).map(|(a, b)| DVec3::from(*a).distance(b.into()));
        assert!(moved.fold(0.0, f64::max) < 0.1);
        assert_eq!(pushed_outwards(cube(), &points[3..], 0.0, 3.5), Some(cube()));
    }

    #[test]
    fn a_clearance_is_kept() {
        let points = vec![[0.99, 0.0, 0.0], [0.0, 0.5, -0.97]];
        let pushed = pushed_outwards(cube(), &points, 0.02, 2.0).expect("a cage");
        let surface = Surface::from(&pushed);
        assert!(points.iter().all(|&p| surface.distance_within(p.into(), 0.04).is_none()));
    }

    #[test]
    fn a_cage_that_would_cut_itself_is_none() {
        let (mut two, other) = (cube(), cube());
        two.vertices.extend(other.vertices.iter().map(|v| [v[0] + 2.05, v[1], v[2]]));
        two.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + 8)));
        assert!(pushed_outwards(two.clone(), &[[1.02, 0.5, 0.5]], 0.0, 3.5).is_some());
        assert_eq!(pushed_outwards(two, &[[1.02, 0.5, 0.5]], 0.02, 3.5), None);
    }
}
