//! Writes containers with edited cages: as a layer beside what is there, or anew.

use crate::capture::GENERATOR;
use crate::decode::{Container, DecodeError};
use crate::edited::EditedCages;
use crate::encode::unwritable;
use cager_formats::{Action, AtomicFile, FrameRange, Target};
use cager_geometry::units::Units;
use cager_proto::container::{self, ContainerWriter, EditLayer, LayerBuilder, LayerSource};
use cager_proto::report::{Errors, Report};
use std::io::BufWriter;
use std::path::Path;

/// What a report says of errors that are not known.
const NOT_MEASURED: &str = "the cages were edited: their errors are not measured";

/// A file that takes a container.
type Output = BufWriter<AtomicFile>;

/// How edited cages are taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Editing<'a> {
    /// What the layer is called; may be empty.
    pub name: &'a str,
    /// The frames that are edited; the edited cages are those of all frames, or of these.
    pub range: Option<FrameRange>,
}

/// What [`edit`] gives.
pub struct Edited {
    /// Number of frames.
    pub frames: usize,
    /// Frames whose cage differs from the container's, or has none there.
    pub changed: usize,
    /// Vertices of the cage that the layer moves; none where there is no layer.
    pub vertices: usize,
    /// Whether a residual was left out, as it is of another number of frames.
    pub loses_detail: bool,
    /// The container, complete but for its name.
    pub container: AtomicFile,
}

/// Writes the container at `input` again with one more layer: edited cages less those that it has.
/// All else keeps its bytes, and positions are what they were plus what the layer moves them by.
/// Where no frame is changed, the container is copied. Cages of another number of frames take the
/// place of all that are there.
///
/// # Errors
/// Damage; edited cages that cannot be read; an output that refuses.
pub fn edit(
    mut container: Container,
    input: &Path,
    mut edited: EditedCages,
    what: &Editing<'_>,
    output: &Target,
    progress: &mut dyn FnMut(usize),
) -> Result<Edited, DecodeError> {
    if edited.replaces_frames(what.range) {
        return rewritten(container, input, edited, output, progress);
    }
    let frames = container.frames();
    let (layer, changed) = layer(&mut container, input, &mut edited, what, progress)?;
    let vertices = layer.as_ref().map_or(0, |layer| layer.vertices.len());
    let file = match layer {
        Some(layer) => {
            let there = container.layers().map_err(|cause| DecodeError::container(input, cause))?.len();
            let layers: Vec<_> = (0..there).map(LayerSource::Kept).chain([LayerSource::New(layer)]).collect();
            with_layers(&mut container, input, &layers, output)?
        }
        None => copied(input, output)?,
    };
    Ok(Edited { frames, changed, vertices, loses_detail: false, container: file })
}

/// The layer that makes the edited cages of a container's own, if they differ, and in how many
/// frames.
///
/// # Errors
/// Damage; edited cages that cannot be read.
pub fn layer(
    container: &mut Container,
    input: &Path,
    edited: &mut EditedCages,
    what: &Editing<'_>,
    progress: &mut dyn FnMut(usize),
) -> Result<(Option<EditLayer>, usize), DecodeError> {
    let mut builder = LayerBuilder::default();
    let (mut old, mut new, mut changed) = (Vec::new(), Vec::new(), 0);
    for (done, (place, frame)) in edited.places(what.range)?.into_iter().enumerate() {
        container.read_frame(frame, &mut old).map_err(|cause| DecodeError::container(input, cause))?;
        edited.read_beside(place, &old, &mut new)?;
        changed += usize::from(builder.add(frame, &old, &new));
        progress(done + 1);
    }
    Ok((builder.finish(what.name), changed))
}

/// Writes the container at `input` again with these layers; all else keeps its bytes.
///
/// # Errors
/// Damage; layers that do not fit it; an output that refuses.
pub fn with_layers(
    container: &mut Container,
    input: &Path,
    layers: &[LayerSource],
    output: &Target,
) -> Result<AtomicFile, DecodeError> {
    written(input, output, |file| ContainerWriter::copy_with_layers(container, layers, file))
}

/// Writes the container at `input` again with these units; all else keeps its bytes.
///
/// # Errors
/// Damage; a container that says something else; an output that refuses.
pub fn with_units(
    container: &mut Container,
    input: &Path,
    units: Units,
    output: &Target,
) -> Result<AtomicFile, DecodeError> {
    let header = container.header();
    let (origin, own) = (header.origin, header.units);
    if !own.change_to(units).is_none() {
        let what = "says already that its unit or its axis is another, and what is in it is not scaled or turned; cager decode --unit UNIT --up AXIS writes positions that are".to_owned();
        return Err(DecodeError::Meaning { path: input.to_owned(), what });
    }
    written(input, output, |file| ContainerWriter::copy_placed(container, (origin, own.or(units)), &[], file))
}

