//! Models from and to mesh files.

mod format;
mod obj;
mod off;
mod parsed;
mod ply;
mod stl;
mod unread;
mod write;

use std::fs::{self, File};
use std::io::{Cursor, Read, Seek};
use std::path::Path;

use cager_geometry::mesh::{Model, Polygons};
use cager_geometry::units::Units;

use crate::alembic;
use crate::dropped::Dropped;
use crate::error::{Error, Fault};
use crate::faces::Contents;
use crate::fbx;
use crate::glb;
use crate::scene::Wanted;
use crate::signature::Signature;
use crate::text::{Lines, quoted};
use crate::usd;

pub use format::MeshFormat;
pub(crate) use format::extensions;
pub(crate) use obj::{ObjText, libraries_of, materials_of, materials_text, write_obj_faces};
use parsed::Parsed;
pub use write::{model_bytes, obj_bytes, write_model};
pub(crate) use write::{write_off, write_ply, write_stl};

/// A model from a file, and what is to be known of it.
#[derive(Clone, Debug)]
pub struct ReadModel {
    /// Points in the order of the file, polygons as they are.
    pub model: Model,
    /// The unit and the upward axis of the points, as far as the file says them.
    pub units: Units,
    /// Faces that were left out, in words.
    pub note: Option<String>,
    /// What else the file holds, which is not read.
    pub dropped: Dropped,
}

impl ReadModel {
    fn of(parsed: Parsed, path: &Path) -> Self {
        let Parsed { model, left_out, units, dropped, .. } = parsed;
        let faces = if left_out == 1 { "face" } else { "faces" };
        let note =
            format!("{}: left out {left_out} {faces} of fewer than three corners, which have no area", path.display());
        Self { model, units, note: (left_out > 0).then_some(note), dropped }
    }

    /// What an output loses that keeps no colours of points.
    #[must_use]
    pub fn dropped_with_colors(&self) -> Dropped {
        let mut dropped = self.dropped.clone();
        dropped.add_colors(&self.model);
        dropped
    }

    /// What an output loses that has points and faces alone.
    #[must_use]
    pub fn dropped_with_appearance(&self) -> Dropped {
        let mut dropped = self.dropped_with_colors();
        dropped.add_surface(&self.model.surface);
        dropped
    }
}

/// Reads a model from a file, of a scene all meshes or those that `prims` name by paths, names or
/// globs of these.
///
/// # Errors
/// As [`read_model`]; a name of no mesh.
pub fn read_mesh(path: &Path, prims: &[String]) -> Result<ReadModel, Error> {
    parse_file(path, prims).map(|parsed| ReadModel::of(parsed, path))
}

/// As [`read_mesh`] of a glTF file, with points as often as it stores them, where seams and hard
/// edges split them; `None` of other files.
///
/// # Errors
/// As [`read_mesh`].
pub fn read_split_mesh(path: &Path, prims: &[String]) -> Result<Option<ReadModel>, Error> {
    let format = MeshFormat::from_path(path)?;
    if !matches!(format, MeshFormat::Glb | MeshFormat::Gltf) {
        return Ok(None);
    }
    let bytes = fs::read(path).map_err(|cause| Error::read(path, cause))?;
    Ok(Some(ReadModel::of(read_split(format, path, &bytes, prims)?, path)))
}

/// As [`read_mesh_bytes`], of glTF with points as often as it stores them.
///
/// # Errors
/// As [`read_mesh_bytes`].
pub fn read_split_mesh_bytes(format: MeshFormat, name: &Path, bytes: &[u8]) -> Result<ReadModel, Error> {
    match format {
        MeshFormat::Glb => read_split(format, name, bytes, &[]).map(|parsed| ReadModel::of(parsed, name)),
        _ => read_mesh_bytes(format, name, bytes),
    }
}

