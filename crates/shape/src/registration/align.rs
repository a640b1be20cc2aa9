//! One surface turned, moved and, where asked, scaled onto another that is about the same: where a
//! template begins.

use std::f64::consts::{FRAC_PI_4, PI};

use cager_geometry::vector::Point;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::matching::OrientedPoints;
use super::observation::Observation;
use crate::points::{Moments, vectors};
use crate::similarity::Similarity;

/// What an alignment may change.
#[derive(Clone, Copy, Debug, Default)]
pub struct AlignOptions {
    /// The axis that points up in both; turns are about it alone.
    pub up: Option<Point>,
    /// Whether sizes may differ.
    pub scale: bool,
}

/// A similarity that lays one surface onto another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// From the one to the other.
    pub similarity: Similarity,
    /// Root mean square distance both ways, of positions and normals together, as a share of the
    /// target's size; NaN where the similarity was given.
    pub score: f64,
    /// The score of the next best one that is turned otherwise, over this one's; infinite without.
    pub runner_up: f64,
}

/// How much better half a turn has to score than none: models mostly stand alike.
const HALF_A_TURN: f64 = 0.15;

impl Alignment {
    /// An alignment that another one comes within 15 % of: either may be right.
    pub const AMBIGUOUS_BELOW: f64 = 1.15;

    /// What is not looked for.
    pub fn given(similarity: Similarity) -> Self {
        Self { similarity, score: f64::NAN, runner_up: f64::INFINITY }
    }

    /// Whether another alignment fits almost as well.
    pub fn is_ambiguous(&self) -> bool {
        self.runner_up < Self::AMBIGUOUS_BELOW
    }

    /// What alignments are chosen by, the least first: the score, and how far they turn.
    pub(crate) fn cost(&self) -> f64 {
        self.score * (1.0 + HALF_A_TURN * self.similarity.angle() / PI)
    }
}

/// Points of each surface that are looked at first, and in the end.
const FIRST_POINTS: usize = 300;
const LAST_POINTS: usize = 2000;
/// Iterations of each start, and of the few that are best then.
const FIRST_ITERATIONS: usize = 12;
const LAST_ITERATIONS: usize = 40;
/// Iterations after which those wait that score above so many times the best. They end too if they
/// then score below the second: they may still come close to it.
const JUDGED_ITERATIONS: usize = 8;
const MAX_WAITING_RATIO: f64 = 1.3;
const HOPELESS: f64 = 2.0;
/// Starts that are gone on with.
const MAX_CONTINUED: usize = 4;
/// What a normal counts beside distances, of the target's size.
const NORMAL_LENGTH: f64 = 0.05;
/// Distances count no more than this, of the target's size.
const MAX_DISTANCE: f64 = 0.15;
/// Iterations end early where they change rotation, scale and translation by less than this.
const SAME_PLACE: f64 = 1e-7;
/// Alignments turned by less than this, in degrees, are the same one.
const SAME_TURN: f64 = 20.0;

/// The alignment that turns least of those about as good. `None` of none.
pub fn least_turned(found: &[Alignment]) -> Option<Alignment> {
    let at = (0..found.len()).min_by(|&a, &b| found[a].cost().total_cmp(&found[b].cost()))?;
    let others = (0..found.len()).filter(|&k| k != at).map(|k| found[k].score);
    let runner_up = others.fold(f64::INFINITY, f64::min) / found[at].score;
    Some(Alignment { runner_up: runner_up.max(1.0), ..found[at] })
}

