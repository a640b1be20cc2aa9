//! The meshes of frames: the same faces, and other points in each.

use std::io::{self, Write};
use std::path::Path;

use cager_core::mesh::{Model, Polygons};

use super::Announced;
use crate::error::{Error, Fault};
use crate::mesh::{MeshFormat, write_obj_faces, write_off, write_ply, write_stl};

/// A mesh format that frames are written in, with what is the same in all of them.
pub(super) enum FrameMesh {
    /// The `f` lines.
    Obj(Vec<u8>),
    /// The model; its points change.
    Other(MeshFormat, Model),
}

impl FrameMesh {
    /// Formats that one frame can be written in.
    pub(super) const FORMATS: [MeshFormat; 4] = [MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Off, MeshFormat::Stl];

    /// # Errors
    /// Faces without their points; a format that is not written, or cannot hold these faces.
    pub(super) fn new(format: MeshFormat, announced: &Announced, faces: &Polygons) -> Result<Self, Error> {
        let path = &announced.path;
        if let Some(&index) = faces.indices().iter().find(|&&index| index as usize >= announced.points) {
            return Err(Fault::invalid(format!(
                "the faces to write name vertex {index}, but there are {} points; give the faces of this mesh",
                announced.points
            ))
            .at(path));
        }
        if format == MeshFormat::Obj {
            let mut text = Vec::new();
            write_obj_faces(&mut text, faces.iter()).map_err(|cause| Error::write(path, cause))?;
            return Ok(Self::Obj(text));
        }
        if format == MeshFormat::Stl && faces.is_empty() {
            let what = "cannot be .stl, which holds triangles alone, and there are only points; write .ply instead";
            return Err(Fault::unsupported(what).at(path));
        }
        Ok(Self::Other(format, Model { points: Vec::new(), faces: faces.clone(), ..Model::default() }))
    }

    /// Writes the mesh of a frame.
    pub(super) fn write(&mut self, out: &mut impl Write, positions: &[f32], path: &Path) -> Result<(), Error> {
        self.write_points(out, positions).map_err(|cause| Error::write(path, cause))
    }

    fn write_points(&mut self, out: &mut impl Write, positions: &[f32]) -> io::Result<()> {
        let points = positions.as_chunks().0;
        match self {
            Self::Obj(faces) => {
                for [x, y, z] in points {
                    writeln!(out, "v {x:?} {y:?} {z:?}")?;
                }
                out.write_all(faces)
            }
            Self::Other(format, model) => {
                model.points.clear();
                model.points.extend(points.iter().map(|p| p.map(f64::from)));
                match format {
                    MeshFormat::Off => write_off(out, model),
                    MeshFormat::Stl => write_stl(out, model),
                    _ => write_ply(out, model),
                }
            }
        }
    }
}
