//! What lies on the faces of a mesh of an archive.

use std::collections::HashMap;

use cager_geometry::surface::{CornerSet, Crease, FaceGroup, Material, NO_MATERIAL, Part, Subdivision};

use super::mesh::array;
use super::objects::{Archive, Kind as ObjectKind, told};
use super::parameters::Topology;
use super::properties::{F32, I32, Kind, Property, TEXT, U32, find};
use super::unread;
use crate::dropped::{Dropped, listed};
use crate::error::Fault;
use crate::scene::{Values, creases, damaged};

/// Bytes of the name of a scheme of subdivision.
const LONGEST_SCHEME: u64 = 64;

/// The materials of all meshes by their names: archives say no more of them.
#[derive(Default)]
pub(super) struct Materials {
    pub(super) list: Vec<Material>,
    numbers: HashMap<String, u32>,
}

impl Materials {
    fn number(&mut self, name: String) -> u32 {
        *self.numbers.entry(name).or_insert_with_key(|name| {
            self.list.push(Material { name: name.clone(), ..Material::default() });
            self.list.len() as u32 - 1
        })
    }
}

/// Reads what lies on the faces of a mesh, of all of them as they are stored, and the normals of their corners; tells
/// what is not read.
pub(super) fn read(
    archive: &mut Archive<'_>,
    mesh: usize,
    materials: &mut Materials,
    dropped: &mut Dropped,
) -> Result<(Part, Vec<[f32; 3]>), Fault> {
    let properties = archive.schema(mesh, ".geom")?;
    let topology = topology(archive, &properties)?;
    let (mut part, mut directions) = (Part::default(), Vec::new());
    let parameters = archive.within(&properties, ".arbGeomParams")?;
    let own = |name: &str| properties.iter().find(|found| found.name == name.as_bytes());
    if let Some(uv) = own("uv")
        && !read_values(archive, uv, &topology, &mut part)?
    {
        dropped.add_on_faces("texture coordinates (uv)");
    }
    let mut others = Vec::new();
    for parameter in &parameters {
        if !read_values(archive, parameter, &topology, &mut part)? {
            others.push(parameter.name.as_slice());
        }
    }
    if !others.is_empty() {
        dropped.add_on_faces(format!("parameters (arbGeomParams: {})", listed(others)));
    }
    if archive.objects[mesh].kind == ObjectKind::Subdivision {
        part.subdivision = scheme(archive, &properties)?;
        match read_creases(archive, &properties, topology.points) {
            Ok(creases) => part.creases = creases,
            Err(_) => dropped.add("damaged creases"),
        }
    }
    if let Some(normals) = own("N") {
        match archive.parameter::<3>(normals, &topology)? {
            Some(CornerSet { values, corners, .. }) => {
                directions = corners.iter().map(|&k| values[k as usize]).collect();
            }
            None => dropped.add_on_faces("normals (N)"),
        }
    }
    read_sets(archive, mesh, (&mut part, topology.arities.len()), materials)?;
    unread::add(archive, mesh, &properties, dropped)?;
    Ok((part, directions))
}

fn topology(archive: &mut Archive<'_>, properties: &[Property]) -> Result<Topology, Fault> {
    let [corners, arities] = [".faceIndices", ".faceCounts"].map(|name| array(properties, name));
    let [mut corners, arities] = [integers(archive, &corners?)?, integers(archive, &arities?)?];
    let count: u64 = arities.iter().map(|&arity| u64::from(arity)).sum();
    if count > corners.len() as u64 {
        return Err(damaged("its faces have more corners than are there"));
    }
    corners.truncate(count as usize);
    let positions = array(properties, "P")?;
    let first = positions.first(&mut archive.container)?;
    let size = 3 * if positions.number == F32 { 4 } else { 8 };
    let points = (archive.container.sample(first)?.length / size) as usize;
    Ok(Topology { points, corners, arities })
}

fn integers(archive: &mut Archive<'_>, property: &Property) -> Result<Vec<u32>, Fault> {
    let first = property.first(&mut archive.container)?;
    Ok(archive.container.integers(first, u64::MAX)?.into_iter().map(|number| number as u32).collect())
}

