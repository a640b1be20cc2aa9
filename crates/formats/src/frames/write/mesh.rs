//! The meshes of frames: the same faces, and other points in each.

use std::fmt::Debug;
use std::io::{self, Write};
use std::path::Path;

use cager_geometry::mesh::{Model, Point, Polygons};
use cager_geometry::surface::Surface;
use cager_geometry::vector::add;

use super::output::{Announced, FrameOptions, check_precision};
use crate::dropped::phrases_of;
use crate::error::{Error, Fault};
use crate::mesh::{MeshFormat, ObjText, materials_text, write_obj_faces, write_off, write_ply, write_stl};

/// A mesh format that frames are written in, with what is the same in all of them.
pub(super) struct FrameMesh {
    pub(super) format: MeshFormat,
    /// The mesh; its points change.
    model: Model,
    /// The `f` lines of `.obj` without anything on its faces.
    faces: Vec<u8>,
    /// Of `.obj` whose faces have something on them.
    text: Option<ObjText>,
    /// The materials, and the name of their file.
    pub(super) library: Option<(String, Vec<u8>)>,
    /// What is added to all positions, in double precision.
    origin: Option<Point>,
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
        library: &str,
    ) -> Result<Self, Error> {
        let path = &announced.path;
        if let Some(&index) = faces.indices().iter().find(|&&index| index as usize >= announced.points) {
            return Err(Fault::invalid(format!(
                "the faces to write name vertex {index}, but there are {} points; give the faces of this mesh",
                announced.points
            ))
            .at(path));
        }
        let (mut lines, surface) = (Vec::new(), &options.surface);
        let (mut text, mut of_materials) = (None, None);
        match format {
            MeshFormat::Obj if !surface.is_empty() => {
                let has_materials = !surface.materials.is_empty();
                of_materials =
                    has_materials.then(|| (library.to_owned(), materials_text(&surface.materials, 0).into_bytes()));
                text = Some(ObjText::new(faces, surface, has_materials.then_some(library)));
            }
            MeshFormat::Ply => {
                let what = |what| {
                    Fault::invalid(format!("cannot have what lies on the faces ({what}); give that of this mesh"))
                };
                surface.check(announced.points, faces).map_err(|cause| what(cause).at(path))?;
            }
            MeshFormat::Obj => write_obj_faces(&mut lines, faces).map_err(|cause| Error::write(path, cause))?,
            MeshFormat::Stl if faces.is_empty() => {
                let what = "cannot be .stl, which holds triangles alone, and there are only points; write .ply instead";
                return Err(Fault::unsupported(what).at(path));
            }
            MeshFormat::Stl => check_precision(options, path)?,
            _ => {}
        }
        let surface = if format == MeshFormat::Ply { surface.clone() } else { Surface::default() };
        let model = Model { faces: faces.clone(), surface, ..Model::default() };
        Ok(Self { format, model, faces: lines, text, library: of_materials, origin: options.origin })
    }

    /// Names another file of materials in the frames that are written next.
    pub(super) fn name_library(&mut self, library: &str) {
        if let Some(text) = &mut self.text {
            text.name_library(library);
        }
    }

    /// What of a surface has no place.
    pub(super) fn lost(&self, surface: &Surface) -> Vec<String> {
        let mut lost = phrases_of(surface, self.format == MeshFormat::Obj);
        if self.format == MeshFormat::Ply {
            lost.retain(|phrase| phrase != "texture coordinates");
            let sets = lost.iter_mut().filter(|phrase| phrase.ends_with("sets of texture coordinates"));
            sets.for_each(|phrase| phrase.push_str(", but for the first"));
        }
        lost
    }

    /// Writes the mesh of a frame.
    pub(super) fn write(&mut self, out: &mut impl Write, positions: &[f32], path: &Path) -> Result<(), Error> {
        self.write_points(out, positions).map_err(|cause| Error::write(path, cause))
    }

    fn write_points(&mut self, out: &mut impl Write, positions: &[f32]) -> io::Result<()> {
        let (points, origin): (&[[f32; 3]], _) = (positions.as_chunks().0, self.origin);
        let place = |p: &[f32; 3]| origin.map_or(p.map(f64::from), |origin| add(p.map(f64::from), origin));
        if self.format == MeshFormat::Obj {
            let vertex = |out: &mut _, k: usize| match origin {
                Some(_) => write_vertex(out, &place(&points[k])),
                None => write_vertex(out, &points[k]),
            };
            return match &self.text {
                Some(text) => text.write(out, vertex, |k| points[k].map(f64::from)),
                None => {
                    (0..points.len()).try_for_each(|k| vertex(out, k))?;
                    out.write_all(&self.faces)
                }
            };
        }
        self.model.points.clear();
        self.model.points.extend(points.iter().map(place));
        match self.format {
            MeshFormat::Off => write_off(out, &self.model),
            MeshFormat::Stl => write_stl(out, &self.model),
            _ => write_ply(out, &self.model),
        }
    }
}

fn write_vertex(out: &mut impl Write, [x, y, z]: &[impl Debug; 3]) -> io::Result<()> {
    writeln!(out, "v {x:?} {y:?} {z:?}")
}
