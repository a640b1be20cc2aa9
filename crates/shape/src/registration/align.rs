//! One surface turned, moved and, where asked, scaled onto another that is about the same: where a template begins.

use cager_geometry::linalg::nearest_rotation;
use cager_geometry::vector::Point;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::matching::OrientedPoints;
use super::observation::Observation;
use crate::points::{Moments, outer, plain, vectors};

/// What an alignment may change.
#[derive(Clone, Copy, Debug, Default)]
pub struct AlignOptions {
    /// The axis that points up in both; turns are about it alone.
    pub up: Option<Point>,
    /// Whether sizes may differ.
    pub scale: bool,
}

/// A similarity that lays one surface onto another.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// The rotation, by columns.
    pub rotation: [Point; 3],
    /// The factor before it.
    pub scale: f64,
    /// What is added after both.
    pub translation: Point,
    /// Root mean square distance both ways, of positions and normals together, as a share of the target's size.
    pub score: f64,
    /// The score of the next best one that is turned otherwise, over this one's: near one, either may be right. Infinite where there is none.
    pub runner_up: f64,
}

impl Alignment {
    /// Where a point goes.
    pub fn apply(&self, point: Point) -> Point {
        (self.scale * (self.matrix() * DVec3::from(point)) + DVec3::from(self.translation)).to_array()
    }

