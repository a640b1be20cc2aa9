//! The report of a capture that was encoded elsewhere, from its container.

use super::Steps;
use crate::report::{Bytes, Condition, Errors, FrameError, MaxVol, Report, Seconds, WorstError};
use crate::timing::counted_from_zero;
use cager_client::messages::PreparationSeconds;
use cager_proto::container::{ContainerReader, Error};
use std::io::{Read, Seek};
use std::time::Duration;

/// What took how long.
pub(super) struct Times {
    pub(super) preparation: PreparationSeconds,
    pub(super) steps: Steps,
    pub(super) total: Duration,
}

/// A report without sizes and times.
pub(super) struct Unfinished(Report);

/// Reads and checks a whole container.
pub(super) fn report(container: impl Read + Seek) -> Result<Unfinished, Error> {
    let mut container = ContainerReader::open(container)?;
    container.verify()?;
    let summary =
        container.summary()?.ok_or_else(|| Error::Corrupt { offset: 0, what: "it has no summary".to_owned() })?;
    let per_frame = container.errors()?;
    let rest = container.rest()?;
    let numbers = container.frame_numbers()?;
    let header = container.header();
    let diagonal = cager_core::mesh::diagonal(&rest.points);
    let per_frame: Vec<FrameError> =
        per_frame.iter().map(|e| FrameError { l2: e.l2.into(), linf: e.linf.into() }).collect();
    Ok(Unfinished(Report {
        points: header.points as usize,
        triangles: summary.triangles as usize,
        frames: container.frames(),
        diagonal,
        frame_numbers: if counted_from_zero(&numbers) { Vec::new() } else { numbers },
        unknowns: header.rows_per_frame as usize,
        cage_vertices: header.cage_vertices as usize,
        cage_faces: header.cage_faces as usize,
        coordinates: header.coordinates.clone(),
        handles: header.handles.clone(),
        regularizer: header.regularizer.clone(),
        spectrum: header.spectrum as usize,
        spectrum_choice: None,
        lambda: header.lambda,
        design: None,
        consistency: None,
        refinement: None,
        affine_reproduction_error: summary.affine_reproduction_error,
        condition_number: Condition { full: summary.condition_number.full, handles: summary.condition_number.handles },
        rank: summary.rank as usize,
        singular_values: summary.singular_values,
        maxvol: MaxVol {
            swaps: summary.maxvol.swaps as usize,
            log_volume: summary.maxvol.log_volume,
            max_entry: summary.maxvol.max_entry,
        },
        handle_indices: summary.handle_indices,
        error: Errors {
            l2_mean: summary.error.l2_mean,
            l2_max: summary.error.l2_max,
            linf_mean: summary.error.linf_mean,
            linf_max: summary.error.linf_max,
            kg_percent: summary.error.kg_percent,
            worst: WorstError::of_frames(&per_frame, diagonal),
            per_frame,
        },
        bytes: Bytes { capture: summary.capture_bytes, output: 0, ratio: 0.0, bits_per_vertex_per_frame: 0.0 },
        seconds: Seconds::default(),
        warnings: summary.warnings,
    }))
}

impl Unfinished {
    /// With the length of the file and what took how long.
    pub(super) fn finish(self, output: u64, times: &Times) -> Report {
        let Self(mut report) = self;
        report.bytes.output = output;
        report.bytes.ratio = report.bytes.capture as f64 / output as f64;
        report.bytes.bits_per_vertex_per_frame = 8.0 * output as f64 / (report.points * report.frames) as f64;
        report.seconds = Seconds {
            read: times.preparation.read,
            coordinates: times.preparation.coordinates,
            maxvol: times.preparation.maxvol,
            svd: times.preparation.svd,
            invert: times.steps.upload.as_secs_f64(),
            measure: 0.0,
            write: (times.steps.complete + times.steps.download).as_secs_f64(),
            total: times.total.as_secs_f64(),
        };
        report
    }
}