/// Ways to lay `moved` onto `fixed`, the best first; one at least, and none turned alike. Starts
/// are the surface as it stands, principal axes onto principal axes or, about a given axis, eighths
/// of a turn; then all points go to their nearest ones (Besl and McKay 1992), by normals as well.
/// Runs on the current rayon pool; the result does not depend on it.
///
/// # Panics
/// Where one of them has no points.
pub fn alignments(moved: &Observation, fixed: &Observation, options: &AlignOptions) -> Vec<Alignment> {
    let [coarse, fine] = [FIRST_POINTS, LAST_POINTS].map(|most| Pair::new(moved, fixed, options, most));
    let scale = if options.scale { coarse.fixed.spread / coarse.moved.spread } else { 1.0 };
    let mut tried: Vec<Alignment> = coarse
        .starts()
        .into_par_iter()
        .map(|rotation| coarse.iterate(coarse.centered(rotation, scale), FIRST_ITERATIONS))
        .collect();
    let unturned = tried[0];
    let by_score = |a: &Alignment, b: &Alignment| a.score.total_cmp(&b.score);
    let is_other = |kept: &[Alignment], found: &Alignment| {
        let turn = |other: &Alignment| found.similarity.after(&other.similarity.inverse()).angle().to_degrees();
        kept.iter().all(|other| turn(other) > SAME_TURN)
    };
    tried.sort_by(by_score);
    // Of symmetrical bodies it fits as well as others, and may come after them by chance.
    let is_near = unturned.score <= MAX_WAITING_RATIO * tried[0].score;
    let mut kept: Vec<Alignment> = Vec::new();
    for found in tried {
        if is_other(&kept, &found) && (kept.len() < MAX_CONTINUED || is_near && found == unturned) {
            kept.push(found);
        }
    }
    let start = |found: Alignment| fine.centered(found.similarity.rotation, found.similarity.scale);
    let begun = kept.into_par_iter().map(|found| fine.iterate(start(found), JUDGED_ITERATIONS));
    let begun: Vec<Alignment> = begun.collect();
    let best = |all: &[Alignment]| all.iter().map(|found| found.score).fold(f64::INFINITY, f64::min);
    let end = |found: Alignment| fine.iterate(found.similarity, LAST_ITERATIONS - JUDGED_ITERATIONS);
    let most = MAX_WAITING_RATIO * best(&begun);
    let (waiting, hopeful): (Vec<_>, Vec<_>) = begun.into_iter().partition(|found| found.score > most);
    let mut done: Vec<Alignment> = hopeful.into_par_iter().map(end).collect();
    let most = HOPELESS * best(&done);
    let (hopeless, waiting): (Vec<_>, Vec<_>) = waiting.into_iter().partition(|found| found.score >= most);
    done.par_extend(waiting.into_par_iter().map(end));
    done.extend(hopeless);
    done.sort_by(by_score);
    let mut distinct: Vec<Alignment> = Vec::new();
    for found in done {
        if is_other(&distinct, &found) {
            distinct.push(found);
        }
    }
    for k in 1..distinct.len() {
        distinct[k - 1].runner_up = distinct[k].score / distinct[k - 1].score;
    }
    distinct
}

/// Lays `moved` onto `fixed` from where three pairs of points or more lie on each other best.
///
/// # Panics
/// Where one of the surfaces has no points.
pub(crate) fn align_pairs(
    moved: &Observation,
    fixed: &Observation,
    pairs: &[(DVec3, DVec3, f64)],
    options: &AlignOptions,
) -> Alignment {
    let pair = Pair::new(moved, fixed, options, LAST_POINTS);
    let start = pair.centered(DMat3::IDENTITY, pair.fixed.spread / pair.moved.spread);
    pair.iterate(pair.fitted(start, pairs), LAST_ITERATIONS)
}

/// Some points of a surface.
struct Cloud {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    center: DVec3,
    /// Root mean square distance from the centre.
    spread: f64,
    /// Principal axes, the longest first, right-handed.
    axes: DMat3,
}

impl Cloud {
    fn new(observation: &Observation, most: usize) -> Self {
        let every = observation.points.len().div_ceil(most).max(1);
        let points: Vec<DVec3> = vectors(&observation.points).into_iter().step_by(every).collect();
        let normals = vectors(&observation.normals).into_iter().step_by(every).collect();
        let Moments { center, variances, axes: [first, second, _] } = Moments::new(&points);
        let spread = variances.iter().sum::<f64>().max(0.0).sqrt();
        Self { points, normals, center, spread, axes: DMat3::from_cols(first, second, first.cross(second)) }
    }
}

/// Two surfaces, one with a tree, and what may change between them.
struct Pair {
    moved: Cloud,
    fixed: Cloud,
    tree: OrientedPoints,
    up: Option<DVec3>,
    scales: bool,
}

impl Pair {
    fn new(moved: &Observation, fixed: &Observation, options: &AlignOptions, most: usize) -> Self {
        let (moved, fixed) = (Cloud::new(moved, most), Cloud::new(fixed, 4 * most));
        let tree = tree(&fixed.points, &fixed.normals, fixed.spread);
        let up = options.up.and_then(|up| DVec3::from(up).try_normalize());
        Self { moved, fixed, tree, up, scales: options.scale }
    }

