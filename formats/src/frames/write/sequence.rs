//! Each frame in a mesh file of its own.

use std::io::{self, BufWriter, Write};

use cager_core::mesh::{Model, Polygons};

use super::super::numbered::NumberedNames;
use super::{Announced, FrameOptions, FrameWriter};
use crate::atomic::{AtomicDir, Target};
use crate::error::{Error, Fault};
use crate::mesh::{write_obj_faces, write_ply};

pub(super) struct SequenceWriter {
    announced: Announced,
    folder: AtomicDir,
    format: Format,
    names: NumberedNames,
    options: FrameOptions,
}

/// What the files are, with what is the same in all of them.
enum Format {
    /// The `f` lines.
    Obj(Vec<u8>),
    /// The model; its points change.
    Ply(Model),
}

impl SequenceWriter {
    pub(super) fn create(
        announced: Announced,
        target: &Target,
        faces: &Polygons,
        names: NumberedNames,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        if let Some(&index) = faces.indices().iter().find(|&&index| index as usize >= announced.points) {
            return Err(Fault::invalid(format!(
                "the faces to write name vertex {index}, but there are {} points; give the faces of this mesh",
                announced.points
            ))
            .at(&announced.path));
        }
        let folder = AtomicDir::create(&announced.path, |name| target.replaces() && names.number(name).is_some())?;
        let format = if names.extension_is("ply") {
            Format::Ply(Model { points: Vec::new(), faces: faces.clone(), ..Model::default() })
        } else {
            let mut text = Vec::new();
            write_obj_faces(&mut text, faces.iter()).map_err(|cause| Error::write(&announced.path, cause))?;
            Format::Obj(text)
        };
        Ok(Self { announced, folder, format, names, options: options.clone() })
    }

    fn write_file(&mut self, name: &str, positions: &[f32]) -> io::Result<()> {
        let mut file = BufWriter::with_capacity(1 << 16, self.folder.create_file(name)?);
        let points = positions.as_chunks().0;
        match &mut self.format {
            Format::Obj(faces) => {
                for [x, y, z] in points {
                    writeln!(file, "v {x:?} {y:?} {z:?}")?;
                }
                file.write_all(faces)?;
            }
            Format::Ply(model) => {
                model.points.clear();
                model.points.extend(points.iter().map(|p| p.map(f64::from)));
                write_ply(&mut file, model)?;
            }
        }
        file.flush()
    }
}

impl FrameWriter for SequenceWriter {
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        let name = self.names.name(self.options.number(self.announced.written));
        self.write_file(&name, positions).map_err(|cause| Error::write(&self.announced.path.join(&name), cause))?;
        self.announced.written += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.announced.check_complete()?;
        self.folder.commit()
    }
}
