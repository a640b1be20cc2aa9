//! What lies on the faces of a mesh, as primvars, creases and subsets of faces.

use std::collections::HashMap;
use std::io::{self, Seek, Write};

use cager_geometry::surface::{CornerSet, NO_MATERIAL, Part, Subdivision};

use super::encoder::Encoder;
use super::material::USUAL_UVS;
use super::property::{Prim, Property};
use super::tree::identifier;
use crate::names::Names;

/// Families of subsets, of which that of materials is the specification's.
const MATERIALS: &str = "materialBind";
const GROUPS: &str = "groups";
/// The relationship to a material.
const BINDING: &str = "material:binding";

/// The properties of a part that do not change, and its subsets; `materials` are paths.
pub(super) fn put<W: Write + Seek>(
    encoder: &mut Encoder<W>,
    part: &Part,
    materials: &[String],
) -> io::Result<(Vec<Property>, Vec<Prim>)> {
    let mut properties = Vec::new();
    let mut names = names(part).into_iter();
    for (set, name) in part.uv_sets.iter().zip(names.by_ref()) {
        let values = encoder.floats(&set.values)?;
        put_set(encoder, &mut properties, ("texCoord2f[]", name, values), set)?;
    }
    for (set, name) in part.color_sets.iter().zip(names) {
        let is_opaque = set.values.iter().all(|&[.., alpha]| alpha == 1.0);
        let (type_name, values) = if is_opaque {
            let colors: Vec<[f32; 3]> = set.values.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            ("color3f[]", encoder.floats(&colors)?)
        } else {
            ("color4f[]", encoder.floats(&set.values)?)
        };
        put_set(encoder, &mut properties, (type_name, name, values), set)?;
    }
    if !part.creases.is_empty() {
        let edges: Vec<i32> = part.creases.iter().flat_map(|crease| crease.edge.map(|point| point as i32)).collect();
        let sharpnesses: Vec<[f32; 1]> = part.creases.iter().map(|crease| [crease.sharpness]).collect();
        let lengths = vec![2; part.creases.len()];
        properties.push(Property::new("int[]", "creaseIndices").value(encoder.integers(&edges)?));
        properties.push(Property::new("int[]", "creaseLengths").value(encoder.integers(&lengths)?));
        properties.push(Property::new("float[]", "creaseSharpnesses").value(encoder.floats(&sharpnesses)?));
    }
    let subsets = put_subsets(encoder, part, materials, &mut properties)?;
    Ok((properties, subsets))
}

/// A set of values, and which of them each corner has.
fn put_set<W: Write + Seek, const N: usize>(
    encoder: &mut Encoder<W>,
    properties: &mut Vec<Property>,
    (type_name, name, values): (&'static str, String, u64),
    set: &CornerSet<N>,
) -> io::Result<()> {
    let corners: Vec<i32> = set.corners.iter().map(|&corner| corner as i32).collect();
    let name = format!("primvars:{name}");
    properties.push(Property::new("int[]", format!("{name}:indices")).value(encoder.integers(&corners)?));
    properties.push(Property::new(type_name, name).value(values).by("faceVarying"));
    Ok(())
}

/// The material of all faces, or a subset of faces for each; then a subset for each group.
fn put_subsets<W: Write + Seek>(
    encoder: &mut Encoder<W>,
    part: &Part,
    materials: &[String],
    properties: &mut Vec<Property>,
) -> io::Result<Vec<Prim>> {
    let mut of_materials: Vec<(u32, Vec<i32>)> = Vec::new();
    let mut places = HashMap::new();
    for (face, &material) in (0..).zip(&part.materials).filter(|&(_, &material)| material != NO_MATERIAL) {
        let place = *places.entry(material).or_insert_with(|| {
            of_materials.push((material, Vec::new()));
            of_materials.len() - 1
        });
        of_materials[place].1.push(face);
    }
    let (mut subsets, mut names) = (Vec::new(), Names::default());
    let mut add = |encoder: &mut Encoder<W>, name: &str, family: &str, faces: &[i32], bound: Option<&String>| {
        let mut properties = vec![
            Property::fixed("elementType", "face"),
            Property::fixed("familyName", family),
            Property::new("int[]", "indices").value(encoder.integers(faces)?),
        ];
        properties.extend(bound.map(|path| Property::to(BINDING, path.clone())));
        let name = names.add(&identifier(name));
        let (type_name, is_bound) = ("GeomSubset", bound.is_some());
        subsets.push(Prim { name, type_name, is_bound, properties, children: Vec::new() });
        Ok::<_, io::Error>(())
    };
    let family = |name, kind: &str| Property::fixed(format!("subsetFamily:{name}:familyType"), kind);
    match &of_materials[..] {
        [] => {}
        [(material, faces)] if faces.len() == part.faces => {
            properties.extend(materials.get(*material as usize).map(|path| Property::to(BINDING, path.clone())));
        }
        several => {
            for (material, faces) in several {
                let Some(path) = materials.get(*material as usize) else { continue };
                add(encoder, path.rsplit('/').next().unwrap_or_default(), MATERIALS, faces, Some(path))?;
            }
            properties.push(family(MATERIALS, "nonOverlapping"));
        }
    }
    for group in &part.groups {
        let faces: Vec<i32> = group.faces.iter().map(|&face| face as i32).collect();
        add(encoder, &group.name, GROUPS, &faces, None)?;
    }
    if !part.groups.is_empty() {
        properties.push(family(GROUPS, "unrestricted"));
    }
    Ok(subsets)
}

/// Names of the sets of texture coordinates and of colours, each once.
fn names(part: &Part) -> Vec<String> {
    let uvs = part.uv_sets.iter().map(|set| (&set.name, USUAL_UVS));
    let colors = part.color_sets.iter().map(|set| (&set.name, "displayColor"));
    // Primvars of this name would be normals.
    let mut names = Names::default();
    names.add("normals");
    let named = |(name, usual): (&String, &str)| {
        let name = if name.is_empty() { usual.to_owned() } else { identifier(name) };
        names.add(&name)
    };
    uvs.chain(colors).map(named).collect()
}

/// Names of the sets of texture coordinates.
pub(super) fn uv_names(part: &Part) -> Vec<String> {
    let mut names = names(part);
    names.truncate(part.uv_sets.len());
    names
}

/// What a layer calls a scheme.
pub(super) fn scheme(subdivision: Subdivision) -> &'static str {
    match subdivision {
        Subdivision::None => "none",
        Subdivision::CatmullClark => "catmullClark",
        Subdivision::Loop => "loop",
        Subdivision::Bilinear => "bilinear",
    }
}
