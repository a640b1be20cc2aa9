//! All frames in an Alembic archive.

use std::path::Path;

use cager_geometry::mesh::Polygons;

use super::output::{Announced, FrameOptions, FrameWriter};
use crate::alembic::{MeshWriter, Numbers, Schedule};
use crate::atomic::{AtomicFile, Target};
use crate::error::{Error, Fault};
use crate::mesh::check_face;

pub(super) struct ArchiveWriter {
    announced: Announced,
    mesh: MeshWriter<AtomicFile>,
}

impl ArchiveWriter {
    pub(super) fn create(
        announced: Announced,
        target: &Target,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let path = &announced.path;
        check(&announced, faces).map_err(|fault| fault.at(path))?;
        let numbers = match options.even_step() {
            Some(step) => Numbers::Even { first: options.number(0), step },
            None => Numbers::Uneven(options.numbers.clone()),
        };
        let schedule = Schedule { fps: options.fps, numbers };
        let file = AtomicFile::create(target)?;
        let mesh = MeshWriter::new(file, &name(path), faces, schedule, options.origin)
            .map_err(|cause| Error::write(path, cause))?;
        Ok(Self { announced, mesh })
    }
}

fn check(announced: &Announced, faces: &Polygons) -> Result<(), Fault> {
    let most = i32::MAX as usize;
    if announced.points > most || announced.frames > most || faces.indices().len() > most {
        let what = format!("cannot count more than {most} frames, points or corners; write .npy instead");
        return Err(Fault::unsupported(what));
    }
    faces.iter().enumerate().try_for_each(|(k, face)| check_face(face, announced.points, || format!("face {k}")))
}

/// The name of the mesh: that of the file, with `_` for what names in Maya cannot have.
fn name(path: &Path) -> String {
    const MOST: usize = 64;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let plain = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).take(MOST);
    let name: String = plain.collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("mesh_{name}") }
}

impl FrameWriter for ArchiveWriter {
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        self.mesh.write_frame(positions).map_err(|cause| Error::write(&self.announced.path, cause))?;
        self.announced.written += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.announced.check_complete()?;
        self.mesh.finish().map_err(|cause| Error::write(&self.announced.path, cause))?.commit()
    }
}
