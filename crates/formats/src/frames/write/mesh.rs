//! The meshes of frames: the same faces, and other points in each.

use std::fmt::Debug;
use std::io::{self, Write};
use std::path::Path;

use cager_geometry::mesh::{Model, Point, Polygons};
use cager_geometry::vector::add;

use super::output::{Announced, FrameOptions, check_precision};
use crate::error::{Error, Fault};
use crate::mesh::{MeshFormat, write_obj_faces, write_off, write_ply, write_stl};

/// A mesh format that frames are written in, with what is the same in all of them.
pub(super) struct FrameMesh {
    form: Form,
    /// What is added to all positions, in double precision.
    origin: Option<Point>,
}

enum Form {
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
    pub(super) fn new(
        format: MeshFormat,
        announced: &Announced,
        faces: &Polygons,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
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
            return Ok(Self { form: Form::Obj(text), origin: options.origin });
        }
        if format == MeshFormat::Stl && faces.is_empty() {
            let what = "cannot be .stl, which holds triangles alone, and there are only points; write .ply instead";
            return Err(Fault::unsupported(what).at(path));
        }
        if format == MeshFormat::Stl {
            check_precision(options, path)?;
        }
        let model = Model { points: Vec::new(), faces: faces.clone(), ..Model::default() };
        Ok(Self { form: Form::Other(format, model), origin: options.origin })
    }

    /// What it is written as.
    pub(super) fn format(&self) -> MeshFormat {
        match self.form {
            Form::Obj(_) => MeshFormat::Obj,
            Form::Other(format, _) => format,
        }
    }

    /// Writes the mesh of a frame.
    pub(super) fn write(&mut self, out: &mut impl Write, positions: &[f32], path: &Path) -> Result<(), Error> {
        self.write_points(out, positions).map_err(|cause| Error::write(path, cause))
    }

    fn write_points(&mut self, out: &mut impl Write, positions: &[f32]) -> io::Result<()> {
        let (points, origin) = (positions.as_chunks().0, self.origin);
        let place = |p: &[f32; 3]| origin.map_or(p.map(f64::from), |origin| add(p.map(f64::from), origin));
        match &mut self.form {
            Form::Obj(faces) => {
                for point in points {
                    match origin {
                        Some(_) => write_vertex(out, &place(point))?,
                        None => write_vertex(out, point)?,
                    }
                }
                out.write_all(faces)
            }
            Form::Other(format, model) => {
                model.points.clear();
                model.points.extend(points.iter().map(place));
                match format {
                    MeshFormat::Off => write_off(out, model),
                    MeshFormat::Stl => write_stl(out, model),
                    _ => write_ply(out, model),
                }
            }
        }
    }
}

fn write_vertex(out: &mut impl Write, [x, y, z]: &[impl Debug; 3]) -> io::Result<()> {
    writeln!(out, "v {x:?} {y:?} {z:?}")
}