/// Writes the container at `input` again with cages that have its layers in them, and `more`. What
/// is added to positions beside the cages is kept; those that are switched off are not.
///
/// # Errors
/// Damage; an output that refuses.
pub fn flattened(
    mut container: Container,
    input: &Path,
    more: Option<EditLayer>,
    output: &Target,
) -> Result<AtomicFile, DecodeError> {
    let fail = |cause| DecodeError::container(input, cause);
    if let Some(layer) = more {
        container.push_layer(layer).map_err(fail)?;
    }
    if container.layers().map_err(fail)?.iter().all(|layer| !layer.is_on) {
        return with_layers(&mut container, input, &[], output);
    }
    let report = after_editing(container.report().map_err(fail)?);
    written(input, output, |file| ContainerWriter::copy_flattened(&mut container, Some(&report), file))
}

/// The container with edited cages alone, in place of all that it has. Unchanged frames keep their
/// errors; those of changed frames are not measured, since the capture is not available.
fn rewritten(
    mut container: Container,
    input: &Path,
    mut edited: EditedCages,
    output: &Target,
    progress: &mut dyn FnMut(usize),
) -> Result<Edited, DecodeError> {
    let fail = |cause| DecodeError::container(input, cause);
    let refused = |cause: container::Error| refused(output.path(), cause);
    let (mut rest, cage) = (container.rest().map_err(fail)?, container.cage().map_err(fail)?);
    rest.colors = container.colors().map_err(fail)?;
    if let Some((mut surface, faces)) = container.surface().map_err(fail)? {
        // Of these frames nothing says when parts are shown, and in which pictures.
        surface.forget_frames();
        surface.pictures = container.pictures().map_err(fail)?;
        (rest.faces, rest.surface) = (faces, surface);
    }
    let report = container.report().map_err(fail)?;
    // The residual belongs to the cages as they were; without it the errors are others.
    let loses = container.has_residual();
    let file = BufWriter::with_capacity(1 << 20, AtomicFile::create(output)?);
    let carriers = container.carriers().map_err(fail)?;
    let writer = ContainerWriter::with_meshes(file, container.header(), (&rest, None), (&cage, None), &carriers);
    let mut writer = writer.map_err(refused)?;
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
    // Cages are stored as they are.
    let report = Report { coding: None, ..after_editing(report) };
    let container = completed(writer.finish(Some(&report)).map_err(refused)?, output)?;
    Ok(Edited { frames, changed, vertices: 0, loses_detail: loses, container })
}

/// A container that `write` makes of the one at `input`.
fn written(
    input: &Path,
    output: &Target,
    write: impl FnOnce(Output) -> Result<Output, container::Error>,
) -> Result<AtomicFile, DecodeError> {
    let file = BufWriter::with_capacity(1 << 20, AtomicFile::create(output)?);
    // What cannot be written names the output already.
    let buffered = write(file).map_err(|cause| refused(input, cause))?;
    completed(buffered, output)
}

fn completed(buffered: Output, output: &Target) -> Result<AtomicFile, DecodeError> {
    let file = buffered.into_inner();
    let mut file = file.map_err(|error| refused(output.path(), error.into_error().into()))?;
    file.complete()?;
    Ok(file)
}

fn copied(input: &Path, output: &Target) -> Result<AtomicFile, DecodeError> {
    let read = |cause| cager_formats::Error::Io { path: input.to_owned(), action: Action::Read, cause };
    let mut file = AtomicFile::create(output)?;
    std::io::copy(&mut std::fs::File::open(input).map_err(read)?, &mut file).map_err(read)?;
    file.complete()?;
    Ok(file)
}

/// The parts of the summary that are still valid.
fn after_editing(report: Report) -> Report {
    let mut warnings = report.warnings;
    warnings.retain(|warning| warning != NOT_MEASURED);
    warnings.push(NOT_MEASURED.to_owned());
    let mut error = Errors::default();
    error.forget(&[]);
    Report { generator: GENERATOR.to_owned(), error, warnings, ..report }
}

fn refused(path: &Path, cause: container::Error) -> DecodeError {
    match cause {
        container::Error::Io(cause) => unwritable(path, cause).into(),
        cause => DecodeError::container(path, cause),
    }
}
