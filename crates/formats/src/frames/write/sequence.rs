//! Each frame in a mesh file of its own.

use std::io::{BufWriter, Write};

use cager_geometry::mesh::Polygons;

use super::super::numbered::NumberedNames;
use super::mesh::FrameMesh;
use super::output::{Announced, FrameOptions, FrameWriter};
use crate::atomic::{AtomicDir, Target};
use crate::error::Error;
use crate::mesh::MeshFormat;

pub(super) struct SequenceWriter {
    announced: Announced,
    folder: AtomicDir,
    mesh: FrameMesh,
    names: NumberedNames,
    options: FrameOptions,
}

impl SequenceWriter {
    pub(super) fn create(
        announced: Announced,
        target: &Target,
        faces: &Polygons,
        names: NumberedNames,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let format = if names.extension_is("ply") { MeshFormat::Ply } else { MeshFormat::Obj };
        let mesh = FrameMesh::new(format, &announced, faces, options)?;
        let folder = AtomicDir::create(&announced.path, |name| target.replaces() && names.number(name).is_some())?;
        Ok(Self { announced, folder, mesh, names, options: options.clone() })
    }
}

impl FrameWriter for SequenceWriter {
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        let name = self.names.name(self.options.number(self.announced.written));
        let path = self.announced.path.join(&name);
        let failed = |cause| Error::write(&path, cause);
        let mut file = BufWriter::with_capacity(1 << 16, self.folder.create_file(&name).map_err(failed)?);
        self.mesh.write(&mut file, positions, &path)?;
        file.flush().map_err(failed)?;
        self.announced.written += 1;
        Ok(())
    }

    fn change_mesh(&mut self, points: usize, faces: &Polygons, options: &FrameOptions) -> Result<(), Error> {
        self.announced.points = points;
        self.announced.check(&self.options).map_err(|fault| fault.at(&self.announced.path))?;
        self.mesh = FrameMesh::new(self.mesh.format(), &self.announced, faces, options)?;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.announced.check_complete()?;
        self.folder.commit()
    }
}
