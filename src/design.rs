//! Designing a cage from a capture on disk: which frames are looked at, and what is reported.

use crate::encode::{EncodeError, sample_frames};
use crate::frames::CaptureFiles;
use cager_cages::{Design, DesignOptions, Style};
use cager_client::cage_messages::CageJob;
use serde::{Deserialize, Serialize};

/// Frames of a capture that a design looks at, at most: every second one to design by, the others to judge by.
pub const FRAMES: usize = 160;

/// Evenly spaced frames of a capture, or of a range of it, to design a cage from.
///
/// # Errors
/// Those of the reader, also where it ends before the frames it announced.
pub fn read_frames(files: &CaptureFiles) -> Result<Vec<Vec<f64>>, EncodeError> {
    sample_frames(files.open()?.as_mut(), FRAMES, false)
}

/// How a cage was designed. Errors are least-squares errors over sampled points, root mean square, as fractions of the rest pose's
/// bounding-box diagonal.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct DesignReport {
    /// `free` or `editable`.
    pub style: String,
    /// Seed of what was drawn at random.
    pub seed: u64,
    /// Vertices of the cage.
    pub vertices: usize,
    /// Frames that the design saw, and as many or one less that it was judged by.
    pub frames: usize,
    /// Error on the frames that the design saw.
    pub designed_error: f64,
    /// Error on those that it did not see.
    pub held_back_error: f64,
    /// Whether the time limit ended it.
    pub timed_out: bool,
    /// What each stage brought.
    pub stages: Vec<StageReport>,
}

/// What one stage of a design brought.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct StageReport {
    /// What was done.
    pub name: String,
    /// Vertices after it.
    pub vertices: usize,
    /// Error after it on frames that the design sees.
    pub designed_error: f64,
    /// Error after it on frames that it does not see.
    pub held_back_error: f64,
    /// Condition number of the coordinates after it; absent where it is beyond all bounds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition_number: Option<f64>,
    /// Seconds since the design began.
    pub seconds: f64,
}

impl DesignReport {
    /// What is worth telling of a design from so many frames.
    pub fn new(design: &Design, options: &DesignOptions, frames: usize) -> Self {
        let stages: Vec<StageReport> = design
            .stages
            .iter()
            .map(|stage| StageReport {
                name: stage.name.clone(),
                vertices: stage.vertices,
                designed_error: stage.designed,
                held_back_error: stage.held_back,
                condition_number: Some(stage.condition_number).filter(|c| c.is_finite()),
                seconds: stage.seconds,
            })
            .collect();
        Self::of_stages(stages, options, frames, design.timed_out)
    }

    /// What is worth telling of a design that a service made.
    pub fn of_job(job: &CageJob, options: &DesignOptions) -> Self {
        let stages: Vec<StageReport> = job
            .stages
            .iter()
            .map(|stage| StageReport {
                name: stage.name.clone(),
                vertices: stage.vertices as usize,
                designed_error: stage.error.designed.unwrap_or(0.0),
                held_back_error: stage.error.held_back.unwrap_or(0.0),
                condition_number: stage.condition_number,
                seconds: stage.seconds,
            })
            .collect();
        Self::of_stages(stages, options, job.sampled_frames as usize, job.timed_out)
    }

    fn of_stages(stages: Vec<StageReport>, options: &DesignOptions, frames: usize, timed_out: bool) -> Self {
        let last = stages.last();
        Self {
            style: style_name(options.style).to_owned(),
            seed: options.seed,
            vertices: last.map_or(0, |stage| stage.vertices),
            frames: frames.div_ceil(2),
            designed_error: last.map_or(0.0, |stage| stage.designed_error),
            held_back_error: last.map_or(0.0, |stage| stage.held_back_error),
            timed_out,
            stages,
        }
    }
}

/// The name of a style on the command line and in reports.
pub fn style_name(style: Style) -> &'static str {
    match style {
        Style::Free => "free",
        Style::Editable => "editable",
    }
}
