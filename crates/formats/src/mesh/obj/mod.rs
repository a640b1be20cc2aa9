//! Wavefront OBJ: points, faces and what lies on these, without faces that are edges or points.

mod mtl;
mod surface;
mod write;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use cager_geometry::mesh::Model;
use cager_geometry::surface::Material;

pub(crate) use mtl::materials_text;
use surface::{SurfaceLines, name_of_library};
pub(crate) use write::{ObjText, write_obj_faces};

use super::MeshFormat;
use super::parsed::Parsed;
use super::unread::Unread;
use crate::colors::{Colors, Scale};
use crate::error::Fault;
use crate::faces::{Contents, no_such_vertex};
use crate::text::{self, Lines, damaged, integer, point, quoted, words};

/// Bytes of a file of materials.
const LARGEST_LIBRARY: u64 = 64 << 20;
/// Bytes before the first point in which files of materials are looked for.
const LONGEST_HEAD: u64 = 64 << 10;

pub(super) fn read(bytes: &[u8], contents: Contents) -> Result<Parsed, Fault> {
    let parsed = scan(bytes, contents, None)?;
    let points = parsed.model.points.len();
    let named = parsed.model.faces.indices().iter().max();
    if named.is_some_and(|&index| index as usize >= points) {
        // Faces may come before their vertices, whose number is known only now.
        return scan(bytes, contents, Some(points));
    }
    Ok(parsed)
}

/// One pass over the file; with `points`, stops at the first face that names a later vertex.
fn scan(bytes: &[u8], contents: Contents, points: Option<usize>) -> Result<Parsed, Fault> {
    let (mut model, mut colors, mut left_out) = (Model::default(), Colors::default(), 0);
    let (mut face, mut unread, mut on_faces) = (Vec::new(), Unread::default(), SurfaceLines::default());
    let mut colored = 0;
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        let number = lines.number();
        let keyword = words(line).next().unwrap_or_default();
        let is_vertex = keyword == b"v";
        if !is_vertex && contents == Contents::Points {
            continue;
        }
        // `fo` is what faces were called at first.
        if !is_vertex && keyword != b"f" && keyword != b"fo" {
            if keyword == b"vn" && model.faces.is_empty() {
                model.normals.extend(point(&mut words(&line[keyword.len()..]), String::new).ok());
            }
            if !on_faces.take(keyword, line[keyword.len()..].trim_ascii(), model.points.len()) {
                unread.note(keyword, line);
            }
            continue;
        }
        let joined;
        let line = if line.ends_with(b"\\") {
            joined = join(line, &mut lines);
            joined.as_slice()
        } else {
            line
        };
        let mut words = words(&line[keyword.len()..]).take_while(|word| word[0] != b'#');
        if is_vertex {
            let point = point(&mut words, || format!("line {number}"))?;
            model.points.push(point);
            // Written after the position by many programs, outside of the specification.
            if contents == Contents::PointsAndFaces
                && let [Some(red), Some(green), Some(blue), None] = [(); 4].map(|()| words.next().map(text::number))
                && let (Some(red), Some(green), Some(blue)) = (red, green, blue)
            {
                colored += 1;
                colors.push([red, green, blue].map(|x| x as f32));
            }
        } else {
            face.clear();
            for word in words {
                face.push(corner(word, model.points.len(), points, number)?);
                on_faces.corner(word);
            }
            on_faces.face(face.len(), face.len() >= 3);
            if face.len() >= 3 {
                model.faces.push(&face);
            } else if lines.is_cut() {
                return Err(damaged(number, &format!("the face has {} corners", face.len())));
            } else {
                left_out += 1;
            }
        }
    }
    if model.normals.len() != model.points.len() {
        model.normals.clear();
    }
    model.colors = colors.finish(model.points.len(), Scale::Unsaid);
    let libraries = std::mem::take(&mut on_faces.libraries);
    on_faces.finish(&mut model);
    let mut parsed = Parsed { left_out, libraries, ..model.into() };
    if colored > 0 && parsed.model.colors.is_empty() {
        parsed.dropped.add("vertex colours, which not all points have");
    }
    unread.tell(&mut parsed);
    Ok(parsed)
}

/// A line and those that continue it after a backslash.
fn join(line: &[u8], lines: &mut Lines<'_>) -> Vec<u8> {
    let mut joined = line.to_vec();
    while joined.last() == Some(&b'\\') {
        joined.pop();
        joined.push(b' ');
        joined.extend_from_slice(lines.next().unwrap_or_default());
    }
    joined
}

/// The vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative numbers count back.
fn corner(word: &[u8], before: usize, points: Option<usize>, line: usize) -> Result<u32, Fault> {
    let digits = word.split(|&b| b == b'/').next().unwrap_or(word);
    let Some(index) = integer::<i64>(digits) else {
        return Err(damaged(line, &format!("{} is not a vertex number; export the mesh again", quoted(word))));
    };
    let from_zero = if index < 0 { before as i64 + index } else { index - 1 };
    let exists = from_zero >= 0 && points.is_none_or(|points| from_zero < points as i64);
    if !exists {
        return Err(no_such_vertex(&format!("line {line}"), index, points.unwrap_or(before)));
    }
    // No file has as many points, so that the check at the end finds this one.
    Ok(u32::try_from(from_zero).unwrap_or(u32::MAX))
}

/// The files of materials that an OBJ file names before its first point; none of other files.
pub(crate) fn libraries_of(path: &Path) -> Vec<PathBuf> {
    let (mut head, is_obj) = (Vec::new(), MeshFormat::guess(path) == Some(MeshFormat::Obj));
    let read = |file: File| file.take(LONGEST_HEAD).read_to_end(&mut head).ok();
    if !is_obj || File::open(path).ok().and_then(read).is_none() {
        return Vec::new();
    }
    let lines = Lines::new(&head).take_while(|line| !line.starts_with(b"v "));
    let names = lines.filter_map(|line| line.strip_prefix(b"mtllib "));
    names.map(|name| library(path, &name_of_library(name.trim_ascii()))).collect()
}

fn library(path: &Path, name: &str) -> PathBuf {
    path.with_file_name("").join(name)
}

/// The materials of a file; none of one that cannot be read.
pub(crate) fn materials_of(library: &Path) -> Vec<Material> {
    let is_small = library.metadata().is_ok_and(|found| found.is_file() && found.len() <= LARGEST_LIBRARY);
    is_small.then(|| std::fs::read(library).ok()).flatten().map_or_else(Vec::new, |bytes| mtl::read(&bytes))
}

/// Fills in the materials of a model from the files beside it that it names; what cannot be read is left as it is.
pub(super) fn read_materials(parsed: &mut Parsed, path: &Path) {
    for name in &parsed.libraries {
        for found in materials_of(&library(path, name)) {
            if let Some(material) = parsed.model.surface.materials.iter_mut().find(|m| m.name == found.name) {
                *material = found;
            }
        }
    }
}