    /// Rotations that are tried; none first.
    fn starts(&self) -> Vec<DMat3> {
        if let Some(up) = self.up {
            return (0..8).map(|k| DMat3::from_axis_angle(up, f64::from(k) * FRAC_PI_4)).collect();
        }
        let mut rotations = vec![DMat3::IDENTITY];
        for (i, j) in [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)] {
            for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let (x, y) = (a * DVec3::AXES[i], b * DVec3::AXES[j]);
                let assignment = DMat3::from_cols(x, y, x.cross(y));
                rotations.push(self.fixed.axes * assignment * self.moved.axes.transpose());
            }
        }
        rotations
    }

    /// A rotation and a factor about the centres.
    fn centered(&self, rotation: DMat3, scale: f64) -> Similarity {
        Similarity { rotation, scale, translation: self.fixed.center - scale * (rotation * self.moved.center) }
    }

    /// The similarity that these pairs determine, not far from another one in size.
    fn fitted(&self, at: Similarity, pairs: &[(DVec3, DVec3, f64)]) -> Similarity {
        let factor = if self.scales { 2.0 } else { 1.0 };
        Similarity::fitted(pairs, self.up, [at.scale / factor, at.scale * factor]).unwrap_or(at)
    }

    /// Goes on from somewhere.
    fn iterate(&self, mut at: Similarity, iterations: usize) -> Alignment {
        for _ in 0..iterations {
            let before = at;
            at = self.fitted(at, &self.pairs(&at));
            let unturned = at.rotation.abs_diff_eq(before.rotation, SAME_PLACE);
            let scaled = (at.scale - before.scale).abs() > SAME_PLACE * at.scale;
            let moved = at.translation.distance(before.translation);
            if unturned && !scaled && moved < SAME_PLACE * self.fixed.spread {
                break;
            }
        }
        Alignment { similarity: at, score: self.score(&at), runner_up: f64::INFINITY }
    }

    /// Moved points as they were, fixed points nearest to where they are, and weights; both ways.
    fn pairs(&self, at: &Similarity) -> Vec<(DVec3, DVec3, f64)> {
        let (points, normals) = self.place(at);
        let weight = |d2: f64| 1.0 / (1.0 + d2 / (MAX_DISTANCE * self.fixed.spread).powi(2)).powi(2);
        let back = tree(&points, &normals, self.fixed.spread);
        let there = points.iter().zip(&normals).zip(&self.moved.points).map(|((&p, &n), &from)| {
            let (found, d2) = self.tree.nearest(p, n);
            (from, self.fixed.points[found], weight(d2))
        });
        let share = self.moved.points.len() as f64 / self.fixed.points.len() as f64;
        let and_back = self.fixed.points.iter().zip(&self.fixed.normals).map(|(&q, &n)| {
            let (found, d2) = back.nearest(q, n);
            (self.moved.points[found], q, share * weight(d2))
        });
        there.chain(and_back).collect()
    }

    fn place(&self, at: &Similarity) -> (Vec<DVec3>, Vec<DVec3>) {
        let turned = at.scale * at.rotation;
        let points = self.moved.points.iter().map(|&p| turned * p + at.translation).collect();
        (points, self.moved.normals.iter().map(|&n| at.rotation * n).collect())
    }

    fn score(&self, at: &Similarity) -> f64 {
        let (points, normals) = self.place(at);
        let back = tree(&points, &normals, self.fixed.spread);
        let mean = |of: &OrientedPoints, points: &[DVec3], normals: &[DVec3]| {
            let most = (MAX_DISTANCE * self.fixed.spread).powi(2);
            let each = points.iter().zip(normals).map(|(&p, &n)| of.nearest(p, n).1.min(most));
            each.sum::<f64>() / points.len() as f64
        };
        let sum = mean(&self.tree, &points, &normals) + mean(&back, &self.fixed.points, &self.fixed.normals);
        sum.sqrt() / self.fixed.spread
    }
}

