//! One frame as one mesh file.

use std::io::{BufWriter, Write};

use cager_geometry::mesh::Polygons;

use super::mesh::FrameMesh;
use super::output::{Announced, FrameOptions, Output};
use crate::atomic::{AtomicFile, Target};
use crate::error::{Error, Fault};
use crate::mesh::MeshFormat;

pub(super) struct SingleWriter {
    file: AtomicFile,
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
                "holds one mesh, and there are {} frames; take one of them (--frame K), or name a folder for all, such as {} or '{}'",
                announced.frames,
                name.join("").display(),
                name.join(format!("*.{}", if format == MeshFormat::Ply { "ply" } else { "obj" })).display()
            ))
            .at(&announced.path));
        }
        let mesh = FrameMesh::new(format, announced, faces, options)?;
        Ok(Self { file: AtomicFile::create(target)?, mesh })
    }
}

impl Output for SingleWriter {
    fn write(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error> {
        let mut out = BufWriter::with_capacity(1 << 16, &mut self.file);
        self.mesh.write(&mut out, positions, &announced.path)?;
        out.flush().map_err(|cause| Error::write(&announced.path, cause))
    }

    fn finish(self: Box<Self>, _: &Announced) -> Result<(), Error> {
        self.file.commit()
    }
}
