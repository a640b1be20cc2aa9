//! Models to mesh files.

use std::io::{self, Write};
use std::path::Path;

use cager_geometry::mesh::Model;
use cager_geometry::surface::{Channel, Material};

use super::obj::{ObjText, write_obj_faces};
use super::{MeshFormat, extensions};
use crate::atomic::AtomicFile;
use crate::error::{Error, Fault};
use crate::faces::check_faces;

/// Writes a model to a `.obj`, `.ply` or `.off` file, which appears whole or not at all.
///
/// Text holds every coordinate exactly, in its shortest form. `.ply` is binary little-endian,
/// `float` where that holds all coordinates exactly and `double` otherwise.
///
/// # Errors
/// [`Error::Unsupported`] for other formats, [`Error::Invalid`] for a model that could not be read
/// back, [`Error::Target`] and [`Error::Io`] where the file cannot be created.
pub fn write_model(path: &Path, model: &Model) -> Result<(), Error> {
    let bytes = model_bytes(path, model)?;
    let mut file = AtomicFile::create(path)?;
    file.write_all(&bytes).map_err(|cause| Error::write(path, cause))?;
    file.commit()
}

/// A model as the bytes of a mesh file of this name.
///
/// # Errors
/// A name of no format that is written; a model with NaN, infinities or faces without points.
pub fn model_bytes(path: &Path, model: &Model) -> Result<Vec<u8>, Error> {
    let Some(format @ (MeshFormat::Obj | MeshFormat::Ply | MeshFormat::Off)) = MeshFormat::guess(path) else {
        let written = extensions(&[MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Off]);
        let what = format!("is not of a mesh format that is written; end its name in one of {written}");
        return Err(Fault::unsupported(what).at(path));
    };
    check(model).map_err(|fault| fault.at(path))?;
    let mut bytes = Vec::new();
    let written = match format {
        MeshFormat::Ply => write_ply(&mut bytes, model),
        MeshFormat::Off => write_off(&mut bytes, model),
        _ => write_obj(&mut bytes, model),
    };
    written.map_err(|cause| Error::write(path, cause))?;
    Ok(bytes)
}

fn check(model: &Model) -> Result<(), Fault> {
    if model.points.is_empty() {
        return Err(Fault::invalid("the model to write has no points; give it some"));
    }
    let finite = |point: &[f64; 3]| point.iter().all(|x| x.is_finite());
    if let Some(k) = model.points.iter().position(|point| !finite(point)) {
        return Err(Fault::invalid(format!(
            "vertex {k} has a coordinate that is NaN or infinite; repair the model before writing it"
        )));
    }
    check_faces(&model.faces, model.points.len(), "")
}

/// A model as the bytes of an OBJ file, with every coordinate exact.
pub fn obj_bytes(model: &Model) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory cannot fail.
    let _ = write_obj(&mut bytes, model);
    bytes
}

fn write_obj<W: Write>(out: &mut W, model: &Model) -> io::Result<()> {
    let vertex = |out: &mut W, k: usize| {
        let [x, y, z] = model.points[k];
        match model.colors.get(k) {
            Some(color) => {
                let [red, green, blue] = color.map(|x| f64::from(x) / 255.0);
                writeln!(out, "v {x:?} {y:?} {z:?} {red:.4} {green:.4} {blue:.4}")
            }
            None => writeln!(out, "v {x:?} {y:?} {z:?}"),
        }
    };
    if model.surface.is_empty() {
        (0..model.points.len()).try_for_each(|k| vertex(out, k))?;
        return write_obj_faces(out, &model.faces);
    }
    ObjText::new(&model.faces, &model.surface, None).write(out, vertex, |k| model.points[k])
}

