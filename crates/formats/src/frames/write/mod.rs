//! Frames to files.

mod cache;
mod mesh;
mod sequence;
mod single;

use std::path::{MAIN_SEPARATOR, Path, PathBuf};

use cager_core::mesh::{Point, Polygons};

use super::CacheFormat;
use super::numbered::NumberedNames;
use crate::atomic::Target;
use crate::error::{Error, Fault};
use crate::mesh::MeshFormat;
use cache::CacheWriter;
use mesh::FrameMesh;
use sequence::SequenceWriter;
use single::SingleWriter;

/// The frames of an output, one after another; dropped before [`FrameWriter::finish`] they leave nothing.
pub trait FrameWriter: Send {
    /// Writes the next frame, 3 × points coordinates `x y z x y z …`.
    ///
    /// # Errors
    /// [`Error::PointCount`] for another number of coordinates, [`Error::NonFinite`], [`Error::FrameCount`] for more
    /// frames than announced, [`Error::Io`].
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error>;

    /// Makes the frames durable and gives the output its name.
    ///
    /// # Errors
    /// [`Error::FrameCount`] for fewer frames than announced, [`Error::Target`], [`Error::Io`]; the output is then not
    /// created.
    fn finish(self: Box<Self>) -> Result<(), Error>;
}

/// What some formats store beside the positions.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameOptions {
    /// Frames per second, for the times in `.mdd`: 24 by default.
    pub fps: f64,
    /// The number of each frame, ascending, for the names of files and the times in `.pc2` and `.mdd`; 0, 1, 2, … where there are none.
    pub numbers: Vec<f64>,
    /// What is added to all positions, which are then written in double precision by the formats that have it.
    pub origin: Option<Point>,
    /// What rounding may lose where an origin is added; formats of single precision that lose more are refused.
    pub rounding: f64,
}

impl FrameOptions {
    fn number(&self, frame: usize) -> f64 {
        self.numbers.get(frame).copied().unwrap_or(frame as f64)
    }

    /// The distance of two frames; 1 where it is not the same throughout.
    fn step(&self) -> f64 {
        let mut steps = self.numbers.windows(2).map(|pair| pair[1] - pair[0]);
        let first = steps.next().unwrap_or(1.0);
        if steps.all(|step| (step - first).abs() <= 1e-6 * first) { first } else { 1.0 }
    }
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self { fps: 24.0, numbers: Vec::new(), origin: None, rounding: 0.0 }
    }
}

/// The file or folder that [`create_frames`] makes for this path: of a pattern, the folder.
pub fn frames_path(path: &Path) -> &Path {
    let pattern = mesh_pattern(path).is_some() || NumberedNames::of(path).is_some();
    path.parent().filter(|_| pattern).unwrap_or(path)
}

fn mesh_pattern(path: &Path) -> Option<&str> {
    path.file_name()?.to_str().filter(|name| matches!(*name, "*.ply" | "*.obj"))
}

/// Begins an output of `frames` frames of `points` points each.
///
/// The extension of `path` says what: `.npy` (frames × points × 3, `<f4`, or `<f8` with an origin), `.pc2` or `.mdd`. Without an extension, with
/// a `/` at the end, or as an existing folder it becomes a folder of files `frame_0000.obj`, …, each with `faces` and its number;
/// `FOLDER/*.ply` makes them `.ply` files, and `FOLDER/NAME.%04d.obj` or `FOLDER/NAME.####.ply` gives their names.
/// A folder with nothing but such files is replaced as a whole where the target may be. Of one frame, `.obj`, `.ply`, `.off` or `.stl` becomes
/// a mesh file. Standard output gets `.npy`.
///
/// # Errors
/// [`Error::Unsupported`] for other extensions and for more points or frames than a format can count,
/// [`Error::Invalid`] for no points, no frames, faces without their points and a frame rate that is not positive,
/// [`Error::Target`] and [`Error::Io`] where the output cannot be created.
pub fn create_frames(
    target: impl Into<Target>,
    points: usize,
    frames: usize,
    faces: &Polygons,
    options: &FrameOptions,
) -> Result<Box<dyn FrameWriter>, Error> {
    let target = target.into();
    let given = target.path();
    let (path, pattern) = (frames_path(given), mesh_pattern(given));
    let announced = Announced { path: path.to_owned(), points, frames, written: 0 };
    announced.check(options).map_err(|fault| fault.at(path))?;
    if target == Target::StandardOutput {
        return Ok(Box::new(CacheWriter::create(announced, &target, CacheFormat::Npy, options)?));
    }
    if let Some(names) = NumberedNames::of(given) {
        check_numbered(&names, path).map_err(|fault| fault.at(given))?;
        return Ok(Box::new(SequenceWriter::create(announced, &target, faces, names, options)?));
    }
    if pattern.is_some() || is_folder(path) {
        let whole = |frame: usize| options.number(frame).abs().trunc().to_string().len();
        let digits = whole(0).max(whole(frames - 1)).max(4);
        let extension = if pattern == Some("*.ply") { ".ply" } else { ".obj" };
        let names = NumberedNames::new("frame_", digits, extension);
        return Ok(Box::new(SequenceWriter::create(announced, &target, faces, names, options)?));
    }
    if let Some(format) = MeshFormat::guess(path).filter(|format| FrameMesh::FORMATS.contains(format)) {
        return Ok(Box::new(SingleWriter::create(announced, &target, format, faces, options)?));
    }
    match CacheFormat::from_path(path) {
        Some(format) => Ok(Box::new(CacheWriter::create(announced, &target, format, options)?)),
        None => Err(Fault::unsupported(
            "is not a format of frames that is written; end the name in one of .npy .pc2 .mdd, in / for a folder of .obj files, or of one frame in .obj .ply .off .stl",
        )
        .at(path)),
    }
}

