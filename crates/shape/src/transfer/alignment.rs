//! The source laid onto the target before anything else: turned, moved and scaled as a whole.

use crate::registration::{AlignOptions, Alignment, Observation, align_pairs, alignments};
use cager_geometry::spatial::Surface;
use cager_geometry::vector::Point;
use faer::Mat;
use glam::{DMat3, DVec3};

use crate::canonical::size;
use crate::similarity::Similarity;
use crate::transfer::pairs::Pairs;

/// How a source is aligned with a target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlignBy {
    /// By their surfaces: as they stand and by principal axes, or by turns about the axis up, whichever fits best.
    #[default]
    Surfaces,
    /// Not at all: both are in one space.
    AsTheyStand,
    /// By what is given, from the source's space to the target's.
    Given(Similarity),
}

/// Where the source was laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aligned {
    /// From the source's space to the target's.
    pub similarity: Similarity,
    /// The score of the next best alignment over this one's; infinite where no other was found or looked for.
    pub runner_up: f64,
}

impl Aligned {
    /// An alignment that another one comes within 15 % of: either may be right.
    pub const AMBIGUOUS_BELOW: f64 = 1.15;

    /// Whether another alignment fits almost as well.
    pub fn is_ambiguous(&self) -> bool {
        self.runner_up < Self::AMBIGUOUS_BELOW
    }
}

/// Steps in which a copy is laid onto itself exactly, and points that are looked at.
const REFINEMENTS: usize = 12;
const REFINED_POINTS: usize = 2000;
/// Surfaces that a similarity brings closer together than this share of the diagonal, in the mean, are the same one.
const SAME_SURFACE: f64 = 1e-3;

/// Ways to align a source with a target, the best first; those that are less than doubtful are left out. A copy of the same shape is laid onto the target's
/// triangles exactly (point to plane, Chen and Medioni 1992).
pub fn align_surfaces(
    source: &Observation,
    target: &Observation,
    surface: Option<&Surface>,
    by: AlignBy,
    up: Option<Point>,
) -> Vec<Aligned> {
    align_with(source, target, surface, by, up, &Pairs::default())
}

/// [`align_surfaces`], with pairs that correspond: they determine the alignment, or say which of several it is.
pub(crate) fn align_with(
    source: &Observation,
    target: &Observation,
    surface: Option<&Surface>,
    by: AlignBy,
    up: Option<Point>,
    pairs: &Pairs,
) -> Vec<Aligned> {
    let only = |similarity| vec![Aligned { similarity, runner_up: f64::INFINITY }];
    let options = AlignOptions { up, scale: true };
    let found = match by {
        AlignBy::AsTheyStand => return only(Similarity::IDENTITY),
        AlignBy::Given(similarity) => return only(similarity),
        AlignBy::Surfaces if pairs.determine() => vec![align_pairs(source, target, &pairs.places(), &options)],
        AlignBy::Surfaces => alignments(source, target, &options),
    };
    let best = found[0].score;
    let aligned = |alignment: &Alignment| {
        let rough = Similarity {
            rotation: DMat3::from_cols_array_2d(&alignment.rotation),
            scale: alignment.scale,
            translation: alignment.translation.into(),
        };
        let refined = surface.filter(|_| up.is_none()).and_then(|surface| refined(source, target, surface, rough));
        Aligned { similarity: refined.unwrap_or(rough), runner_up: found[0].runner_up }
    };
    if !pairs.vertices.is_empty() {
        let nearest = found.iter().min_by(|a, b| {
            let apart = |alignment: &Alignment| pairs.apart(|p| alignment.apply(p.to_array()).into());
            apart(a).total_cmp(&apart(b))
        });
        return nearest.map(|alignment| only(aligned(alignment).similarity)).unwrap_or_default();
    }
    let mut near: Vec<(f64, Aligned)> = found
        .iter()
        .filter(|alignment| alignment.score <= Aligned::AMBIGUOUS_BELOW * best)
        .map(|alignment| (alignment.score, aligned(alignment)))
        .collect();
    near.sort_by(|a, b| preferred(a).total_cmp(&preferred(b)));
    near.into_iter().map(|(_, aligned)| aligned).collect()
}

/// How much better the score of half a turn has to be than that of none: models that are brought together mostly stand alike.
const HALF_A_TURN: f64 = 0.15;

/// What alignments are chosen by: the score, and how far they turn.
pub(crate) fn preferred((score, aligned): &(f64, Aligned)) -> f64 {
    score * (1.0 + HALF_A_TURN * aligned.similarity.angle() / std::f64::consts::PI)
}

/// The similarity that lays points of a surface onto its copy; none where the surfaces differ.
fn refined(source: &Observation, target: &Observation, surface: &Surface, rough: Similarity) -> Option<Similarity> {
    let every = source.points.len().div_ceil(REFINED_POINTS).max(1);
    let points: Vec<DVec3> = source.points.iter().step_by(every).map(|&p| p.into()).collect();
    // Of what is seen of the surface: vertices far away that no triangle uses are none of it.
    let center = target.points.iter().map(|&p| DVec3::from(p)).sum::<DVec3>() / target.points.len() as f64;
    let size = size(&target.points);
    let mut best = rough;
    for _ in 0..REFINEMENTS {
        best = step(&points, surface, best, center, size)?.after(&best);
    }
    let far = |p: &DVec3| surface.nearest(best.apply(*p)).map_or(f64::INFINITY, |n| n.distance);
    let mean = points.iter().map(far).sum::<f64>() / points.len() as f64;
    (mean < SAME_SURFACE * size).then_some(best)
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