fn read_split(format: MeshFormat, path: &Path, bytes: &[u8], prims: &[String]) -> Result<Parsed, Error> {
    let is_text = format == MeshFormat::Gltf;
    let kind = glb::Source { is_text, folder: path.parent().filter(|_| is_text), is_split: true };
    finished(format, path, bytes, glb::read(bytes, &kind, prims).map(Parsed::of_gltf))
}

/// As [`read_model_bytes`], with what is to be known of it.
///
/// # Errors
/// As [`read_model_bytes`].
pub fn read_mesh_bytes(format: MeshFormat, name: &Path, bytes: &[u8]) -> Result<ReadModel, Error> {
    read_bytes(format, name, bytes, Contents::PointsAndFaces, &[]).map(|parsed| ReadModel::of(parsed, name))
}

/// Reads a model from a file, its points in the order of the file and its polygons as they are.
///
/// # Errors
/// As [`read_model_bytes`], and [`Error::Io`] where the file cannot be read.
pub fn read_model(path: &Path) -> Result<Model, Error> {
    parse_file(path, &[]).map(|parsed| parsed.model)
}

/// Reads a model from the bytes of a file; `name` is the path in error messages.
///
/// Coordinates are as exact as `f64` can hold them. A `.glb` gives the triangles and points of its
/// default scene, each node's mesh at its place; a mesh with a skin is where its joints put it at
/// rest.
///
/// # Errors
/// [`Error::Damaged`] where the bytes do not follow the format or end too early,
/// [`Error::Unsupported`] for variants that are not read, [`Error::Invalid`] for a coordinate that
/// is not finite, a face with a vertex that does not exist, and a file without points. Faces of
/// fewer than three corners are left out.
pub fn read_model_bytes(format: MeshFormat, name: &Path, bytes: &[u8]) -> Result<Model, Error> {
    read_bytes(format, name, bytes, Contents::PointsAndFaces, &[]).map(|parsed| parsed.model)
}

/// The faces of a frame and their text: most frames have the same, which are then not parsed again.
#[derive(Default)]
pub(crate) struct FrameFaces {
    pub(crate) faces: Polygons,
    /// From the first face of an `.obj` file on; empty for other formats.
    pub(crate) text: Vec<u8>,
}

/// A frame of a capture: its points, and its faces where nothing is wrong with them, as a frame
/// needs none. They are taken from `known` where they are the same; the caller puts them there
/// again.
pub(crate) fn read_frame_file(path: &Path, known: &mut FrameFaces) -> Result<Model, Error> {
    let (format, bytes) = read_named(path)?;
    if format == MeshFormat::Glb {
        // What is one point at rest may part in a frame, and nothing in these files says which.
        return read_split(format, path, &bytes, &[]).map(|parsed| parsed.model);
    }
    let read = |contents| read_bytes(format, path, &bytes, contents, &[]).map(|parsed| parsed.model);
    if !known.text.is_empty() && bytes.ends_with(&known.text) {
        return Ok(Model { faces: std::mem::take(&mut known.faces), ..read(Contents::Points)? });
    }
    let model = read(Contents::PointsAndFaces).or_else(|_| read(Contents::Points))?;
    let first = bytes.windows(3).position(|start| start == b"\nf ").filter(|_| format == MeshFormat::Obj);
    known.text = first.map_or_else(Vec::new, |first| bytes[first..].to_vec());
    Ok(model)
}

fn read_named(path: &Path) -> Result<(MeshFormat, Vec<u8>), Error> {
    let format = MeshFormat::from_path(path)?;
    Ok((format, fs::read(path).map_err(|cause| Error::read(path, cause))?))
}