    /// The angle of the rotation, in degrees.
    pub fn degrees(&self) -> f64 {
        let matrix = self.matrix();
        let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
        (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
    }

    fn matrix(&self) -> DMat3 {
        DMat3::from_cols_array_2d(&self.rotation)
    }
}

/// Points of each surface that are looked at first, and in the end.
const FIRST_POINTS: usize = 300;
const LAST_POINTS: usize = 2000;
/// Iterations of each start, and of the few that are best then.
const FIRST_ITERATIONS: usize = 12;
const LAST_ITERATIONS: usize = 40;
/// Iterations after which those have to wait that score above so many times the best. Once the others are done, those of them end as well that score below so
/// many times the best then: they may still come close to it.
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

/// Lays `moved` onto `fixed`: the best of [`alignments`].
///
/// # Panics
/// Where one of them has no points.
pub fn align(moved: &Observation, fixed: &Observation, options: &AlignOptions) -> Alignment {
    alignments(moved, fixed, options)[0]
}

/// Of alignments that fit about as well, the one that turns least: half a turn has to score better than none by the share `half_a_turn`. `None` of none.
pub fn least_turned(found: &[Alignment], half_a_turn: f64) -> Option<Alignment> {
    let preferred = |a: &Alignment| a.score * (1.0 + half_a_turn * a.degrees() / 180.0);
    let at = (0..found.len()).min_by(|&a, &b| preferred(&found[a]).total_cmp(&preferred(&found[b])))?;
    let others = (0..found.len()).filter(|&k| k != at).map(|k| found[k].score);
    let runner_up = others.fold(f64::INFINITY, f64::min) / found[at].score;
    Some(Alignment { runner_up: runner_up.max(1.0), ..found[at] })
}

/// Ways to lay `moved` onto `fixed`, the best first; there is one at least, and none are turned alike. Tried first are the surface as it stands, the turns
/// that bring principal axes onto principal axes and, about a given axis up, eighths of a turn; then all points go to their nearest ones (Besl and McKay
/// 1992), the nearest by normals as well. Runs on the current rayon pool; the result does not depend on it.
///
/// # Panics
/// Where one of them has no points.
pub fn alignments(moved: &Observation, fixed: &Observation, options: &AlignOptions) -> Vec<Alignment> {
    let (coarse, fine) = (Pair::new(moved, fixed, FIRST_POINTS), Pair::new(moved, fixed, LAST_POINTS));
    let scale = if options.scale { coarse.fixed.spread / coarse.moved.spread } else { 1.0 };
    let up = options.up.and_then(|up| DVec3::from(up).try_normalize());
    let mut tried: Vec<Placed> = starts(&coarse, up)
        .into_par_iter()
        .map(|rotation| coarse.iterate(coarse.start(rotation, scale), up, options.scale, FIRST_ITERATIONS))
        .collect();
    // As it stands, the surface of a symmetrical body fits as well as others and may come after them by chance.
    let (unturned, unturned_score) = (tried[0].rotation, tried[0].score);
    tried.sort_by(|a, b| a.score.total_cmp(&b.score));
    let is_near = unturned_score <= MAX_WAITING_RATIO * tried[0].score;
    let mut kept: Vec<Placed> = Vec::new();
    for placed in tried {
        let is_unturned = is_near && placed.score == unturned_score && placed.rotation == unturned;
        let is_other = kept.iter().all(|other| angle(other.rotation, placed.rotation) > SAME_TURN);
        if is_other && (kept.len() < MAX_CONTINUED || is_unturned) {
            kept.push(placed);
        }
    }
    let go_on = |placed: Placed, iterations: usize| fine.iterate(placed, up, options.scale, iterations);
    let starts = kept.into_par_iter().map(|placed| fine.start(placed.rotation, placed.scale));
    let begun: Vec<Placed> = starts.map(|start| go_on(start, JUDGED_ITERATIONS)).collect();
    let best = |all: &[Placed]| all.iter().map(|placed| placed.score).fold(f64::INFINITY, f64::min);
    let end = |placed: Placed| go_on(placed, LAST_ITERATIONS - JUDGED_ITERATIONS);
    let most = MAX_WAITING_RATIO * best(&begun);
    let (waiting, hopeful): (Vec<Placed>, Vec<Placed>) = begun.into_iter().partition(|placed| placed.score > most);
    let mut done: Vec<Placed> = hopeful.into_par_iter().map(end).collect();
    let most = HOPELESS * best(&done);
    let (hopeless, waiting): (Vec<Placed>, Vec<Placed>) = waiting.into_iter().partition(|placed| placed.score >= most);
    done.par_extend(waiting.into_par_iter().map(end));
    done.extend(hopeless);
    done.sort_by(|a, b| a.score.total_cmp(&b.score));
    let mut distinct: Vec<Placed> = Vec::new();
    for placed in done {
        if distinct.iter().all(|other| angle(other.rotation, placed.rotation) > SAME_TURN) {
            distinct.push(placed);
        }
    }
    let alignment = |k: usize| Alignment {
        rotation: distinct[k].rotation.to_cols_array_2d(),
        scale: distinct[k].scale,
        translation: distinct[k].translation.to_array(),
        score: distinct[k].score,
        runner_up: distinct.get(k + 1).map_or(f64::INFINITY, |next| next.score / distinct[k].score),
    };
    (0..distinct.len()).map(alignment).collect()
}

/// Lays `moved` onto `fixed` from where pairs of their points lie on each other best, three at least that lie on no line.
///
/// # Panics
/// Where one of the surfaces has no points.
pub fn align_pairs(
    moved: &Observation,
    fixed: &Observation,
    pairs: &[(Point, Point)],
    options: &AlignOptions,
) -> Alignment {
    let up = options.up.and_then(|up| DVec3::from(up).try_normalize());
    let pair = Pair::new(moved, fixed, LAST_POINTS);
    let weighted: Vec<_> = pairs.iter().map(|&(p, q)| (p.into(), q.into(), 1.0)).collect();
    let mut start = pair.start(DMat3::IDENTITY, pair.fixed.spread / pair.moved.spread);
    start.take(&weighted, up, options.scale);
    let placed = pair.iterate(start, up, options.scale, LAST_ITERATIONS);
    Alignment {
        rotation: placed.rotation.to_cols_array_2d(),
        scale: placed.scale,
        translation: placed.translation.to_array(),
        score: placed.score,
        runner_up: f64::INFINITY,
    }
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

/// Where a surface was brought.
struct Placed {
    rotation: DMat3,
    scale: f64,
    translation: DVec3,
    score: f64,
}

impl Placed {
    /// Brings points, each with its place and what it counts, as near to their places as can be.
    fn take(&mut self, pairs: &[(DVec3, DVec3, f64)], up: Option<DVec3>, scales: bool) {
        let total: f64 = pairs.iter().map(|(_, _, weight)| weight).sum();
        if total <= 0.0 {
            return;
        }
        let mean = |of: fn(&(DVec3, DVec3, f64)) -> DVec3| pairs.iter().map(|p| p.2 * of(p)).sum::<DVec3>() / total;
        let (from, to) = (mean(|p| p.0), mean(|p| p.1));
        let (mut covariance, mut size) = (DMat3::ZERO, 0.0);
        for &(p, q, weight) in pairs {
            let (p, q) = (p - from, weight * (q - to));
            covariance += outer(q, p);
            size += weight * p.length_squared();
        }
        self.rotation = up.map_or_else(|| nearest_rotation(covariance), |up| turn_about(up, covariance));
        if scales {
            let product = covariance * self.rotation.transpose();
            let found = (product.x_axis.x + product.y_axis.y + product.z_axis.z) / size.max(f64::MIN_POSITIVE);
            self.scale = found.clamp(0.5 * self.scale, 2.0 * self.scale);
        }
        self.translation = to - self.scale * (self.rotation * from);
    }
}

/// Two surfaces, one with a tree.
struct Pair {
    moved: Cloud,
    fixed: Cloud,
    tree: OrientedPoints,
}

impl Pair {
    fn new(moved: &Observation, fixed: &Observation, most: usize) -> Self {
        let (moved, fixed) = (Cloud::new(moved, most), Cloud::new(fixed, 4 * most));
        let tree = tree(&fixed.points, &fixed.normals, fixed.spread);
        Self { moved, fixed, tree }
    }

    /// A rotation and a factor about the centres.
    fn start(&self, rotation: DMat3, scale: f64) -> Placed {
        let translation = self.fixed.center - scale * (rotation * self.moved.center);
        Placed { rotation, scale, translation, score: 0.0 }
    }

    /// Goes on from somewhere.
    fn iterate(&self, mut placed: Placed, up: Option<DVec3>, scales: bool, iterations: usize) -> Placed {
        for _ in 0..iterations {
            let before = (placed.rotation, placed.scale, placed.translation);
            placed.take(&self.pairs(&placed), up, scales);
            let unturned = placed.rotation.abs_diff_eq(before.0, SAME_PLACE);
            let scaled = (placed.scale - before.1).abs() > SAME_PLACE * placed.scale;
            if unturned && !scaled && placed.translation.distance(before.2) < SAME_PLACE * self.fixed.spread {
                break;
            }
        }
        placed.score = self.score(&placed);
        placed
    }

    /// The moved points as they were, the fixed points nearest to where they are, and what each pair counts; in both directions.
    fn pairs(&self, placed: &Placed) -> Vec<(DVec3, DVec3, f64)> {
        let (points, normals) = self.place(placed);
        let weight = |d2: f64| 1.0 / (1.0 + d2 / (MAX_DISTANCE * self.fixed.spread).powi(2)).powi(2);
        let back = tree(&points, &normals, self.fixed.spread);
        let there = points.iter().zip(&normals).zip(&self.moved.points).map(|((p, n), &from)| {
            let (found, d2) = self.tree.nearest(p.to_array(), n.to_array());
            (from, self.fixed.points[found], weight(d2))
        });
        let share = self.moved.points.len() as f64 / self.fixed.points.len() as f64;
        let and_back = self.fixed.points.iter().zip(&self.fixed.normals).map(|(&q, n)| {
            let (found, d2) = back.nearest(q.to_array(), n.to_array());
            (self.moved.points[found], q, share * weight(d2))
        });
        there.chain(and_back).collect()
    }

    fn place(&self, placed: &Placed) -> (Vec<DVec3>, Vec<DVec3>) {
        let turned = placed.scale * placed.rotation;
        let points = self.moved.points.iter().map(|&p| turned * p + placed.translation).collect();
        (points, self.moved.normals.iter().map(|&n| placed.rotation * n).collect())
    }

    fn score(&self, placed: &Placed) -> f64 {
        let (points, normals) = self.place(placed);
        let back = tree(&points, &normals, self.fixed.spread);
        let mean = |of: &OrientedPoints, points: &[DVec3], normals: &[DVec3]| {
            let most = (MAX_DISTANCE * self.fixed.spread).powi(2);
            let each = points.iter().zip(normals).map(|(p, n)| of.nearest(p.to_array(), n.to_array()).1.min(most));
            each.sum::<f64>() / points.len() as f64
        };
        let sum = mean(&self.tree, &points, &normals) + mean(&back, &self.fixed.points, &self.fixed.normals);
        sum.sqrt() / self.fixed.spread
    }
}

fn tree(points: &[DVec3], normals: &[DVec3], spread: f64) -> OrientedPoints {
    OrientedPoints::new(&plain(points), &plain(normals), NORMAL_LENGTH * spread)
}

/// Rotations that are tried.
fn starts(pair: &Pair, up: Option<DVec3>) -> Vec<DMat3> {
    if let Some(up) = up {
        return (0..8).map(|k| DMat3::from_axis_angle(up, f64::from(k) * std::f64::consts::FRAC_PI_4)).collect();
    }
    let mut rotations = vec![DMat3::IDENTITY];
    for (i, j) in [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)] {
        for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let (x, y) = (a * DVec3::AXES[i], b * DVec3::AXES[j]);
            let assignment = DMat3::from_cols(x, y, x.cross(y));
            rotations.push(pair.fixed.axes * assignment * pair.moved.axes.transpose());
        }
    }
    rotations
}

