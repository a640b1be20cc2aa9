//! Writes containers with edited cages.

use crate::capture::GENERATOR;
use crate::decode::{Container, DecodeError};
use crate::edited::EditedCages;
use cager_formats::{Action, AtomicFile, Target};
use cager_proto::container::{self, ContainerWriter};
use cager_proto::report::{Errors, Report};
use std::io::BufWriter;
use std::path::Path;

/// What a report says of errors that are not known.
const NOT_MEASURED: &str = "the cages were edited: their errors are not measured";

/// What [`edit`] gives.
pub struct Edited {
    /// Number of frames.
    pub frames: usize,
    /// Frames whose cage is another than in the container it came from, or has no counterpart there.
    pub changed: usize,
    /// Whether the container had corrections of points beside the cages, which are left out.
    pub loses_detail: bool,
    /// The container, complete but for its name.
    pub container: AtomicFile,
}

/// Writes the container at `input` again with edited cages. Unchanged frames keep their errors; those of changed frames are not measured,
/// since the capture is not available. Where no frame is changed, the container is copied.
///
/// # Errors
/// Damage; edited cages that cannot be read; an output that refuses.
pub fn edit(
    mut container: Container,
    input: &Path,
    mut edited: EditedCages,
    output: &Target,
    progress: &mut dyn FnMut(usize),
) -> Result<Edited, DecodeError> {
    let fail = |cause| DecodeError::container(input, cause);
    if container.has_residual() && is_same(&mut container, &mut edited, input)? {
        return copied(input, output, edited.frames());
    }
    let refused = |cause: container::Error| written(output.path(), cause);
    let (mut rest, cage) = (container.rest().map_err(fail)?, container.cage().map_err(fail)?);
    rest.colors = container.colors().map_err(fail)?;
    let report = container.report().map_err(fail)?;
    // The residual belongs to the cages as they were; without it the errors are others.
    let loses = container.has_residual();
    let file = BufWriter::with_capacity(1 << 20, AtomicFile::create(output)?);
    let mut writer = ContainerWriter::new(file, container.header(), &rest, &cage).map_err(refused)?;
    if let Some(elements) = container.elements().map_err(fail)? {
        writer.add_elements(&elements).map_err(refused)?;
    }
    let (frames, mut changed) = (edited.frames(), 0);
    let (mut old, mut new) = (Vec::new(), Vec::new());
    for frame in 0..frames {
        edited.read_frame(frame, &mut new)?;
        let mut error = (f32::NAN, f32::NAN);
        if frame < container.frames() {
            container.read_frame(frame, &mut old).map_err(fail)?;
            if old == new && !loses {
                let known = report.error.per_frame[frame];
                error = (known.l2 as f32, known.linf as f32);
            }
        }
        changed += usize::from(old != new || frame >= container.frames());
        writer.write_frame(&new, error.0, error.1).map_err(refused)?;
        progress(frame + 1);
    }
    let same = changed == 0 && frames == container.frames() && !loses;
    if frames == container.frames() {
        writer.add_frame_numbers(&container.frame_numbers().map_err(fail)?).map_err(refused)?;
    }
    // Cages are stored as they are.
    let report = Report { coding: None, ..if same { report } else { after_editing(report) } };
    let buffered = writer.finish(Some(&report)).map_err(refused)?;
    let mut container = buffered.into_inner().map_err(|error| refused(error.into_error().into()))?;
    container.complete()?;
    Ok(Edited { frames, changed, loses_detail: loses, container })
}

/// Whether all cages are those of the container.
fn is_same(container: &mut Container, edited: &mut EditedCages, input: &Path) -> Result<bool, DecodeError> {
    if edited.frames() != container.frames() {
        return Ok(false);
    }
    let (mut old, mut new) = (Vec::new(), Vec::new());
    for frame in 0..edited.frames() {
        edited.read_frame(frame, &mut new)?;
        container.read_frame(frame, &mut old).map_err(|cause| DecodeError::container(input, cause))?;
        if old != new {
            return Ok(false);
        }
    }
    Ok(true)
}

fn copied(input: &Path, output: &Target, frames: usize) -> Result<Edited, DecodeError> {
    let read = |cause| cager_formats::Error::Io { path: input.to_owned(), action: Action::Read, cause };
    let mut file = AtomicFile::create(output)?;
    std::io::copy(&mut std::fs::File::open(input).map_err(read)?, &mut file).map_err(read)?;
    file.complete()?;
    Ok(Edited { frames, changed: 0, loses_detail: false, container: file })
}

/// The parts of the summary that are still valid.
fn after_editing(report: Report) -> Report {
    let (unknown, mut warnings) = (f64::NAN, report.warnings);
    warnings.retain(|warning| warning != NOT_MEASURED);
    warnings.push(NOT_MEASURED.to_owned());
    let error = Errors {
        l2_mean: unknown,
        l2_max: unknown,
        linf_mean: unknown,
        linf_max: unknown,
        kg_percent: unknown,
        ..Errors::default()
    };
    Report { generator: GENERATOR.to_owned(), error, warnings, ..report }
}

fn written(output: &Path, cause: container::Error) -> DecodeError {
    match cause {
        // Errors of `AtomicFile` that pass through `io::Write` contain the path already.
        container::Error::Io(io) => match io.downcast() {
            Ok(named) => DecodeError::Formats(named),
            Err(cause) => cager_formats::Error::Io { path: output.to_owned(), action: Action::Write, cause }.into(),
        },
        cause => DecodeError::container(output, cause),
    }
}
