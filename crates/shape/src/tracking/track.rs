//! A template followed through surfaces without correspondence, by its cage alone: any subject.

use crate::registration::{FitOptions, KnownMatches, Target, Template};
use cager_geometry::vector::{Point, along, dot, middle, norm, sub};

/// How a frame's cage was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// From the frame before.
    Followed,
    /// By a search further around, since the first fit lay badly.
    SearchedWider,
    /// The best fit there is lies badly: part of the template may be somewhere else.
    Lost,
    /// There was nothing to follow; the cage is the one of the frame before.
    NoSurface,
}

/// A frame's cage.
#[derive(Clone, Debug)]
pub struct TrackedFrame {
    /// Vertices of the cage.
    pub cage: Vec<Point>,
    /// [`Template::score`], a share of the diagonal; infinite without a surface.
    pub score: f64,
    /// How it was found.
    pub outcome: Outcome,
}

/// Follows a template from frame to frame.
pub struct Tracker<'t> {
    template: &'t Template,
    last: Vec<Point>,
    before: Vec<Point>,
    /// Scores of the frames so far, in their order.
    scores: Vec<f64>,
    /// The last frame that was looked for further around.
    searched: Option<usize>,
}

/// One point in so many says which start is better.
const STARTS_JUDGED_BY: usize = 4;
/// Frames before that say what scores are usual just now: they change with the pose.
const RECENT: usize = 9;
/// Frames that score above so many times the recent ones' median are looked for further around.
const SEARCHED_FROM: f64 = 1.06;
/// So is one that scores above so many times the median of all.
const SEARCHED_FROM_ALL: f64 = 1.3;
/// The surface moves little where the two starts are nearer than this share of the diagonal.
const ALIKE: f64 = 0.02;
/// For so many frames.
const SEARCHED_FOR: usize = 3;
/// A frame that scores above so many times the median of all is lost.
const LOST_FROM: f64 = 1.6;
/// But not below this share of the diagonal: exact surfaces usually score next to nothing.
const LIES_WELL: f64 = 1e-3;
/// Frames before that it takes: a template that is the first frame lies there best.
const MIN_JUDGED: usize = 3;

impl<'t> Tracker<'t> {
    /// From the cage of the rest pose, laid where the first frame is.
    pub fn new(template: &'t Template, start: Vec<Point>) -> Self {
        Self { template, before: start.clone(), last: start, scores: Vec::new(), searched: None }
    }

    /// The next frame's cage.
    pub fn follow(&mut self, surface: &Target) -> TrackedFrame {
        let template = self.template;
        let ahead = extrapolated(&self.last, &self.before);
        let mut starts = [&self.last, &ahead];
        let mut known = template.unmatched(surface);
        let near = starts.map(|start| template.score(surface, start, STARTS_JUDGED_BY, &mut known));
        if near[1] < near[0] {
            starts.reverse();
        }
        let mut best = fitted(template, surface, starts[0], &FitOptions::NEAR, &mut known);
        let usual = median(judging(&self.scores));
        let alike = farthest_apart(starts) < ALIKE * template.diagonal();
        let most = (SEARCHED_FROM * self.level(alike)).min(SEARCHED_FROM_ALL * usual);
        for start in &starts[..if alike { 1 } else { 2 }] {
            // Of the first frame nothing says how well it should lie.
            if best.score <= most && !self.scores.is_empty() {
                break;
            }
            self.searched = Some(self.scores.len());
            let again = fitted(template, surface, start, &FitOptions::FAR, &mut known);
            if again.score < best.score {
                best = TrackedFrame { outcome: Outcome::SearchedWider, ..again };
            }
        }
        if self.scores.len() >= MIN_JUDGED && is_lost(best.score, usual) {
            best.outcome = Outcome::Lost;
        }
        self.scores.push(best.score);
        self.before = std::mem::replace(&mut self.last, best.cage.clone());
        best
    }

    /// The usual score just now. What a recent wider search has left is as good as it gets where
    /// the surface moves little.
    fn level(&self, slow: bool) -> f64 {
        let scores = judging(&self.scores);
        let recent = median(&scores[scores.len().saturating_sub(RECENT)..]);
        let searched = self.searched.filter(|&frame| slow && frame + SEARCHED_FOR >= self.scores.len());
        searched.map_or(recent, |frame| recent.max(self.scores[frame]))
    }

    /// A frame without a surface.
    pub fn skip(&mut self) -> TrackedFrame {
        self.before.clone_from(&self.last);
        TrackedFrame { cage: self.last.clone(), score: f64::INFINITY, outcome: Outcome::NoSurface }
    }
}

/// Scores but the first where there are others: a template that is the first frame lies there best.
fn judging(scores: &[f64]) -> &[f64] {
    if scores.len() > MIN_JUDGED { &scores[1..] } else { scores }
}

/// How far two cages are apart where they are farthest.
fn farthest_apart([a, b]: [&Vec<Point>; 2]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| norm(sub(a, b))).fold(0.0, f64::max)
}