/// The turn about an axis that maximises `tr(Rᵀ A)`.
fn turn_about(up: DVec3, a: DMat3) -> DMat3 {
    let symmetric = a.x_axis.x + a.y_axis.y + a.z_axis.z - up.dot(a * up);
    let skew = DVec3::new(a.y_axis.z - a.z_axis.y, a.z_axis.x - a.x_axis.z, a.x_axis.y - a.y_axis.x);
    DMat3::from_axis_angle(up, skew.dot(up).atan2(symmetric))
}

/// The angle between two rotations, in degrees.
fn angle(a: DMat3, b: DMat3) -> f64 {
    let c = a * b.transpose();
    (0.5 * (c.x_axis.x + c.y_axis.y + c.z_axis.z - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let found = align(&from, &target, &AlignOptions { scale: true, up: None });
            let found_rotation = DMat3::from_cols_array_2d(&found.rotation);
            assert!(angle(found_rotation, rotation) < 1.0, "{k}: {}", angle(found_rotation, rotation));
            assert!((found.scale - 1.3).abs() < 0.02 && found.runner_up > 1.2, "{found:?}");
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
            let found = least_turned(&found, 0.15).unwrap();
            assert!(found.degrees() < 20.0, "{seed}: {}", found.degrees());
        }
    }

    #[test]
    fn with_an_axis_up_only_turns_about_it_are_found() {
        let mut random = fastrand::Rng::with_seed(4);
        let (from, to) = (body(&mut random, 1500), body(&mut random, 3000));
        let rotation = DMat3::from_axis_angle(DVec3::Y, 2.0);
        let target = moved(&to, rotation, 1.0, DVec3::new(0.0, 3.0, 0.0));
        let found = align(&from, &target, &AlignOptions { up: Some([0.0, 1.0, 0.0]), scale: false });
        let matrix = DMat3::from_cols_array_2d(&found.rotation);
        assert!((matrix * DVec3::Y).abs_diff_eq(DVec3::Y, 1e-12) && angle(matrix, rotation) < 1.0);
        assert_eq!(found.scale, 1.0);
    }
}
