//! The source laid onto the target before anything else: turned, moved and scaled as a whole.

use crate::registration::{AlignOptions, Alignment, Observation, align_pairs, alignments};
use cager_geometry::spatial::Surface;
use cager_geometry::vector::{Point, mean};
use faer::Mat;
use glam::{DMat3, DVec3};

use crate::canonical::size;
use crate::similarity::Similarity;
use crate::transfer::pairs::Pairs;

/// How a source is aligned with a target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlignBy {
    /// By surfaces: as they stand and by principal axes, or turns about the axis up.
    #[default]
    Surfaces,
    /// Not at all: both are in one space.
    AsTheyStand,
    /// By what is given, from the source's space to the target's.
    Given(Similarity),
}

/// Steps in which a copy is laid onto itself exactly, and points that are looked at.
const REFINEMENTS: usize = 12;
const REFINED_POINTS: usize = 2000;
/// Surfaces closer than this share of the diagonal, in the mean, are the same one.
const SAME_SURFACE: f64 = 1e-3;

/// Ways to align a source with a target, the best first, but those less than doubtful. A copy of
/// the shape is laid onto the target's triangles exactly (point to plane, Chen and Medioni 1992).
pub fn align_surfaces(
    source: &Observation,
    target: &Observation,
    surface: Option<&Surface>,
    by: AlignBy,
    up: Option<Point>,
) -> Vec<Alignment> {
    align_with(source, target, surface, by, up, &Pairs::default())
}

/// [`align_surfaces`], with pairs that determine the alignment, or say which of several it is.
pub(crate) fn align_with(
    source: &Observation,
    target: &Observation,
    surface: Option<&Surface>,
    by: AlignBy,
    up: Option<Point>,
    pairs: &Pairs,
) -> Vec<Alignment> {
    let options = AlignOptions { up, scale: true };
    let found = match by {
        AlignBy::AsTheyStand => return vec![Alignment::given(Similarity::IDENTITY)],
        AlignBy::Given(similarity) => return vec![Alignment::given(similarity)],
        AlignBy::Surfaces if pairs.determine() => vec![align_pairs(source, target, &pairs.places, &options)],
        AlignBy::Surfaces => alignments(source, target, &options),
    };
    let aligned = |alignment: &Alignment| {
        let rough = alignment.similarity;
        let refined = surface.filter(|_| up.is_none()).and_then(|surface| refined(source, target, surface, rough));
        Alignment { similarity: refined.unwrap_or(rough), runner_up: found[0].runner_up, ..*alignment }
    };
    if !pairs.vertices.is_empty() {
        let apart = |a: &&Alignment| pairs.apart(&a.similarity);
        let nearest = found.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
        return nearest.map(|nearest| Alignment::given(aligned(nearest).similarity)).into_iter().collect();
    }
    let near = found.iter().filter(|alignment| alignment.score <= Alignment::AMBIGUOUS_BELOW * found[0].score);
    let mut near: Vec<Alignment> = near.map(aligned).collect();
    near.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
    near
}

/// The similarity that lays points of a surface onto its copy; none where the surfaces differ.
fn refined(source: &Observation, target: &Observation, surface: &Surface, rough: Similarity) -> Option<Similarity> {
    let every = source.points.len().div_ceil(REFINED_POINTS).max(1);
    let points: Vec<DVec3> = source.points.iter().step_by(every).map(|&p| p.into()).collect();
    // Of what is seen of the surface: vertices far away that no triangle uses are none of it.
    let center = DVec3::from(mean(&target.points));
    let size = size(&target.points);
    let mut best = rough;
    for _ in 0..REFINEMENTS {
        best = step(&points, surface, best, center, size)?.after(&best);
    }
    let far = |p: &DVec3| surface.nearest(best.apply(*p)).map_or(f64::INFINITY, |n| n.distance);
    let apart = points.iter().map(far).sum::<f64>() / points.len() as f64;
    (apart < SAME_SURFACE * size).then_some(best)
}

/// One step of Gauss and Newton over rotation, translation and scale.
fn step(points: &[DVec3], surface: &Surface, at: Similarity, center: DVec3, size: f64) -> Option<Similarity> {
    let mut equations = Mat::<f64>::zeros(7, 7);
    let mut right = Mat::<f64>::zeros(7, 1);
    for &p in points {
        let p = at.apply(p);
        let near = surface.nearest(p)?;
        let [a, b, c] = surface.corners(near.face);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let arm = (p - center) / size;
        let turn = arm.cross(normal);
        let row = [turn.x, turn.y, turn.z, normal.x, normal.y, normal.z, arm.dot(normal)];
        let offset = (near.point - p).dot(normal) / size;
        for i in 0..7 {
            right[(i, 0)] += row[i] * offset;
            (0..7).for_each(|j| equations[(i, j)] += row[i] * row[j]);
        }
    }
    // What a symmetrical surface leaves open stays as it is.
    let ridge = 1e-9 * (0..7).map(|i| equations[(i, i)]).sum::<f64>();
    (0..7).for_each(|i| equations[(i, i)] += ridge);
    let x = cager_geometry::linalg::solve_definite(equations, right)?;
    let turn = DVec3::new(x[(0, 0)], x[(1, 0)], x[(2, 0)]);
    let moved = size * DVec3::new(x[(3, 0)], x[(4, 0)], x[(5, 0)]);
    let rotation = DMat3::from_quat(glam::DQuat::from_scaled_axis(turn));
    let scale = 1.0 + x[(6, 0)].clamp(-0.5, 0.5);
    Some(Similarity { rotation, scale, translation: center + moved - scale * (rotation * center) })
}