/// Whether a frame lies badly, where this score is usual.
fn is_lost(score: f64, usual: f64) -> bool {
    score > (LOST_FROM * usual).max(LIES_WELL)
}

/// The median of some scores; infinite without any.
fn median(scores: &[f64]) -> f64 {
    let mut scores: Vec<f64> = scores.iter().copied().filter(|score| score.is_finite()).collect();
    scores.sort_by(f64::total_cmp);
    scores.get(scores.len() / 2).copied().unwrap_or(f64::INFINITY)
}

/// A fit from a cage, or that cage where it comes to nothing.
fn fitted(
    template: &Template,
    surface: &Target,
    start: &[Point],
    options: &FitOptions,
    known: &mut KnownMatches,
) -> TrackedFrame {
    let cage = template.fit(surface, start, options, known);
    let score = template.score(surface, &cage, 1, known);
    let outcome = Outcome::Followed;
    if score.is_finite() && cage.as_flattened().iter().all(|x| x.is_finite()) {
        TrackedFrame { cage, score, outcome }
    } else {
        TrackedFrame { cage: start.to_vec(), score: f64::INFINITY, outcome }
    }
}

/// Where `last` would be a frame later, moving on as it came.
fn extrapolated(last: &[Point], before: &[Point]) -> Vec<Point> {
    last.iter().zip(before).map(|(a, b)| std::array::from_fn(|k| 2.0 * a[k] - b[k])).collect()
}

/// A second pass, from the last frame to the first: each may come from the frame after it where
/// that lies better, and is smoothed between its neighbours.
pub struct SecondPass<'t> {
    template: &'t Template,
    /// Of the first pass.
    scores: Vec<f64>,
    usual: f64,
}

/// Frames that score above so many times the median around them are fitted again.
const REFITTED_FROM: f64 = 1.03;

impl<'t> SecondPass<'t> {
    /// Over these frames.
    pub fn new(template: &'t Template, frames: &[TrackedFrame]) -> Self {
        let scores: Vec<f64> = frames.iter().map(|frame| frame.score).collect();
        Self { template, usual: median(&scores), scores }
    }

    /// Whether a frame is fitted again.
    pub fn wants(&self, frame: usize) -> bool {
        let around = frame.saturating_sub(RECENT / 2)..(frame + RECENT / 2 + 1).min(self.scores.len());
        let score = self.scores[frame];
        score.is_finite() && score > (REFITTED_FROM * median(&self.scores[around])).min(SEARCHED_FROM_ALL * self.usual)
    }

    /// Fits a frame again from the cages of one or two frames after it, if that lies better.
    pub fn refit(&self, surface: &Target, frame: &mut TrackedFrame, after: &[&[Point]]) {
        let Some(&next) = after.first() else { return };
        let mut starts = vec![next.to_vec()];
        starts.extend(after.get(1).map(|beyond| extrapolated(next, beyond)));
        let mut known = self.template.unmatched(surface);
        for options in [FitOptions::NEAR, FitOptions::FAR] {
            for start in &starts {
                let again = fitted(self.template, surface, start, &options, &mut known);
                if again.score < frame.score {
                    *frame = TrackedFrame { outcome: Outcome::SearchedWider, ..again };
                }
            }
            if frame.score <= SEARCHED_FROM_ALL * self.usual {
                break;
            }
        }
    }

    /// Whether a frame is lost, in the end.
    pub fn judge(&self, frame: &mut TrackedFrame) {
        let lost = self.scores.len() > MIN_JUDGED && is_lost(frame.score, self.usual);
        match (lost, frame.outcome) {
            (_, Outcome::NoSurface) => {}
            (true, _) => frame.outcome = Outcome::Lost,
            (false, Outcome::Lost) => frame.outcome = Outcome::SearchedWider,
            (false, _) => {}
        }
    }
}

/// How smoothing fits: near the mean of the neighbours where the surface does not say otherwise.
const SMOOTHING: FitOptions = FitOptions { iterations: 2, rigidity: [1e-5; 2], reach: [0.006; 2], hold: 1e-2 };
/// Vertices much further from their mean in time than this share of the diagonal are let go.
const MAX_SMOOTHED: f64 = 0.005;

/// A frame's cage held between those beside it: what slides along the surface is smoothed.
pub fn smoothed(template: &Template, surface: &Target, cage: &[Point], [before, after]: [&[Point]; 2]) -> Vec<Point> {
    let most = MAX_SMOOTHED * template.diagonal();
    let reference: Vec<Point> = cage
        .iter()
        .zip(before.iter().zip(after))
        .map(|(&at, (&before, &after))| {
            let way = sub(middle(before, after), at);
            along(at, 1.0 / (1.0 + dot(way, way) / (most * most)), way)
        })
        .collect();
    template.fit_held(surface, cage, &reference, &SMOOTHING, None, &mut template.unmatched(surface)).0
}
