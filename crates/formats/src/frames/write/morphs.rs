//! All frames as morph targets of glTF, in one binary file or as text and a file of numbers: their principal components, which are known once all frames are.

use std::io::{BufWriter, Write};

use cager_geometry::mesh::Polygons;
use cager_geometry::units::Change;

use super::super::CacheFormat;
use super::output::{Announced, FrameOptions, FrameWriter, check_precision, extend_changed};
use super::scene::name;
use crate::atomic::{AtomicFile, Target, commit_together};
use crate::error::{Error, Fault};
use crate::faces::check_face;
use crate::glb::{MOST_FRAMES, MorphScene, Morphs, Wanted};

/// Bytes that frames may have, which are all in memory.
const MOST_BYTES: usize = 1 << 30;

pub(super) struct MorphWriter {
    announced: Announced,
    file: AtomicFile,
    /// Of text, the numbers.
    data: Option<AtomicFile>,
    wanted: Wanted,
    scene: MorphScene,
    /// To metres with Y up.
    change: Change,
    frames: Vec<f32>,
    notes: Vec<String>,
}

impl MorphWriter {
    pub(super) fn create(
        announced: Announced,
        target: &Target,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let path = &announced.path;
        if options.origin.is_some() {
            check_precision(options, path)?;
        }
        let change = options.change_to_metres();
        let wanted = Wanted {
            targets: options.morphs.targets,
            max_error: options.morphs.max_error,
            is_guarantee: options.morphs.is_guarantee,
            diagonal: options
                .morphs
                .diagonal
                .map(|diagonal| change.scale * diagonal)
                .filter(|&diagonal| diagonal > 0.0),
        };
        check(&announced, faces, &wanted).map_err(|fault| fault.at(path))?;
        let (times, note) = times(announced.frames, options).map_err(|fault| fault.at(path))?;
        let scene = MorphScene {
            name: name(path),
            triangles: faces.triangulated(),
            times,
            numbering: [options.number(0), options.fps],
            origin: change.apply(options.origin.unwrap_or_default()),
            floats: options.morphs.floats,
            normals: options.morphs.normals,
        };
        let notes = note.into_iter().map(|note| format!("{}: {note}", path.display())).collect();
        let data = match CacheFormat::from_path(path) {
            Some(CacheFormat::Gltf) => Some(AtomicFile::create(data_beside(target))?),
            _ => None,
        };
        let file = AtomicFile::create(target)?;
        Ok(Self { announced, file, data, wanted, scene, change, frames: Vec::new(), notes })
    }

    /// Writes the file, once all frames are there.
    fn write(&mut self) -> Result<(), Error> {
        let Announced { path, points, frames, .. } = &self.announced;
        let morphs = Morphs::of(&self.frames, *points, &self.wanted, &self.scene).map_err(|fault| fault.at(path))?;
        let found = morphs.deviation();
        if found.targets > 0 {
            self.notes.push(format!(
                "{}: its {} morph targets are {:.1e} of the diagonal from the {frames} frames at most, {:.1e} in the mean ({})",
                path.display(),
                found.targets,
                found.share(found.largest),
                found.share(found.rms),
                if self.scene.floats { "floats" } else { "16 bits a coordinate" },
            ));
        }
        let mut out = BufWriter::with_capacity(1 << 16, &mut self.file);
        let written = match &mut self.data {
            None => morphs.write(&mut out),
            Some(data) => {
                let name = path.with_extension("bin");
                let name = name.file_name().unwrap_or_default().to_string_lossy();
                let mut data = BufWriter::with_capacity(1 << 16, data);
                morphs.write_apart(&mut out, &mut data, &name).and_then(|()| data.flush())
            }
        };
        let written = written.and_then(|()| out.flush());
        written.map_err(|cause| Error::write(path, cause))
    }
}

/// The file of numbers that belongs to one of text.
fn data_beside(target: &Target) -> Target {
    let path = target.path().with_extension("bin");
    if target.replaces() { Target::Replacing(path) } else { Target::New(path) }
}

fn check(announced: &Announced, faces: &Polygons, wanted: &Wanted) -> Result<(), Fault> {
    let Announced { points, frames, .. } = *announced;
    let targets = wanted.most().min(frames).min(3 * points);
    // Frames and targets, then weights and errors of each frame.
    let bytes = (frames + targets).saturating_mul(12 * points).saturating_add(frames.saturating_mul(32 * targets));
    if bytes > MOST_BYTES || frames > MOST_FRAMES {
        return Err(Fault::unsupported(format!(
            "cannot hold {frames} frames of {points} points as morph targets, which takes more than {} MB or more than {MOST_FRAMES} frames; take fewer of them (--range), or write .usdc or .abc",
            MOST_BYTES >> 20
        )));
    }
    faces.iter().enumerate().try_for_each(|(k, face)| check_face(face, points, || format!("face {k}")))
}

/// The seconds of frames from the first one on, in single precision, and what is to be said of them: programs play from 0 s, and would stand still until a late
/// first key.
fn times(frames: usize, options: &FrameOptions) -> Result<(Vec<f32>, Option<String>), Fault> {
    if frames < 2 {
        return Ok((Vec::new(), None));
    }
    let first = options.number(0);
    let seconds: Vec<f32> = (0..frames).map(|k| ((options.number(k) - first) / options.fps) as f32).collect();
    if seconds.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Err(Fault::unsupported(
            "has times in single precision, which cannot tell these frames apart; give a smaller --fps, or write .npy",
        ));
    }
    let note = || format!("frame {first} is at 0 s, where programs begin to play; its number is kept in extras");
    Ok((seconds, (first != 0.0).then(note)))
}

impl FrameWriter for MorphWriter {
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        extend_changed(&mut self.frames, positions, &self.change);
        if self.announced.written + 1 == self.announced.frames {
            let written = self.write();
            // What was not written is not counted, so that nothing is finished.
            if written.is_err() {
                self.frames.truncate(self.frames.len() - positions.len());
                return written;
            }
        }
        self.announced.written += 1;
        Ok(())
    }

    fn change_mesh(&mut self, _: usize, _: &Polygons, _: &FrameOptions) -> Result<(), Error> {
        Err(self.announced.one_mesh())
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.announced.check_complete()?;
        // The numbers first, as the text says that they are there.
        commit_together(self.data.into_iter().chain([self.file]).collect())
    }
}
