//! Which parts of a model move together, and whether a cage follows them better by components.

use super::{Components, subframes};
use crate::design::{Parts, Samples};
use cager_core::cage::Cage;
use cager_geometry::mesh::Model;
use cager_geometry::topology::UnionFind;
use cager_geometry::vector::{Point, distance};
use std::ops::Range;

/// Frames by which motions are compared, at most.
const FRAMES: usize = 24;
/// Points of a part that are compared with those of another, at most.
const POINTS: usize = 128;
/// Pairs of points of two parts, the nearest at rest, by which these move together or do not.
const PAIRS: usize = 8;
/// Parts of which each two are compared; of more one cage follows all.
const MOST_PARTS: usize = 128;
/// Parts move together whose pairs change their distances by less, as shares of the diagonal: one
/// candidate each, from the coarsest on.
const TEARS: [f64; 3] = [0.1, 0.03, 0.01];
/// More components have to leave less than this share of what fewer do.
const GAIN: f64 = 0.7;

impl Components {
    /// The components by which a cage of so many vertices follows the motion best, judged by cages
    /// around the rest pose; `None` where that is one cage for all parts. `parts` are their points in
    /// order, all points of the model.
    pub fn by_motion(rest: &Model, frames: &[Vec<f64>], parts: &[Range<usize>], vertices: usize) -> Option<Self> {
        let some_frames = some(frames);
        let parts: Vec<Range<usize>> = parts.iter().filter(|part| !part.is_empty()).cloned().collect();
        if !(2..=MOST_PARTS).contains(&parts.len()) || some_frames.is_empty() {
            return None;
        }
        let tears = tears(rest, &some_frames, &parts);
        let all = Self::of_groups(rest, frames, vec![parts.clone()]);
        let (mut best, mut least, mut known) = (None, all.error(&some_frames, vertices)?, 1);
        for tear in TEARS.map(|tear| tear * all.diagonal) {
            let groups = groups(&parts, &tears, tear);
            if groups.len() == known {
                continue;
            }
            known = groups.len();
            let components = Self::of_groups(rest, frames, groups);
            if let Some(error) = components.error(&some_frames, vertices).filter(|&error| error < GAIN * least) {
                (best, least) = (Some(components), error);
            }
        }
        best
    }

    /// Root mean square error of cages of so many vertices around the components, over the diagonal;
    /// `None` where there are none.
    fn error(&self, frames: &[&[f64]], vertices: usize) -> Option<f64> {
        let mut sum = 0.0;
        for (group, cage) in self.groups.iter().zip(self.around_each(vertices).ok()?) {
            let samples = samples(&group.rest, &subframes(frames, &group.points));
            let error = samples.evaluate(&Cage::new(cage).ok()?).validation_error;
            sum += group.rest.points.len() as f64 * (error * samples.diagonal).powi(2);
        }
        Some((sum / self.points as f64).sqrt() / self.diagonal)
    }
}

/// Evenly spaced frames.
pub(super) fn some(frames: &[Vec<f64>]) -> Vec<&[f64]> {
    let count = frames.len().min(FRAMES);
    (0..count).map(|k| frames[k * frames.len() / count].as_slice()).collect()
}

/// Square root of the sum of squared distances of all points to the nearest affine images of the
/// rest pose.
pub(super) fn beyond_affine(rest: &Model, frames: &[Vec<f64>]) -> f64 {
    let samples = samples(rest, frames);
    (rest.points.len() as f64).sqrt() * samples.motion() * samples.diagonal
}

fn samples(rest: &Model, frames: &[Vec<f64>]) -> Samples {
    Samples::new(rest, frames, &Parts::of(frames.len()), &mut fastrand::Rng::with_seed(0))
}

/// Parts joined where they tear by less.
fn groups(parts: &[Range<usize>], tears: &[(usize, usize, f64)], most: f64) -> Vec<Vec<Range<usize>>> {
    let mut joined = UnionFind::new(parts.len());
    for &(a, b, _) in tears.iter().filter(|(.., tear)| *tear < most) {
        joined.join(a as u32, b as u32);
    }
    let (numbers, count) = joined.numbered();
    let mut groups = vec![Vec::new(); count as usize];
    numbers.iter().zip(parts).for_each(|(&group, part)| groups[group as usize].push(part.clone()));
    groups
}

/// For each two parts, how much the distances change between the points that are nearest at rest:
/// root mean square over these and the frames.
fn tears(rest: &Model, frames: &[&[f64]], parts: &[Range<usize>]) -> Vec<(usize, usize, f64)> {
    let some: Vec<Vec<usize>> =
        parts.iter().map(|part| part.clone().step_by(part.len().div_ceil(POINTS).max(1)).collect()).collect();
    let at = |frame: &[f64], point: usize| -> Point { std::array::from_fn(|k| frame[3 * point + k]) };
    let tear = |a: usize, b: usize| {
        let nearest = |&p: &usize| {
            let apart = |&q: &usize| distance(rest.points[p], rest.points[q]);
            let near = some[b].iter().map(|q| (apart(q), p, *q)).min_by(|x, y| x.0.total_cmp(&y.0));
            near.expect("a part has points")
        };
        let mut pairs: Vec<(f64, usize, usize)> = some[a].iter().map(nearest).collect();
        pairs.sort_unstable_by(|x, y| x.0.total_cmp(&y.0));
        pairs.truncate(PAIRS);
        let change = |frame: &&[f64]| -> f64 {
            pairs.iter().map(|&(apart, p, q)| (distance(at(frame, p), at(frame, q)) - apart).powi(2)).sum()
        };
        (frames.iter().map(change).sum::<f64>() / (pairs.len() * frames.len()) as f64).sqrt()
    };
    (0..parts.len()).flat_map(|a| (a + 1..parts.len()).map(move |b| (a, b))).map(|(a, b)| (a, b, tear(a, b))).collect()
}
