//! Whether a frame's faces name the points of the rest pose: exporters renumber both together.

use super::quartiles;
use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::vector::distance;

/// Most edges whose lengths are compared.
const MAX_EDGES: usize = 2_000;

/// What the faces of a frame have of those of the rest pose.
pub(super) struct FaceComparison {
    /// Whether they are those of the rest pose one by one, with the points under other numbers.
    renumbered: bool,
    /// Edges of the rest pose that the frame does not have, and the other way round.
    missing: Vec<[u32; 2]>,
    foreign: Vec<[u32; 2]>,
}

impl FaceComparison {
    /// Of faces that differ, both over `points` points.
    pub(super) fn new(rest: &Polygons, frame: &Polygons, points: usize) -> Self {
        let (ours, theirs) = (edges(rest), edges(frame));
        let without = |these: &[[u32; 2]], others: &[[u32; 2]]| -> Vec<[u32; 2]> {
            let lone: Vec<_> = these.iter().filter(|edge| others.binary_search(edge).is_err()).copied().collect();
            let stride = lone.len().div_ceil(MAX_EDGES).max(1);
            lone.into_iter().step_by(stride).collect()
        };
        let (missing, foreign) = (without(&ours, &theirs), without(&theirs, &ours));
        Self { renumbered: is_renumbered(rest, frame, points), missing, foreign }
    }

    /// Whether the points of the frame come in another order than those of the rest pose. Faces
    /// split otherwise, left out or listed in another order do not show that: then edges that the
    /// frame lacks are about as long in it as those that it has instead.
    pub(super) fn shows_another_order(&self, rest: &[Point], frame: &[Point], scale: f64) -> bool {
        if self.missing.is_empty() || self.foreign.is_empty() {
            return false;
        }
        let length = |points: &[Point], [a, b]: [u32; 2]| distance(points[a as usize], points[b as usize]);
        let median = |values: Vec<f64>| quartiles(values).map_or(f64::NAN, |found| found[1]);
        let within = |edges: &[[u32; 2]]| median(edges.iter().map(|&edge| length(frame, edge)).collect());
        let stretched = || median(self.missing.iter().map(|&e| length(frame, e) / length(rest, e)).collect());
        self.renumbered || within(&self.missing) > 1.7 * within(&self.foreign) && stretched() > 1.5 * scale
    }
}

/// The sides of all faces, each once, in order.
fn edges(faces: &Polygons) -> Vec<[u32; 2]> {
    let sides = faces.iter().flat_map(|face| (0..face.len()).map(|k| [face[k], face[(k + 1) % face.len()]]));
    let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).filter(|[a, b]| a != b).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Whether every point has one other name throughout, and no two the same.
fn is_renumbered(rest: &Polygons, frame: &Polygons, points: usize) -> bool {
    const NONE: u32 = u32::MAX;
    let (mut name, mut named) = (vec![NONE; points], vec![NONE; points]);
    rest.arities() == frame.arities()
        && rest.indices().iter().zip(frame.indices()).all(|(&ours, &theirs)| {
            let (there, back) = (&mut name[ours as usize], &mut named[theirs as usize]);
            if (*there, *back) == (NONE, NONE) {
                (*there, *back) = (theirs, ours);
            }
            (*there, *back) == (theirs, ours)
        })
}
