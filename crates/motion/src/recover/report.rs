//! What is told of a recovery.

use super::departures::{Departure, told};
use super::distances::Distances;
use super::gait::GaitCurve;
use super::placement::Placement;
use super::surfaces::Seen;
use super::{FirstLook, RecoverProgress};
use cager_core::cage::Cage;
use cager_geometry::mesh::{Point, TriMesh};
use cager_shape::tracking::changed_for_good;
use cager_shape::tracking::{Outcome, TrackedFrame};
use serde::Serialize;
use std::path::PathBuf;

/// How a recovery went, as JSON. Lengths are shares of the template's diagonal.
#[derive(Debug, Serialize)]
pub struct RecoveryReport {
    /// Points of the template.
    pub points: usize,
    /// Vertices of its cage.
    pub cage_vertices: usize,
    /// Length of the template's diagonal, in the frames' unit.
    pub diagonal: f64,
    /// How the template was brought to the first surface, where it was.
    pub placement: Option<Placement>,
    /// Frames in which part of the template may be somewhere else, by their numbers.
    pub lost: Vec<f64>,
    /// Parts that left the surface, that no template explains, or that are stretched: the farthest
    /// first, twenty at the most.
    pub departures: Vec<Departure>,
    /// From which number on the template lies worse to the end: the topology seems to have changed.
    pub changed_from: Option<f64>,
    /// From the template to the surfaces, on average over frames that are not lost, if any.
    pub to_surface: Option<f64>,
    /// And back.
    pub from_surface: Option<f64>,
    /// Every frame.
    pub frames: Vec<FrameReport>,
    /// How high ankles and toes of a person are in them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub gait: Vec<GaitCurve>,
    /// How long it took.
    pub seconds: Seconds,
}

/// A frame.
#[derive(Debug, Serialize)]
pub struct FrameReport {
    /// Its number.
    pub number: f64,
    /// Its file.
    pub file: PathBuf,
    /// How its cage was found: `followed`, `wider_search`, `lost`, or `no_surface`.
    pub outcome: &'static str,
    /// Root mean square distances both ways, of positions and normals; none without a surface.
    pub score: Option<f64>,
    /// From the template to the surface; none where that is a cloud.
    pub to_surface: Option<Distances>,
    /// From the surface to the template.
    pub from_surface: Option<Distances>,
    /// Whether the surface faced inwards, and was turned.
    pub turned: bool,
    /// Whether normals were estimated from the points.
    pub estimated_normals: bool,
    /// Points alone and far from all others, which were left out.
    pub strays: usize,
}

/// Seconds of each part.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Seconds {
    /// Placing, coordinates, what is needed for fits.
    pub prepare: f64,
    /// From the first frame to the last.
    pub follow: f64,
    /// From the last frame to the first, offsets and measuring included.
    pub refine: f64,
}

/// How a frame's cage was found, and how well it lies.
#[derive(Clone, Copy, Debug)]
pub(super) struct How {
    outcome: &'static str,
    score: f64,
}

impl How {
    /// There was nothing to follow.
    pub(super) const NO_SURFACE: Self = Self { outcome: "no_surface", score: f64::INFINITY };

    /// The same where the template lies nowhere near.
    pub(super) fn lost(self) -> Self {
        Self { outcome: "lost", ..self }
    }

    /// A frame of the first pass with this cage and these joints.
    pub(super) fn first_look<'a>(self, frame: usize, cage: &'a [Point], joints: &'a [Point]) -> RecoverProgress<'a> {
        RecoverProgress::Followed(FirstLook { frame, cage, joints, score: self.score(), outcome: self.outcome })
    }

    /// None without a surface.
    pub(super) fn score(self) -> Option<f64> {
        Some(self.score).filter(|score| score.is_finite())
    }

    /// Of any subject.
    pub(super) fn of(frame: &TrackedFrame) -> Self {
        let outcome = match frame.outcome {
            Outcome::Followed => "followed",
            Outcome::SearchedWider => "wider_search",
            Outcome::Lost => "lost",
            Outcome::NoSurface => "no_surface",
        };
        Self { outcome, score: frame.score }
    }