fn parse_file(path: &Path, prims: &[String]) -> Result<Parsed, Error> {
    let format = MeshFormat::from_path(path)?;
    if format.is_scene() {
        // Of which all but the first frame is left where it is.
        let read = |cause| Error::read(path, cause);
        let file = File::open(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        return read_scene(format, path, file, length, (prims, path.parent()));
    }
    let (format, bytes) = read_named(path)?;
    let mut parsed = read_bytes(format, path, &bytes, Contents::PointsAndFaces, prims)?;
    obj::read_materials(&mut parsed, path);
    Ok(parsed)
}

fn read_scene(
    format: MeshFormat,
    name: &Path,
    mut source: impl Read + Seek + Send,
    length: u64,
    (prims, folder): (&[String], Option<&Path>),
) -> Result<Parsed, Error> {
    if format == MeshFormat::Gltf {
        let mut bytes = Vec::new();
        source.read_to_end(&mut bytes).map_err(|cause| Error::read(name, cause))?;
        let kind = glb::Source { is_text: true, folder, ..glb::Source::default() };
        return finished(format, name, &bytes, glb::read(&bytes, &kind, prims).map(Parsed::of_gltf));
    }
    let wanted = Wanted { prims, ..Wanted::default() };
    if format == MeshFormat::Fbx {
        let (model, left_out, units, dropped) = fbx::read(name, (source, length), wanted, folder)?;
        return Ok(Parsed { left_out, units, dropped, ..Parsed::from(model) });
    }
    let mut dropped = Dropped::default();
    let opened = if format == MeshFormat::Abc {
        alembic::open(source, length, wanted, Some(&mut dropped))
    } else {
        usd::open(source, length, wanted, folder, Some(&mut dropped))
    };
    let (model, left_out, units) = opened.map_err(|failure| failure.at(name))?.into_model(name)?;
    Ok(Parsed { left_out, units, dropped, ..Parsed::from(model) })
}

fn read_bytes(
    format: MeshFormat,
    name: &Path,
    bytes: &[u8],
    contents: Contents,
    prims: &[String],
) -> Result<Parsed, Error> {
    let parsed = if bytes.is_empty() {
        Err(Fault::damaged("is empty; export the mesh or copy the file again"))
    } else {
        match format {
            MeshFormat::Obj => obj::read(bytes, contents),
            MeshFormat::Ply => ply::read(bytes, contents),
            MeshFormat::Off => off::read(bytes, contents),
            MeshFormat::Stl => stl::read(bytes),
            MeshFormat::Glb => glb::read(bytes, &glb::Source::default(), prims).map(Parsed::of_gltf),
            scene => return read_scene(scene, name, Cursor::new(bytes), bytes.len() as u64, (prims, None)),
        }
    };
    finished(format, name, bytes, parsed)
}

/// What a file gave, unless it has no points or far too many.
fn finished(format: MeshFormat, name: &Path, bytes: &[u8], parsed: Result<Parsed, Fault>) -> Result<Parsed, Error> {
    parsed
        .map_err(|fault| cut_in_last_line(fault, bytes))
        .and_then(|parsed| match parsed.model.points.len() {
            0 => Err(Fault::invalid("has no points; export the mesh with its vertices")),
            n if n > u32::MAX as usize => {
                Err(Fault::unsupported(format!("has {n} points, more than 4294967295; reduce the mesh")))
            }
            _ => Ok(parsed.without_mesh_normals()),
        })
        .map_err(|fault| Signature::other_than(format.extension(), bytes).map_or(fault, Fault::damaged).at(name))
}

/// What is wrong with the last line of a text is that the file was cut, where that line has no end.
fn cut_in_last_line(fault: Fault, bytes: &[u8]) -> Fault {
    let what = match &fault {
        Fault::Damaged(what) => what,
        Fault::Invalid(what) if what.contains("corners") => what,
        _ => return fault,
    };
    if !what.starts_with("line ") || bytes.ends_with(b"\n") || bytes.ends_with(b"\r") {
        return fault;
    }
    let mut lines = Lines::new(bytes);
    let last = lines.by_ref().last().unwrap_or_default();
    let place = format!("line {}", lines.number());
    if !what.starts_with(&format!("{place}:")) {
        return fault;
    }
    Fault::damaged(format!(
        "{place}: the file ends within this line, {}, so it was cut; copy or export it again",
        quoted(last)
    ))
}
