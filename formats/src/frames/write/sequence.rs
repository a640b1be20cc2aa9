//! Each frame in an OBJ file of its own.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use cager_core::mesh::Polygons;

use super::{Announced, FrameWriter};
use crate::atomic::AtomicDir;
use crate::error::{Error, Fault};
use crate::mesh::write_obj_faces;

pub(super) struct SequenceWriter {
    announced: Announced,
    folder: AtomicDir,
    /// The `f` lines, which are the same in all files.
    faces: Vec<u8>,
    digits: usize,
}

impl SequenceWriter {
    pub(super) fn create(announced: Announced, faces: &Polygons) -> Result<Self, Error> {
        if let Some(&index) = faces.indices().iter().find(|&&index| index as usize >= announced.points) {
            return Err(Fault::invalid(format!(
                "the faces to write name vertex {index}, but there are {} points; give the faces of this mesh",
                announced.points
            ))
            .at(&announced.path));
        }
        let folder = AtomicDir::create(&announced.path)?;
        let mut text = Vec::new();
        write_obj_faces(&mut text, faces.iter()).map_err(|cause| Error::write(&announced.path, cause))?;
        let digits = (announced.frames - 1).to_string().len().max(4);
        Ok(Self { announced, folder, faces: text, digits })
    }

    fn write_obj(&self, name: &str, positions: &[f32]) -> io::Result<()> {
        let mut file = BufWriter::with_capacity(1 << 16, File::create(self.folder.folder().join(name))?);
        for [x, y, z] in positions.as_chunks().0 {
            writeln!(file, "v {x:?} {y:?} {z:?}")?;
        }
        file.write_all(&self.faces)?;
        file.flush()
    }
}

impl FrameWriter for SequenceWriter {
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        let name = format!("frame_{:0digits$}.obj", self.announced.written, digits = self.digits);
        self.write_obj(&name, positions).map_err(|cause| Error::write(&self.announced.path.join(&name), cause))?;
        self.announced.written += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.announced.check_complete()?;
        self.folder.commit()
    }
}
