//! Captures of files: a rest pose, its cage, and the frames.

use crate::cage_file::read_cage;
use crate::checks::{check_cage, check_frames};
use crate::design::{PerPart, components, default_vertices, design_components, read_frames};
use crate::encode::EncodeError;
use crate::frames::CaptureFiles;
use cager_cages::{DesignOptions, Goal};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_formats::{Dropped, PictureSequence, ReadModel, read_mesh, read_split_mesh, take_pictures};
use cager_geometry::mesh::Model;
use cager_geometry::surface::Surface;
use std::ops::ControlFlow;
use std::path::{Path, absolute};
use std::sync::Arc;

/// A rest pose, its cage, and frames that are read from files.
#[derive(Clone, Debug)]
pub struct Capture {
    /// Model in its rest pose, about the origin of [`Self::files`].
    pub rest: Model,
    /// Checked cage around it.
    pub cage: Cage,
    /// Where the frames are, and how they are adapted to the rest pose.
    pub files: CaptureFiles,
    warnings: Vec<String>,
}

impl Capture {
    /// Opens a rest pose and a cage, each a mesh, and frames: a folder or pattern of mesh files, or
    /// a point cache. See [`OpenOptions`] for files that need more to be said.
    ///
    /// # Errors
    /// Files that cannot be read or do not belong together; an invalid cage.
    pub fn open(rest: impl AsRef<Path>, cage: impl AsRef<Path>, frames: impl AsRef<Path>) -> Result<Self, EncodeError> {
        OpenOptions::default().open(rest, cage, frames)
    }

    /// Opens a rest pose and frames, and designs a cage from their motion, which takes minutes;
    /// `vertices` is its size, a usual one without it.
    ///
    /// # Errors
    /// Files that cannot be read or do not belong together; no frames.
    pub fn design(
        rest: impl AsRef<Path>,
        frames: impl AsRef<Path>,
        vertices: Option<usize>,
    ) -> Result<Self, EncodeError> {
        OpenOptions::default().design(rest, frames, vertices)
    }

    /// What should be known of the files: what of them is not kept, vertices that were merged,
    /// changes of units and axes, and mismatches that were allowed, after an encoding also those
    /// found by it.
    pub fn warnings(&self) -> Vec<String> {
        let noted = self.files.belonging.as_ref().and_then(|belonging| belonging.noted());
        self.warnings.iter().map(String::as_str).chain(noted).map(str::to_owned).collect()
    }
}

/// How a capture is opened, where the defaults do not suit its files.
///
/// ```no_run
/// use cager_capture::{CaptureFiles, OpenOptions, Up};
///
/// # fn main() -> Result<(), cager_capture::EncodeError> {
/// let files = CaptureFiles { up: Some(Up::Z), ..CaptureFiles::default() };
/// let options = OpenOptions { files, flip_cage: true, ..OpenOptions::default() };
/// let capture = options.open("rest.obj", "cage.obj", "frames/*.ply")?;
/// for warning in capture.warnings() {
///     eprintln!("{warning}");
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct OpenOptions {
    /// Which frames are taken and how they are read; where they are and how many points they have
    /// is filled in.
    pub files: CaptureFiles,
    /// Merges the points of the rest pose that seams split; frames are read split or merged.
    pub weld: bool,
    /// Turns the faces of the cage around, which point inwards.
    pub flip_cage: bool,
    /// Takes in the pictures that the materials of the rest pose name.
    pub pictures: bool,
    /// Goes on, with warnings, where rest pose, cage and frames look as if they did not belong
    /// together.
    pub allow_mismatch: bool,
}

/// A capture that may be without a cage.
pub struct Opened {
    /// Model in its rest pose, about the origin of [`Self::files`].
    pub rest: Model,
    /// The cage, where one was named.
    pub cage: Option<Cage>,
    /// Where the frames are, and how they are adapted to the rest pose.
    pub files: CaptureFiles,
    /// What the file of the rest pose holds that is not read.
    pub dropped: Dropped,
}

/// A rest pose with its points as often as its file stores them, where the frames have as many.
fn as_in_frames(rest: ReadModel, path: &Path, files: &CaptureFiles) -> Result<ReadModel, EncodeError> {
    let points = rest.model.points.len();
    if rest.model.surface.is_empty() {
        return Ok(rest);
    }
    let Some(split) = read_split_mesh(path, &files.selection.prims)? else { return Ok(rest) };
    let stored = split.model.points.len();
    let has = |points| {
        let files = CaptureFiles { points, ..files.clone() };
        files.open().and_then(|mut reader| reader.read_next(&mut Vec::new())).is_ok()
    };
    Ok(if stored != points && !has(points) && has(stored) { split } else { rest })
}

