//! OBJ files of a mesh that moves: what lies on the faces is the same text in all of them.

use std::io::{self, Write};
use std::ops::Range;

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::{NO_MATERIAL, Part, SharedNormals, Surface};

use super::mtl::{names, one_line};

/// The `f` lines of faces without anything on them.
pub(crate) fn write_obj_faces(out: &mut impl Write, faces: &Polygons) -> io::Result<()> {
    for face in faces.iter() {
        out.write_all(b"f")?;
        for &index in face {
            write!(out, " {}", u64::from(index) + 1)?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

/// Everything but the points and their normals.
pub(crate) struct ObjText {
    /// Before the first part.
    head: Vec<u8>,
    parts: Vec<PartText>,
}

struct PartText {
    head: Vec<u8>,
    points: Range<usize>,
    normals: Option<SharedNormals>,
    tail: Vec<u8>,
}

impl ObjText {
    /// Of faces with what lies on them; `library` is the file of the materials.
    pub(crate) fn new(faces: &Polygons, surface: &Surface, library: Option<&str>) -> Self {
        let head = library.map_or_else(Vec::new, library_line);
        let names = names(&surface.materials);
        let (mut uvs, mut normals) = (0, 0);
        let parts = surface.ranges(faces).map(|(part, range)| {
            let local = range.local(faces);
            let name = part.path.rsplit('/').next().unwrap_or_default();
            let head = if name.is_empty() { String::new() } else { format!("o {}\n", one_line(name)) };
            let shared = (!part.normals.is_empty()).then(|| SharedNormals::of(part, local.clone()));
            let mut tail = Vec::new();
            let bases = [range.points.start, uvs, normals];
            write_faces(&mut tail, &local, (part, shared.as_ref()), &names, bases);
            uvs += part.uv_sets.first().map_or(0, |set| set.values.len());
            normals += shared.as_ref().map_or(0, |shared| shared.count);
            PartText { head: head.into_bytes(), points: range.points, normals: shared, tail }
        });
        let parts = parts.collect();
        Self { head, parts }
    }

    /// Names another file of the materials.
    pub(crate) fn name_library(&mut self, library: &str) {
        self.head = library_line(library);
    }

    /// Writes a frame; `vertex` writes the line of a point, and `point` is where it is.
    pub(crate) fn write<W: Write>(
        &self,
        out: &mut W,
        mut vertex: impl FnMut(&mut W, usize) -> io::Result<()>,
        point: impl Fn(usize) -> Point,
    ) -> io::Result<()> {
        out.write_all(&self.head)?;
        for part in &self.parts {
            out.write_all(&part.head)?;
            part.points.clone().try_for_each(|k| vertex(out, k))?;
            if let Some(normals) = &part.normals {
                for [x, y, z] in normals.at(|k| point(part.points.start + k as usize)) {
                    writeln!(out, "vn {x:.5} {y:.5} {z:.5}")?;
                }
            }
            out.write_all(&part.tail)?;
        }
        Ok(())
    }
}

fn library_line(library: &str) -> Vec<u8> {
    format!("mtllib {}\n", one_line(library)).into_bytes()
}

/// The `vt`, `g`, `usemtl` and `f` lines of a part.
fn write_faces(
    out: &mut Vec<u8>,
    faces: &Polygons,
    (part, normals): (&Part, Option<&SharedNormals>),
    materials: &[String],
    [point, uv, normal]: [usize; 3],
) {
    let set = part.uv_sets.first();
    let mut line = |text: String| out.extend(text.into_bytes());
    for [u, v] in set.iter().flat_map(|set| &set.values) {
        line(format!("vt {u:?} {v:?}\n"));
    }
    let mut groups: Vec<Vec<&str>> = vec![Vec::new(); if part.groups.is_empty() { 0 } else { part.faces }];
    for group in &part.groups {
        group.faces.iter().for_each(|&face| groups[face as usize].push(&group.name));
    }
    let (mut material, mut group) = (NO_MATERIAL, &Vec::new());
    let mut corner = 0;
    for (k, face) in faces.iter().enumerate() {
        if let Some(names) = groups.get(k).filter(|names| *names != group) {
            group = names;
            let names: Vec<String> = names.iter().map(|name| one_line(name).replace(' ', "_")).collect();
            line(format!("g {}\n", if names.is_empty() { "default".to_owned() } else { names.join(" ") }));
        }
        let of_face = part.materials.get(k).copied().unwrap_or(NO_MATERIAL);
        if of_face != material {
            material = of_face;
            let name = materials.get(material as usize).map_or("None", String::as_str);
            line(format!("usemtl {name}\n"));
        }
        line("f".to_owned());
        for &index in face {
            let v = point + index as usize + 1;
            let t = set.map(|set| uv + set.corners[corner] as usize + 1);
            let n = normals.map(|normals| normal + normals.corners[corner] as usize + 1);
            line(match (t, n) {
                (None, None) => format!(" {v}"),
                (Some(t), None) => format!(" {v}/{t}"),
                (None, Some(n)) => format!(" {v}//{n}"),
                (Some(t), Some(n)) => format!(" {v}/{t}/{n}"),
            });
            corner += 1;
        }
        line("\n".to_owned());
    }
}
