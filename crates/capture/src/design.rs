//! Designing a cage from a capture on disk: which frames are looked at, and what is reported.

use crate::encode::{EncodeError, sample_frames};
use crate::frames::CaptureFiles;
use cager_cages::{Components, Design, DesignError, DesignOptions, Parts, Progress, Style, design};
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_geometry::mesh::Model;
use cager_proto::report::{DesignReport, StageReport};
use std::ops::{ControlFlow, Range};

/// Most frames that a design looks at: to design by, to choose by, and stretches to judge by.
pub const FRAMES: usize = 160;

/// Vertices of a cage where no number is given: fewer where the points are few.
pub fn default_vertices(points: usize) -> usize {
    350.min(points / 2).max(4)
}

/// The usual options of a design: mean value coordinates do without all points inside.
pub fn usual_options(system: &dyn CoordinateSystem) -> DesignOptions {
    let style = if system.name() == MeanValue.name() { Style::Free } else { Style::Editable };
    DesignOptions { style, ..DesignOptions::default() }
}

/// Most vertices of a cage for these coordinates that so many points can determine.
pub fn most_vertices(system: &dyn CoordinateSystem, points: usize) -> usize {
    // Its normals are unknowns too, two for each vertex.
    if system.name() == Green::Free.name() { points.div_ceil(3) } else { points }
}

/// Evenly spaced frames of a capture, or of a range of it, to design a cage from.
///
/// # Errors
/// Those of the reader, also where it ends before the frames it announced.
pub fn read_frames(files: &CaptureFiles) -> Result<Vec<Vec<f64>>, EncodeError> {
    sample_frames(files.open()?.as_mut(), FRAMES, false)
}

/// Whether a cage has a component for each part of a model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PerPart {
    /// Parts that move together share one, where these follow the motion better than one cage.
    #[default]
    Auto,
    /// One for each part.
    Yes,
    /// One cage for all parts.
    No,
}

/// The components of a cage of so many vertices, a usual number without it, for the parts of a model
/// as they move in these frames; `None` where that is one cage for all.
pub fn components(
    per_part: PerPart,
    system: &dyn CoordinateSystem,
    rest: &Model,
    frames: &[Vec<f64>],
    vertices: Option<usize>,
) -> Option<Components> {
    let parts: Vec<Range<usize>> = rest.surface.ranges(&rest.faces).map(|(_, range)| range.points).collect();
    if parts.len() < 2 || frames.is_empty() || system.name() != MeanValue.name() {
        return None;
    }
    match per_part {
        PerPart::Auto => {
            let vertices = vertices.unwrap_or_else(|| default_vertices(rest.points.len()));
            Components::by_motion(rest, frames, &parts, vertices)
        }
        PerPart::Yes => Some(Components::of_each(rest, frames, &parts)),
        PerPart::No => None,
    }
}

/// A cage of these components, or, without any, one for all points.
///
/// # Errors
/// See [`DesignError`].
pub fn design_components(
    components: Option<&Components>,
    rest: &Model,
    frames: &[Vec<f64>],
    options: &DesignOptions,
    watch: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Design, DesignError> {
    match components {
        Some(components) => components.design(rest, frames, options, watch),
        None => design(rest, frames, None, options, watch),
    }
}

/// What is worth telling of a design from so many frames.
pub fn report(design: &Design, options: &DesignOptions, frames: usize) -> DesignReport {
    let stages = design.stages.iter().map(|stage| StageReport {
        name: stage.name.clone(),
        vertices: stage.vertices,
        designed_error: stage.training_error,
        held_back_error: stage.validation_error,
        condition_number: stage.condition_number.filter(|condition| condition.is_finite()),
        singular: stage.condition_number == Some(f64::INFINITY),
        seconds: stage.seconds,
    });
    let unseen = design.unseen.as_ref().map(|unseen| unseen.error);
    of_stages(stages.collect(), unseen, options, frames, design.timed_out)
}

/// The report of a design with these stages and this error on frames that it did not see.
pub fn of_stages(
    stages: Vec<StageReport>,
    unseen_error: Option<f64>,
    options: &DesignOptions,
    frames: usize,
    timed_out: bool,
) -> DesignReport {
    let last = stages.last();
    let parts = Parts::of(frames);
    DesignReport {
        style: style_name(options.style).to_owned(),
        seed: options.seed,
        vertices: last.map_or(0, |stage| stage.vertices),
        frames: parts.designed.len(),
        unseen_frames: unseen_error.map_or(0, |_| parts.unseen_frames()),
        designed_error: last.map_or(0.0, |stage| stage.designed_error),
        held_back_error: last.map_or(0.0, |stage| stage.held_back_error),
        unseen_error,
        timed_out,
        stages,
    }
}

/// All styles.
pub const STYLES: [Style; 2] = [Style::Free, Style::Editable];

/// The style with this name.
pub fn style_by_name(name: &str) -> Option<Style> {
    STYLES.into_iter().find(|&style| style_name(style) == name)
}

/// The name of a style on the command line and in reports.
pub fn style_name(style: Style) -> &'static str {
    match style {
        Style::Free => "free",
        Style::Editable => "editable",
    }
}
