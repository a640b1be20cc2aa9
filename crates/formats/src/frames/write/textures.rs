//! All frames as vertex animation textures in a folder, which are known once all frames are.

use std::io::BufWriter;

use cager_geometry::mesh::Polygons;
use cager_geometry::units::Change;

use super::output::{Announced, FrameOptions, FrameWriter, check_precision, extend_changed};
use super::scene::name;
use crate::atomic::{AtomicDir, Target};
use crate::error::{Error, Fault};
use crate::faces::check_face;
use crate::vat::{self, Scene, Textures};

/// Bytes that frames may have, which are all in memory.
const MOST_BYTES: usize = 1 << 30;
/// How the names of the files end.
const ENDINGS: [&str; 4] = [".glb", "_vat.png", "_vnrm.png", "-remap_info.json"];

pub(super) struct TextureWriter {
    announced: Announced,
    folder: AtomicDir,
    scene: Scene,
    /// To metres with Y up.
    change: Change,
    frames: Vec<f32>,
    notes: Vec<String>,
}

impl TextureWriter {
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
        check(&announced, faces).map_err(|fault| fault.at(path))?;
        let step = options.even_step();
        let note = step
            .is_none()
            .then(|| format!("{}: its frames are played at even times, as images have no others", path.display()));
        let change = options.change_to_metres();
        let scene = Scene {
            name: name(path),
            triangles: faces.triangulated(),
            fps: options.fps / step.unwrap_or(1.0),
            origin: change.apply(options.origin.unwrap_or_default()),
        };
        let is_own = |name: &str| ENDINGS.iter().any(|ending| name.ends_with(ending));
        let folder = AtomicDir::create(path, |name| target.replaces() && is_own(name))?;
        Ok(Self { announced, folder, scene, change, frames: Vec::new(), notes: note.into_iter().collect() })
    }

    /// Writes the files, once all frames are there.
    fn write(&mut self) -> Result<(), Error> {
        let path = &self.announced.path;
        let textures =
            Textures::of(&self.frames, self.announced.points, &self.scene).map_err(|fault| fault.at(path))?;
        let create = |name: &str| Ok(BufWriter::with_capacity(1 << 16, self.folder.create_file(name)?));
        textures.write(create).map_err(|cause| Error::write(path, cause))?;
        self.notes.push(format!(
            "{}: points are within {:.1e} of the frames (16 bits a coordinate)",
            path.display(),
            textures.rounding()
        ));
        Ok(())
    }
}

fn check(announced: &Announced, faces: &Polygons) -> Result<(), Fault> {
    let Announced { points, frames, .. } = *announced;
    if frames.saturating_mul(12 * points) > MOST_BYTES {
        return Err(Fault::unsupported(format!(
            "cannot hold {frames} frames of {points} points as images, which takes more than {} MB; take fewer of them (--range), or write .usdc or .abc",
            MOST_BYTES >> 20
        )));
    }
    vat::check(points, frames)?;
    faces.iter().enumerate().try_for_each(|(k, face)| check_face(face, points, || format!("face {k}")))
}

impl FrameWriter for TextureWriter {
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
        self.folder.commit()
    }
}