fn check_numbered(names: &NumberedNames, folder: &Path) -> Result<(), Fault> {
    if !(names.extension_is("obj") || names.extension_is("ply")) {
        return Err(Fault::unsupported(
            "is not of a mesh format that is written for frames; end the name in .obj or .ply",
        ));
    }
    if folder.as_os_str().is_empty() {
        return Err(Fault::invalid("names no folder; give the files a new one, as in FOLDER/NAME.####.obj"));
    }
    Ok(())
}

fn is_folder(path: &Path) -> bool {
    let text = path.as_os_str().as_encoded_bytes();
    let separated = text.last().is_some_and(|&end| end == b'/' || char::from(end) == MAIN_SEPARATOR);
    separated || path.extension().is_none() || path.is_dir()
}

/// Refuses formats of single precision where it loses too much about an origin.
fn check_precision(options: &FrameOptions, path: &Path) -> Result<(), Error> {
    let farthest = options.origin.iter().flatten().fold(0.0, |far: f64, x| far.max(x.abs()));
    let lost = farthest * f64::from(f32::EPSILON) / 2.0;
    if lost <= options.rounding {
        return Ok(());
    }
    let what = format!(
        "holds single precision, which loses all that is smaller than {lost:.1e} units so far from the origin; write .npy, or .obj or .ply files"
    );
    Err(Fault::unsupported(what).at(path))
}

/// Announced size of an output, and the number of frames written.
struct Announced {
    path: PathBuf,
    points: usize,
    frames: usize,
    written: usize,
}

impl Announced {
    fn check(&self, options: &FrameOptions) -> Result<(), Fault> {
        if self.points == 0 || self.frames == 0 {
            return Err(Fault::invalid(format!(
                "cannot hold {} frames of {} points; give it at least one of each",
                self.frames, self.points
            )));
        }
        if self.points > u32::MAX as usize {
            return Err(Fault::unsupported(format!(
                "cannot hold {} points, more than {}; reduce the mesh",
                self.points,
                u32::MAX
            )));
        }
        let ascending = options.numbers.windows(2).all(|pair| pair[0] < pair[1]);
        let counted = options.numbers.is_empty() || options.numbers.len() == self.frames;
        if !(ascending && counted && options.numbers.iter().all(|x| x.is_finite())) {
            return Err(Fault::invalid("cannot have these frame numbers; give one for each frame, ascending"));
        }
        if !(options.fps > 0.0 && options.fps.is_finite()) {
            return Err(Fault::invalid(format!(
                "cannot have {} frames per second; give a positive number",
                options.fps
            )));
        }
        Ok(())
    }

    /// Checks the next frame.
    fn admit(&self, positions: &[f32]) -> Result<(), Error> {
        let (path, frame) = (|| self.path.clone(), self.written);
        if self.written == self.frames {
            return Err(Error::FrameCount { path: path(), announced: self.frames, written: self.written + 1 });
        }
        if positions.len() != 3 * self.points {
            let found = (positions.len() / 3) as u64;
            return Err(Error::PointCount { path: path(), frame: Some(frame), expected: self.points, found });
        }
        match positions.iter().position(|x| !x.is_finite()) {
            Some(culprit) => Err(Error::NonFinite { path: path(), frame, point: culprit / 3 }),
            None => Ok(()),
        }
    }

    fn check_complete(&self) -> Result<(), Error> {
        if self.written == self.frames {
            return Ok(());
        }
        Err(Error::FrameCount { path: self.path.clone(), announced: self.frames, written: self.written })
    }
}
