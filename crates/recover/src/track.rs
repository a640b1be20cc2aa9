//! A template followed through surfaces without correspondence, by its cage alone: any subject.

use cager_geometry::vector::{Point, along, dot, middle, sub};
use cager_registration::{FitOptions, Target, Template};

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
    /// How well the template lies on the surface ([`Template::score`]), a share of the diagonal; infinite without a surface.
    pub score: f64,
    /// How it was found.
    pub outcome: Outcome,
}

/// Follows a template from frame to frame.
pub struct Tracker<'t> {
    template: &'t Template,
    last: Vec<Point>,
    before: Vec<Point>,
    /// Scores of the frames so far, ascending.
    scores: Vec<f64>,
}

/// A frame that scores above so many times the median is looked for further around.
const SEARCHED_FROM: f64 = 1.06;
/// A frame that scores above so many times the median is lost.
const LOST_FROM: f64 = 1.5;

impl<'t> Tracker<'t> {
    /// From the cage of the rest pose, laid where the first frame is.
    pub fn new(template: &'t Template, start: Vec<Point>) -> Self {
        Self { template, before: start.clone(), last: start, scores: Vec::new() }
    }

    /// The next frame's cage.
    pub fn follow(&mut self, surface: &Target) -> TrackedFrame {
        let template = self.template;
        let ahead = extrapolated(&self.last, &self.before);
        let starts = [&self.last, &ahead];
        let near = starts.map(|start| template.score(surface, start));
        let start = starts[usize::from(near[1] < near[0])];
        let mut best = Scored::fit(template, surface, start, &FitOptions::NEAR);
        let mut outcome = Outcome::Followed;
        let usual = self.usual_score();
        if best.score > SEARCHED_FROM * usual.unwrap_or(f64::INFINITY) {
            for start in starts {
                let again = Scored::fit(template, surface, start, &FitOptions::FAR);
                if again.score < best.score {
                    (best, outcome) = (again, Outcome::SearchedWider);
                }
            }
        }
        if best.score > LOST_FROM * usual.unwrap_or(f64::INFINITY) {
            outcome = Outcome::Lost;
        }
        let at = self.scores.partition_point(|&score| score < best.score);
        self.scores.insert(at, best.score);
        self.before = std::mem::replace(&mut self.last, best.cage.clone());
        TrackedFrame { cage: best.cage, score: best.score, outcome }
    }

    /// A frame without a surface.
    pub fn skip(&mut self) -> TrackedFrame {
        self.before.clone_from(&self.last);
        TrackedFrame { cage: self.last.clone(), score: f64::INFINITY, outcome: Outcome::NoSurface }
    }

    /// The median of the scores so far.
    fn usual_score(&self) -> Option<f64> {
        self.scores.get(self.scores.len() / 2).copied()
    }
}

/// A cage and how well it lies.
struct Scored {
    cage: Vec<Point>,
    score: f64,
}

impl Scored {
    fn fit(template: &Template, surface: &Target, start: &[Point], options: &FitOptions) -> Self {
        let cage = template.fit(surface, start, options);
        Self { score: template.score(surface, &cage), cage }
    }
}

/// Where `last` would be a frame later, moving on as it came.
fn extrapolated(last: &[Point], before: &[Point]) -> Vec<Point> {
    last.iter().zip(before).map(|(a, b)| std::array::from_fn(|k| 2.0 * a[k] - b[k])).collect()
}

/// A second pass over frames that were followed, from the last to the first, each of which may come from the frame after it as well where
/// that lies better, and is smoothed between its neighbours.
pub struct SecondPass<'t> {
    template: &'t Template,
    usual: f64,
}

/// A frame of the first pass that scores above so many times the median is fitted again from the frame after it.
const REFITTED_FROM: f64 = 1.03;

impl<'t> SecondPass<'t> {
    /// Over these frames.
    pub fn new(template: &'t Template, frames: &[TrackedFrame]) -> Self {
        let mut scores: Vec<f64> = frames.iter().map(|frame| frame.score).filter(|score| score.is_finite()).collect();
        scores.sort_by(f64::total_cmp);
        Self { template, usual: scores.get(scores.len() / 2).copied().unwrap_or(f64::INFINITY) }
    }

    /// Whether a frame is fitted again.
    pub fn wants(&self, frame: &TrackedFrame) -> bool {
        frame.score.is_finite() && frame.score > REFITTED_FROM * self.usual
    }

    /// Fits a frame again from the cages of the one or two frames after it, nearest first, if that lies better.
    pub fn refit(&self, surface: &Target, frame: &mut TrackedFrame, after: &[&[Point]]) {
        let Some(&next) = after.first() else { return };
        let mut starts = vec![next.to_vec()];
        starts.extend(after.get(1).map(|beyond| extrapolated(next, beyond)));
        for start in starts {
            for options in [FitOptions::NEAR, FitOptions::FAR] {
                let again = Scored::fit(self.template, surface, &start, &options);
                if again.score < frame.score {
                    (frame.cage, frame.score) = (again.cage, again.score);
                    frame.outcome = Outcome::SearchedWider;
                }
            }
        }
        if frame.score > LOST_FROM * self.usual {
            frame.outcome = Outcome::Lost;
        }
    }
}

/// How smoothing fits: near the mean of the neighbours where the surface does not say otherwise.
const SMOOTHING: FitOptions =
    FitOptions { iterations: 2, rigidity: [1e-5; 2], reach: [0.006; 2], hold: 1e-2, ..FitOptions::NEAR };
/// Vertices that are much further from the mean of their neighbours in time than this share of the diagonal move like that, and are let go.
const MAX_SMOOTHED: f64 = 0.005;

/// A frame's cage again, held between those of the frames beside it: what the surface does not determine, sliding along it, is smoothed.
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
    template.fit_beside(surface, cage, &reference, &SMOOTHING)
}
