//! One frame as one mesh file.

use std::io::{BufWriter, Write};

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::Surface;

use super::mesh::FrameMesh;
use super::output::{Announced, FrameOptions, Output};
use crate::atomic::{AtomicFile, Target, commit_together};
use crate::error::{Error, Fault};
use crate::mesh::MeshFormat;

pub(super) struct SingleWriter {
    file: AtomicFile,
    /// The materials, beside it.
    library: Option<AtomicFile>,
    mesh: FrameMesh,
}

impl SingleWriter {
    pub(super) fn create(
        announced: &Announced,
        target: &Target,
        format: MeshFormat,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        if announced.frames > 1 {
            let name = announced.path.with_extension("");
            return Err(Fault::invalid(format!(
                "holds one mesh, and there are {} frames; take one of them (--frame K), or name a folder for all, such \
                 as {} or '{}'",
                announced.frames,
                name.join("").display(),
                name.join(format!("*.{}", if format == MeshFormat::Ply { "ply" } else { "obj" })).display()
            ))
            .at(&announced.path));
        }
        let beside = target.beside("mtl");
        let name = beside.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mesh = FrameMesh::new(format, announced, faces, options, &name)?;
        let library = match &mesh.library {
            Some((_, text)) => {
                let path = beside.path().to_owned();
                let mut file = AtomicFile::create(beside)?;
                file.write_all(text).map_err(|cause| Error::write(&path, cause))?;
                Some(file)
            }
            None => None,
        };
        Ok(Self { file: AtomicFile::create(target)?, library, mesh })
    }
}

impl Output for SingleWriter {
    fn write(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error> {
        let mut out = BufWriter::with_capacity(1 << 16, &mut self.file);
        self.mesh.write(&mut out, positions, &announced.path)?;
        out.flush().map_err(|cause| Error::write(&announced.path, cause))
    }

    fn keeps_surface(&self) -> bool {
        self.mesh.format == MeshFormat::Obj
    }

    fn lost(&self, surface: &Surface) -> Vec<String> {
        self.mesh.lost(surface)
    }

    fn finish(self: Box<Self>, _: &Announced) -> Result<(), Error> {
        commit_together([self.file].into_iter().chain(self.library).collect())
    }
}