pub(crate) fn write_off(out: &mut impl Write, model: &Model) -> io::Result<()> {
    writeln!(out, "OFF\n{} {} 0", model.points.len(), model.faces.len())?;
    for [x, y, z] in &model.points {
        writeln!(out, "{x:?} {y:?} {z:?}")?;
    }
    for face in model.faces.iter() {
        write!(out, "{}", face.len())?;
        for index in face {
            write!(out, " {index}")?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

/// A binary STL file, with normals of 0, which tell readers to compute them.
pub(crate) fn write_stl(out: &mut impl Write, model: &Model) -> io::Result<()> {
    let triangles = model.triangles();
    let count = u32::try_from(triangles.len()).map_err(|_| io::ErrorKind::FileTooLarge)?;
    // Beginning with a blank: with `solid` it would look like text.
    out.write_all(&[b' '; 80])?;
    out.write_all(&count.to_le_bytes())?;
    for triangle in &triangles {
        out.write_all(&[0; 12])?;
        for &x in triangle.map(|index| model.points[index as usize]).as_flattened() {
            out.write_all(&(x as f32).to_le_bytes())?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

/// A binary little-endian PLY file.
pub(crate) fn write_ply(out: &mut impl Write, model: &Model) -> io::Result<()> {
    let coordinates = model.points.as_flattened();
    let single = coordinates.iter().all(|&x| f64::from(x as f32).to_bits() == x.to_bits());
    let scalar = if single { "float" } else { "double" };
    let texture = PlyTexture::of(model);
    out.write_all(b"ply\nformat binary_little_endian 1.0\n")?;
    texture.pictures.iter().try_for_each(|path| writeln!(out, "comment TextureFile {path}"))?;
    write!(
        out,
        "element vertex {}\n\
         property {scalar} x\nproperty {scalar} y\nproperty {scalar} z\n",
        model.points.len()
    )?;
    let largest = model.faces.arities().iter().max().copied();
    // Most readers expect `uchar` and `int`; the wider types are for what does not fit.
    let small_faces = largest.is_none_or(|corners| corners <= 255);
    let small_lists = largest.is_none_or(|corners| corners <= 127);
    if largest.is_some() {
        write!(
            out,
            "element face {}\nproperty list {} {} vertex_indices\n",
            model.faces.len(),
            if small_faces { "uchar" } else { "uint" },
            if i32::try_from(model.points.len()).is_ok() { "int" } else { "uint" },
        )?;
        if !texture.corners.is_empty() {
            writeln!(out, "property list {} float texcoord", if small_lists { "uchar" } else { "uint" })?;
        }
        if texture.is_numbered() {
            writeln!(out, "property int texnumber")?;
        }
    }
    out.write_all(b"end_header\n")?;
    for &x in coordinates {
        if single {
            out.write_all(&(x as f32).to_le_bytes())?;
        } else {
            out.write_all(&x.to_le_bytes())?;
        }
    }
    let length = |out: &mut _, is_small: bool, count: usize| {
        if is_small {
            Write::write_all(out, &[count as u8])
        } else {
            Write::write_all(out, &(count as u32).to_le_bytes())
        }
    };
    let mut corners = texture.corners.iter();
    for (k, face) in model.faces.iter().enumerate() {
        length(out, small_faces, face.len())?;
        for index in face {
            out.write_all(&index.to_le_bytes())?;
        }
        if !texture.corners.is_empty() {
            length(out, small_lists, 2 * face.len())?;
            for uv in corners.by_ref().take(face.len()).flatten() {
                out.write_all(&uv.to_le_bytes())?;
            }
        }
        if texture.is_numbered() {
            out.write_all(&texture.faces.get(k).copied().unwrap_or(-1).to_le_bytes())?;
        }
    }
    Ok(())
}

/// What a PLY file says of texture: the first coordinates of each corner, and the pictures of faces.
#[derive(Default)]
struct PlyTexture {
    corners: Vec<[f32; 2]>,
    pictures: Vec<String>,
    /// Its number, −1 for none.
    faces: Vec<i32>,
}

impl PlyTexture {
    /// Whether faces say which picture they have.
    fn is_numbered(&self) -> bool {
        self.pictures.len() > 1 || !self.pictures.is_empty() && self.faces.contains(&-1)
    }

    fn of(model: &Model) -> Self {
        let (mut texture, surface) = (Self::default(), &model.surface);
        if surface.parts.iter().all(|part| part.uv_sets.is_empty()) {
            return texture;
        }
        let base = |material: &Material| {
            let found = material.textures.iter().find(|found| found.channel == Channel::BaseColor)?;
            Some(found.path.replace(char::is_control, "_"))
        };
        let of_materials: Vec<Option<String>> = surface.materials.iter().map(base).collect();
        texture.pictures = of_materials.iter().flatten().cloned().collect();
        texture.pictures.dedup();
        let number = |material: Option<&u32>| {
            let path = of_materials.get(*material? as usize)?.as_ref()?;
            texture.pictures.iter().position(|found| found == path)
        };
        for (part, range) in surface.ranges(&model.faces) {
            let uv = |k: usize| part.uv_sets.first().and_then(|set| set.values.get(*set.corners.get(k)? as usize));
            texture.corners.extend((0..range.corners.len()).map(|k| uv(k).copied().unwrap_or_default()));
            texture
                .faces
                .extend((0..part.faces).map(|k| number(part.materials.get(k)).map_or(-1, |number| number as i32)));
        }
        texture
    }
}