/// Adds texture coordinates or colours; gives whether these are such.
fn read_values(
    archive: &mut Archive<'_>,
    parameter: &Property,
    topology: &Topology,
    part: &mut Part,
) -> Result<bool, Fault> {
    let says = |key: &[u8]| told(&parameter.metadata, key);
    if matches!(says(b"interpretation"), Some(b"rgb" | b"rgba")) {
        let opaque = |CornerSet { name, values, corners }: CornerSet<3>| {
            let values = values.into_iter().map(|[red, green, blue]| [red, green, blue, 1.0]).collect();
            CornerSet { name, values, corners }
        };
        let set = match archive.parameter::<4>(parameter, topology)? {
            Some(set) => Some(set),
            None => archive.parameter(parameter, topology)?.map(opaque),
        };
        part.color_sets.extend(set.iter().cloned());
        return Ok(set.is_some());
    }
    if says(b"notUV") == Some(b"1") {
        return Ok(false);
    }
    let set = archive.parameter(parameter, topology)?;
    part.uv_sets.extend(set.iter().cloned());
    Ok(set.is_some())
}

fn scheme(archive: &mut Archive<'_>, properties: &[Property]) -> Result<Subdivision, Fault> {
    let told = find(properties, ".scheme", Kind::Scalar).filter(|told| told.number == TEXT && told.samples > 0);
    let Some(told) = told else { return Ok(Subdivision::CatmullClark) };
    let name = told.small(&mut archive.container, LONGEST_SCHEME)?;
    Ok(match name.strip_suffix(b"\0").unwrap_or(&name) {
        b"loop" => Subdivision::Loop,
        b"bilinear" => Subdivision::Bilinear,
        _ => Subdivision::CatmullClark,
    })
}

fn read_creases(archive: &mut Archive<'_>, properties: &[Property], points: usize) -> Result<Vec<Crease>, Fault> {
    let named = |name, number| {
        find(properties, name, Kind::Array).filter(|found: &&Property| found.number == number && found.samples > 0)
    };
    let (Some(chains), Some(lengths), Some(sharp)) =
        (named(".creaseIndices", I32), named(".creaseLengths", I32), named(".creaseSharpnesses", F32))
    else {
        return Ok(Vec::new());
    };
    let mut integers = |property: &Property| {
        let first = property.first(&mut archive.container)?;
        archive.container.integers(first, u64::MAX)
    };
    let (chains, lengths) = (integers(chains)?, integers(lengths)?);
    let sharp = sharp.first(&mut archive.container)?;
    creases(&chains, &lengths, archive.container.vectors::<1>(sharp)?.as_flattened(), points)
}

/// Reads the sets of so many faces. Those that say that no face is in two are materials; where none
/// says so, as of Blender, those are in which no face is that was in one before.
fn read_sets(
    archive: &mut Archive<'_>,
    mesh: usize,
    (part, faces): (&mut Part, usize),
    materials: &mut Materials,
) -> Result<(), Fault> {
    let mut sets = Vec::new();
    for set in archive.sets(mesh) {
        let properties = archive.schema(set, ".faceset")?;
        let Ok(stored) = array(&properties, ".faces") else { continue };
        let mut stored = integers(archive, &stored)?;
        stored.retain(|&face| (face as usize) < faces);
        let is_exclusive = match find(&properties, ".facesExclusive", Kind::Scalar) {
            Some(told) if told.number == U32 && told.samples > 0 => {
                told.small(&mut archive.container, 4)? == [1, 0, 0, 0]
            }
            _ => false,
        };
        sets.push((String::from_utf8_lossy(&archive.nodes[set].name).into_owned(), stored, is_exclusive));
    }
    let says_so = sets.iter().any(|&(_, _, is_exclusive)| is_exclusive);
    let mut of_face = vec![NO_MATERIAL; faces];
    for (name, faces, is_exclusive) in sets {
        let is_free = faces.iter().all(|&face| of_face[face as usize] == NO_MATERIAL);
        if is_free && (is_exclusive || !says_so) {
            let material = materials.number(name);
            faces.into_iter().for_each(|face| of_face[face as usize] = material);
        } else {
            part.groups.push(FaceGroup { name, faces });
        }
    }
    if of_face.iter().any(|&material| material != NO_MATERIAL) {
        part.materials = of_face;
    }
    Ok(())
}