fn tree(points: &[DVec3], normals: &[DVec3], spread: f64) -> OrientedPoints {
    OrientedPoints::new(points, normals, NORMAL_LENGTH * spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The angle between two rotations, in degrees.
    fn angle(a: DMat3, b: DMat3) -> f64 {
        Similarity { rotation: a * b.transpose(), ..Similarity::IDENTITY }.angle().to_degrees()
    }

    /// A lumpy body with no symmetry.
    fn body(random: &mut fastrand::Rng, count: usize) -> Observation {
        let mut observation = Observation::default();
        let balls = [(DVec3::ZERO, 1.0), (DVec3::new(1.4, 0.3, 0.0), 0.5), (DVec3::new(0.0, 1.2, 0.9), 0.4)];
        while observation.points.len() < count {
            let (center, radius) = balls[random.usize(..3)];
            let direction = DVec3::from_array(std::array::from_fn(|_| random.f64() - 0.5)).normalize_or_zero();
            let point = center + radius * direction;
            if balls.iter().all(|(c, r)| point.distance(*c) > r - 1e-9) {
                observation.points.push(point.to_array());
                observation.normals.push(direction.to_array());
            }
        }
        observation
    }

    fn moved(observation: &Observation, rotation: DMat3, scale: f64, by: DVec3) -> Observation {
        Observation {
            points: observation.points.iter().map(|&p| (scale * (rotation * DVec3::from(p)) + by).to_array()).collect(),
            normals: observation.normals.iter().map(|&n| (rotation * DVec3::from(n)).to_array()).collect(),
        }
    }

    #[test]
    fn a_body_that_was_turned_anyhow_and_moved_is_found() {
        let mut random = fastrand::Rng::with_seed(9);
        let (from, to) = (body(&mut random, 1500), body(&mut random, 3000));
        for k in 0..6 {
            let axis = DVec3::new(random.f64() - 0.5, random.f64() - 0.5, random.f64() - 0.5).normalize();
            let rotation = DMat3::from_axis_angle(axis, f64::from(k));
            let target = moved(&to, rotation, 1.3, DVec3::new(5.0, -2.0, 1.0));
            let found = alignments(&from, &target, &AlignOptions { scale: true, up: None })[0];
            let off = angle(found.similarity.rotation, rotation);
            assert!(off < 1.0, "{k}: {off}");
            assert!((found.similarity.scale - 1.3).abs() < 0.02 && found.runner_up > 1.2, "{found:?}");
        }
    }

    #[test]
    fn of_turns_that_fit_alike_the_smallest_is_taken() {
        // An ellipsoid, which four turns leave as it is.
        let body = |random: &mut fastrand::Rng, count: usize| {
            let mut seen = Observation::default();
            for _ in 0..count {
                let direction = DVec3::from_array(std::array::from_fn(|_| random.f64() - 0.5)).normalize();
                seen.points.push((direction * DVec3::new(0.4, 0.2, 1.0)).to_array());
                seen.normals.push((direction / DVec3::new(0.4, 0.2, 1.0)).normalize().to_array());
            }
            seen
        };
        for (seed, up) in (0..12).flat_map(|seed| [(seed, None), (seed, Some([0.0, 0.0, 1.0]))]) {
            let mut random = fastrand::Rng::with_seed(seed);
            let (from, to) = (body(&mut random, 800), body(&mut random, 1200));
            let target = moved(&to, DMat3::IDENTITY, 1000.0, DVec3::ZERO);
            let found = alignments(&from, &target, &AlignOptions { scale: true, up });
            let found = least_turned(&found).unwrap().similarity.angle().to_degrees();
            assert!(found < 20.0, "{seed}: {found}");
        }
    }

    #[test]
    fn with_an_axis_up_only_turns_about_it_are_found() {
        let mut random = fastrand::Rng::with_seed(4);
        let (from, to) = (body(&mut random, 1500), body(&mut random, 3000));
        let rotation = DMat3::from_axis_angle(DVec3::Y, 2.0);
        let target = moved(&to, rotation, 1.0, DVec3::new(0.0, 3.0, 0.0));
        let found = alignments(&from, &target, &AlignOptions { up: Some([0.0, 1.0, 0.0]), scale: false })[0];
        let matrix = found.similarity.rotation;
        assert!((matrix * DVec3::Y).abs_diff_eq(DVec3::Y, 1e-12) && angle(matrix, rotation) < 1.0);
        assert_eq!(found.similarity.scale, 1.0);
    }
}
