//! What lies on the faces of a mesh: primvars, normals, creases and the scheme of subdivision.

use std::collections::HashSet;

use cager_geometry::surface::{Crease, Subdivision};

use super::layer::Layer;
use super::materials::Materials;
use super::unread::kind;
use crate::error::Fault;
use crate::scene::{MeshTracks, creases, damaged, merged, most_corners};

/// Names of texture coordinates that come before others, as programs call the first ones.
const FIRST_UVS: [&str; 4] = ["primvars:st", "primvars:UVMap", "primvars:map1", "primvars:uv"];

/// The faces of a mesh in its first frame, in the order of the file.
pub(super) struct Faces {
    points: usize,
    pub(super) arities: Vec<i32>,
    corners: Vec<u32>,
}

impl Faces {
    fn read(layer: &mut Layer<'_>, prim: usize) -> Result<Self, Fault> {
        let points = match layer.first(prim, "points")? {
            Some(points) => layer.source.points(points)?.count,
            None => 0,
        };
        let mut integers = |name| layer.integers(prim, name, most_corners(points));
        let (arities, corners) = (integers("faceVertexCounts")?, integers("faceVertexIndices")?);
        let corners = corners.into_iter().map(|corner| corner as u32).collect();
        Ok(Self { points, arities, corners })
    }

    /// The most values that anything on them may have.
    pub(super) fn most(&self) -> u64 {
        most_corners(self.points)
    }

    /// Which element each corner has, of those that belong to corners, points, faces or the mesh.
    fn elements(&self, interpolation: &str) -> Result<Vec<u32>, Fault> {
        let count = self.corners.len();
        Ok(match interpolation {
            "faceVarying" => (0..count as u32).collect(),
            "vertex" | "varying" => self.corners.clone(),
            "uniform" => {
                let of_face = |(face, &arity): (u32, &i32)| std::iter::repeat_n(face, arity.max(0) as usize);
                (0..).zip(&self.arities).flat_map(of_face).take(count).collect()
            }
            "constant" => vec![0; count],
            _ => return Err(damaged("it has values that belong to nothing that is known")),
        })
    }
}

/// Reads what is known of the faces of a mesh; gives the names of the properties that it has.
pub(super) fn read(
    layer: &mut Layer<'_>,
    prim: usize,
    materials: &mut Materials,
    mesh: &mut MeshTracks,
) -> Result<HashSet<String>, Fault> {
    let faces = Faces::read(layer, prim)?;
    let part = &mut mesh.part;
    let mut properties = layer.source.properties(prim);
    properties.sort_by_key(|(name, _)| FIRST_UVS.iter().position(|first| first == name).unwrap_or(FIRST_UVS.len()));
    let mut found = HashSet::new();
    for (name, type_name) in &properties {
        let plain = || name.trim_start_matches("primvars:").to_owned();
        // What cannot be read of them is told as not kept.
        let is_read = match kind(name, type_name) {
            Some("texture coordinates") => {
                let set = read_set(layer, (prim, name), &faces);
                set.map(|(values, corners)| part.uv_sets.push(merged(plain(), &values, corners))).is_ok()
            }
            Some("colours") => {
                let set = read_colors(layer, (prim, name), &faces);
                set.map(|(values, corners)| part.color_sets.push(merged(plain(), &values, corners))).is_ok()
            }
            _ => false,
        };
        if is_read {
            found.insert(name.clone());
        }
    }
    let has = |name: &str| properties.iter().any(|(found, _)| found == name);
    let normals = ["primvars:normals", "normals"].into_iter().find(|name| has(name));
    let scheme = layer.tokens(prim, "subdivisionScheme", 1)?.map(|scheme| scheme.concat());
    part.subdivision = match scheme.as_deref() {
        Some("loop") => Subdivision::Loop,
        Some("bilinear") => Subdivision::Bilinear,
        Some("none") => Subdivision::None,
        // What has normals and does not say it is no control mesh, whatever the usual scheme is.
        None if normals.is_some() => Subdivision::None,
        _ => Subdivision::CatmullClark,
    };
    if let Some(name) = normals {
        // Of a subdivision surface they say nothing.
        let is_flat = part.subdivision == Subdivision::None;
        let read = if is_flat { read_normals(layer, (prim, name), &faces).ok() } else { Some(Vec::new()) };
        if let Some(read) = read {
            mesh.normals = read;
            found.extend(["primvars:normals", "normals"].map(str::to_owned));
        }
    }
    if let Ok(creases) = read_creases(layer, prim, &faces) {
        part.creases = creases;
        found.extend(["creaseIndices", "creaseLengths", "creaseSharpnesses"].map(str::to_owned));
    }
    materials.read(layer, prim, &faces, part)?;
    Ok(found)
}

/// The values of an attribute, and which of them each corner has.
type Values<const N: usize> = (Vec<[f32; N]>, Vec<u32>);

fn read_set<const N: usize>(
    layer: &mut Layer<'_>,
    (prim, name): (usize, &str),
    faces: &Faces,
) -> Result<Values<N>, Fault> {
    let missing = || damaged("an attribute has no value where one belongs");
    let value = layer.first(prim, name)?.ok_or_else(missing)?;
    let values = layer.source.floats(value, N, faces.most())?.as_chunks().0.to_vec();
    let indices = match layer.first(prim, &format!("{name}:indices"))? {
        Some(indices) => Some(layer.source.integers(indices, faces.most())?),
        None => None,
    };
    let told = layer.source.interpolation(prim, name)?;
    let usual = if name == "normals" { "vertex" } else { "constant" };
    layer.source.reserve(faces.corners.len() as u64, 12)?;
    let mut corners = faces.elements(if told.is_empty() { usual } else { &told })?;
    for corner in &mut corners {
        if let Some(indices) = &indices {
            *corner = indices.get(*corner as usize).map_or(u32::MAX, |&index| index as u32);
        }
        if *corner as usize >= values.len() {
            return Err(missing());
        }
    }
    Ok((values, corners))
}

/// Colours with alpha or without.
fn read_colors(layer: &mut Layer<'_>, at: (usize, &str), faces: &Faces) -> Result<Values<4>, Fault> {
    read_set::<4>(layer, at, faces).or_else(|_| {
        let (values, corners) = read_set::<3>(layer, at, faces)?;
        Ok((values.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect(), corners))
    })
}

fn read_normals(layer: &mut Layer<'_>, at: (usize, &str), faces: &Faces) -> Result<Vec<[f32; 3]>, Fault> {
    let (values, corners) = read_set::<3>(layer, at, faces)?;
    layer.source.reserve(corners.len() as u64, 24)?;
    Ok(corners.iter().map(|&corner| values[corner as usize]).collect())
}

fn read_creases(layer: &mut Layer<'_>, prim: usize, faces: &Faces) -> Result<Vec<Crease>, Fault> {
    let mut integers = |name| layer.integers(prim, name, faces.most());
    let (chains, lengths) = (integers("creaseIndices")?, integers("creaseLengths")?);
    let sharpnesses = layer.floats(prim, "creaseSharpnesses", 1, faces.most())?;
    creases(&chains, &lengths, &sharpnesses, faces.points)
}
