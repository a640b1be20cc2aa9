//! Exports the cages of a container in formats that other programs read.

use crate::decode::{DecodeError, frame_options, open, units};
use crate::origin::move_from;
use crate::timing::Timing;
use cager_formats::{AtomicFile, FrameRange, Target, commit_together, create_frames, obj_bytes};
use cager_geometry::mesh::Model;
use cager_geometry::units::Units;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Result of [`write_cages`].
pub struct CagesWritten {
    /// Number of frames.
    pub frames: usize,
    /// Vertices of the cage.
    pub vertices: u64,
    /// File with the rest cage; `None` for standard output.
    pub rest: Option<PathBuf>,
    /// Normals per frame that were left out because they are no positions (`green-free`).
    pub normals: u64,
}

/// Writes the cages of a container, or a range of them, in the container's units or others, to
/// `output`, and the rest cage with its faces to [`rest_cage_path`]. Each file is created
/// atomically, the frames first. A dry run reads and validates without writing.
///
/// # Errors
/// Damage; an output that refuses; another file in the place of the rest cage.
pub fn write_cages(
    input: &Path,
    output: &Target,
    (range, timing, asked): (Option<FrameRange>, Timing, Units),
    dry_run: bool,
    progress: &mut dyn FnMut(usize),
) -> Result<CagesWritten, DecodeError> {
    let fail = |cause| DecodeError::container(input, cause);
    let mut container = open(input)?;
    let range = range.unwrap_or(FrameRange::all(container.frames()));
    let there = container.frames();
    range.check(there, |frame| frame as f64, input)?;
    container.report().map_err(fail)?;
    let mut cage = Model::from(container.cage().map_err(fail)?);
    move_from(container.header().origin, &mut cage.points);
    let mut options = frame_options(&mut container, there, range, timing, false).map_err(fail)?;
    let change = units::convert(&mut options, asked, input)?;
    change.apply_to(&mut cage.points);
    let rest = (*output != Target::StandardOutput).then(|| rest_cage_path(output.path()));
    let mut rest_file = match &rest {
        Some(path) => rest_file(path, output.replaces(), &obj_bytes(&cage))?,
        None => None,
    };

    let rows = cage.points.len();
    let mut writer = create_frames(output, rows, range.count(), &cage.faces, &options)?;
    let mut frame = Vec::new();
    for place in 0..range.count() {
        container.read_frame(range.frame(place), &mut frame).map_err(fail)?;
        if !dry_run {
            units::apply(&change, &mut frame[..3 * rows]);
            writer.write_frame(&frame[..3 * rows])?;
        }
        progress(place + 1);
    }
    if !dry_run {
        // Completed before the frames get their name, so that on a full disk neither is created.
        rest_file.as_mut().map(AtomicFile::complete).transpose()?;
        writer.finish()?;
        commit_together(rest_file.into_iter().collect())?;
    }
    let header = container.header();
    Ok(CagesWritten {
        frames: range.count(),
        vertices: header.cage_vertices,
        rest,
        normals: u64::from(header.rows_per_frame).saturating_sub(header.cage_vertices),
    })
}

/// The file beside `output` that holds the rest cage: `walk.cage.obj` beside `walk.npy`, `walk/`,
/// `walk/*.ply` and `walk.####.obj`.
pub fn rest_cage_path(output: &Path) -> PathBuf {
    let name = output.file_name().and_then(|name| name.to_str());
    let before = name.and_then(|name| name.find(['*', '#', '%']).map(|at| &name[..at]));
    let named = match (before, output.parent()) {
        (Some(_), Some(folder)) if folder.file_name().is_some() => folder.to_owned(),
        (Some(before), _) => {
            let before = before.trim_end_matches(['.', '_', '-', ' ']);
            output.with_file_name(if before.is_empty() { "frames" } else { before }.to_owned() + ".obj")
        }
        _ => output.to_owned(),
    };
    named.with_extension("cage.obj")
}

/// Starts writing the rest cage; `None` if an identical file exists.
fn rest_file(path: &Path, replaces: bool, bytes: &[u8]) -> Result<Option<AtomicFile>, DecodeError> {
    match std::fs::read(path) {
        Ok(there) if there == bytes => Ok(None),
        Ok(_) if !replaces => {
            let what = "is another file where the rest cage is to be written; name another output, or give --overwrite to replace it";
            Err(cager_formats::Error::Target { path: path.to_owned(), what: what.to_owned() }.into())
        }
        _ => {
            let target = if replaces { Target::Replacing(path.to_owned()) } else { Target::New(path.to_owned()) };
            let mut file = AtomicFile::create(target)?;
            file.write_all(bytes).map_err(|cause| cager_formats::Error::Io {
                path: path.to_owned(),
                action: cager_formats::Action::Write,
                cause,
            })?;
            Ok(Some(file))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_cage_lies_beside_the_frames() {
        for (output, rest) in [
            ("walk.npy", "walk.cage.obj"),
            ("out/walk.pc2", "out/walk.cage.obj"),
            ("walk", "walk.cage.obj"),
            ("out/walk/", "out/walk.cage.obj"),
            ("out/walk/*.ply", "out/walk.cage.obj"),
            ("walk/f.####.obj", "walk.cage.obj"),
            ("walk.1.####.obj", "walk.1.cage.obj"),
            ("####.obj", "frames.cage.obj"),
        ] {
            assert_eq!(rest_cage_path(Path::new(output)), Path::new(rest), "{output}");
        }
    }
}