/// Gives the materials of a rest pose the pictures of frames, named from the folder of its file: by the names of
/// materials, of equal ones by their places, or where there is one alone; says which pictures are left out.
fn take_sequences(surface: &mut Surface, found: &[PictureSequence], path: &Path) -> Option<String> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let here = |path: &str| {
        let [path, folder] = [Path::new(path), folder].map(|path| absolute(path).unwrap_or_else(|_| path.to_owned()));
        path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().replace('\\', "/")
    };
    let is_one = |a: &PictureSequence, b: &PictureSequence| (&a.material, a.place) == (&b.material, b.place);
    let is_alone = surface.materials.len() == 1 && found.windows(2).all(|pair| is_one(&pair[0], &pair[1]));
    let names: Vec<String> = surface.materials.iter().map(|material| material.name.clone()).collect();
    let is_only = |sequence: &PictureSequence| {
        names.iter().filter(|name| **name == sequence.material).count() == 1
            && found.iter().all(|other| other.material != sequence.material || is_one(sequence, other))
    };
    let is_of = |sequence: &PictureSequence, place: usize| {
        is_alone || sequence.material == names[place] && (sequence.place == Some(place) || is_only(sequence))
    };
    let mut left: Vec<&PictureSequence> = found.iter().collect();
    for (place, material) in surface.materials.iter_mut().enumerate() {
        for texture in &mut material.textures {
            let is_it = |found: &PictureSequence| found.channel == texture.channel && is_of(found, place);
            let sequence = found.iter().find(|found| is_it(found));
            left.retain(|found| !is_it(found));
            texture.set_frames(sequence.map_or_else(Vec::new, |found| found.paths.iter().map(|p| here(p)).collect()));
        }
    }
    let first = left.first()?;
    let more = if left.len() > 1 { format!(" and {} more", left.len() - 1) } else { String::new() };
    Some(format!(
        "{}: the {} pictures by frame of the material {:?}{more} are left out, as the rest pose has no such picture, \
         or several materials of this name",
        path.display(),
        first.channel.name(),
        first.material,
    ))
}

impl OpenOptions {
    /// As [`Capture::open`].
    ///
    /// # Errors
    /// As [`Capture::open`].
    pub fn open(
        self,
        rest: impl AsRef<Path>,
        cage: impl AsRef<Path>,
        frames: impl AsRef<Path>,
    ) -> Result<Capture, EncodeError> {
        self.finish(rest.as_ref(), Some(cage.as_ref()), frames.as_ref(), None)
    }

    /// As [`Capture::design`].
    ///
    /// # Errors
    /// As [`Capture::design`].
    pub fn design(
        self,
        rest: impl AsRef<Path>,
        frames: impl AsRef<Path>,
        vertices: Option<usize>,
    ) -> Result<Capture, EncodeError> {
        self.finish(rest.as_ref(), None, frames.as_ref(), vertices)
    }

    fn finish(
        self,
        path: &Path,
        cage: Option<&Path>,
        frames: &Path,
        vertices: Option<usize>,
    ) -> Result<Capture, EncodeError> {
        let mut warnings = Vec::new();
        let Opened { rest, cage, files, dropped } = self.read(path, cage, frames, &mut warnings)?;
        warnings.extend(dropped.sentence(path, false));
        let cage = match cage {
            Some(cage) => cage,
            None => {
                let goal = Goal::Vertices(vertices.unwrap_or_else(|| default_vertices(rest.points.len())));
                let options = DesignOptions { goal, ..DesignOptions::default() };
                let on = &mut |_: cager_cages::Progress<'_>| ControlFlow::Continue(());
                let frames = read_frames(&files)?;
                let components = components(PerPart::Auto, &MeanValue, &rest, &frames, vertices);
                let mut designed = design_components(components.as_ref(), &rest, &frames, &options, on)?;
                warnings.append(&mut designed.warnings);
                designed.into_cage().map_err(|cause| EncodeError::Cage { path: path.to_owned(), cause })?
            }
        };
        Ok(Capture { rest, cage, files, warnings })
    }

    /// Opens and checks all there is; adds to the warnings also where it fails.
    ///
    /// # Errors
    /// As [`Capture::open`].
    pub fn read(
        self,
        path: &Path,
        cage_path: Option<&Path>,
        frames: &Path,
        warnings: &mut Vec<String>,
    ) -> Result<Opened, EncodeError> {
        let Self { mut files, weld, flip_cage, pictures, allow_mismatch } = self;
        (files.path, files.selection.no_frames) =
            (frames.to_owned(), [path].into_iter().chain(cage_path).map(Path::to_path_buf).collect());
        let read = read_mesh(path, &files.selection.prims)?;
        let ReadModel { model: mut rest, units, note, dropped } = as_in_frames(read, path, &files)?;
        warnings.extend(note);
        (files.points, files.rest_units) = (rest.points.len(), units);
        if weld {
            let had_surface = !rest.surface.is_empty();
            files.weld(&mut rest);
            if had_surface && rest.surface.is_empty() {
                warnings.push(format!(
                    "{}: texture coordinates, materials, groups and hard edges are not kept where vertices are merged",
                    path.display()
                ));
            }
        }
        if rest.surface.parts.len() > 1 {
            files.selection.rest = Some(Arc::new(rest.clone()));
        }
        files.take_origin(&mut rest);
        let cage = match cage_path {
            Some(cage) => Some(read_cage(cage, flip_cage, (files.origin, files.meaning()), warnings)?),
            None => None,
        };
        check_frames(&mut files, (path, &rest), allow_mismatch, warnings)?;
        for (part, shown) in rest.surface.parts.iter_mut().zip(std::mem::take(&mut files.shown)) {
            part.shown = shown;
        }
        warnings.extend(take_sequences(&mut rest.surface, &std::mem::take(&mut files.pictures), path));
        rest.surface.keep_named_pictures();
        if pictures {
            warnings.extend(take_pictures(&mut rest.surface, path));
        } else if !std::mem::take(&mut rest.surface.pictures).is_empty() {
            warnings
                .push(format!("{}: the pictures in it are left out; --textures embed takes them in", path.display()));
        }
        if let (Some(path), Some(cage)) = (cage_path, &cage) {
            check_cage((path, cage.mesh()), &rest, allow_mismatch, warnings)?;
        }
        Ok(Opened { rest, cage, files, dropped })
    }
}