    /// Of a person.
    pub(super) fn of_person(frame: &cager_shape::people::TrackedFrame) -> Self {
        let outcome = match (frame.lost, frame.searched) {
            (true, _) => "lost",
            (false, true) => "wider_search",
            (false, false) => "followed",
        };
        Self { outcome, score: frame.fit.score }
    }
}

impl FrameReport {
    pub(super) fn new(
        (number, file): (f64, PathBuf),
        how: How,
        (to_surface, from_surface): (Option<Distances>, Option<Distances>),
        seen: Option<&Seen>,
    ) -> Self {
        let (notes, strays) = seen.map(|seen| (seen.notes, seen.strays)).unwrap_or_default();
        Self {
            number,
            file,
            outcome: how.outcome,
            score: how.score(),
            to_surface,
            from_surface,
            turned: notes.turned,
            estimated_normals: notes.estimated_normals,
            strays,
        }
    }
}

impl RecoveryReport {
    pub(super) fn new(
        (rest, cage): (&TriMesh, &Cage),
        diagonal: f64,
        placement: Option<Placement>,
        (frames, departures): (Vec<FrameReport>, Vec<Departure>),
        seconds: Seconds,
    ) -> Self {
        let all_lost = frames.iter().all(|frame| frame.outcome == "lost");
        let mean = |of: fn(&FrameReport) -> Option<Distances>| {
            let found: Vec<f64> = frames
                .iter()
                .filter(|frame| all_lost || frame.outcome != "lost")
                .filter_map(of)
                .map(|distances| distances.mean)
                .collect();
            (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
        };
        Self {
            points: rest.vertices.len(),
            cage_vertices: cage.vertices().len(),
            diagonal,
            placement,
            lost: frames.iter().filter(|frame| frame.outcome == "lost").map(|frame| frame.number).collect(),
            departures,
            changed_from: None,
            to_surface: mean(|frame| frame.to_surface),
            from_surface: mean(|frame| frame.from_surface),
            frames,
            gait: Vec::new(),
            seconds,
        }
    }

    /// Looks for a change of topology.
    pub(super) fn find_change(&mut self) {
        let scores: Vec<f64> = self.frames.iter().map(|frame| frame.score.unwrap_or(f64::INFINITY)).collect();
        self.changed_from = changed_for_good(&scores).map(|frame| self.frames[frame].number);
    }

    /// What the user should know.
    pub(super) fn warnings(&self) -> Vec<String> {
        let list = |numbers: &[f64]| {
            let shown: Vec<String> = numbers.iter().take(10).map(ToString::to_string).collect();
            let more = if numbers.len() > 10 { format!(" and {} more", numbers.len() - 10) } else { String::new() };
            format!("{}{more}", shown.join(", "))
        };
        let of = |what: fn(&FrameReport) -> bool| {
            self.frames.iter().filter(|frame| what(frame)).map(|frame| frame.number).collect::<Vec<f64>>()
        };
        let mut warnings = Vec::new();
        let mut tell = |numbers: &[f64], what: &str| {
            if !numbers.is_empty() {
                warnings.push(format!("{what}: {}", list(numbers)));
            }
        };
        tell(&self.lost, "part of the template may be somewhere else in frames");
        tell(&of(|frame| frame.outcome == "no_surface"), "no surface, so the template stays as it was, in frames");
        tell(&of(|frame| frame.turned), "the surface faced inwards, and was turned, in frames");
        tell(&of(|frame| frame.estimated_normals), "there are no normals, so they were estimated, in frames");
        let strays: usize = self.frames.iter().map(|frame| frame.strays).sum();
        let what = format!("points alone and far from all others were left out, {strays} together, in frames");
        tell(&of(|frame| frame.strays > 0), &what);
        warnings.extend(told(&self.departures));
        warnings.extend(self.changed_from.map(|number| format!(
            "the template lies worse from frame {number} to the end: where the topology changed for good there, go on with another template (--template {number}:OTHER)"
        )));
        warnings
    }
}
