//! What a mesh of a layer has that is not read.

use super::layer::{Kind, Layer};
use crate::dropped::{Dropped, counted, listed};
use crate::scene::{Failure, ancestry};

/// Attributes beside points and faces, and what they are.
const KINDS: [(&str, &str); 9] = [
    ("velocities", "velocities"),
    ("accelerations", "velocities"),
    ("cornerIndices", "creases"),
    ("cornerSharpnesses", "creases"),
    ("creaseIndices", "creases"),
    ("creaseSharpnesses", "creases"),
    ("creaseLengths", "creases"),
    ("holeIndices", "holes"),
    ("skel:blendShapes", "blend shapes"),
];

/// Adds what a mesh has beside points and faces.
pub(super) fn add<'a>(layer: &mut (dyn Layer + 'a), mesh: usize, dropped: &mut Dropped) -> Result<(), Failure> {
    let mut properties = layer.properties(mesh);
    properties.sort_unstable();
    properties.dedup();
    let of_type = |wanted: &dyn Fn(&str, &str) -> bool| -> Vec<&str> {
        let names = properties.iter().filter(|(name, told)| wanted(name, told) && !name.ends_with(":indices"));
        names.map(|(name, _)| name.as_str()).collect()
    };
    let is_primvar = |name: &str| name.starts_with("primvars:");
    let is_skin = |name: &str| name.starts_with("primvars:skel:") || name.starts_with("skel:");
    let is_normals = |name: &str, told: &str| name == "normals" || is_primvar(name) && told.starts_with("normal3");
    let is_coordinates = |name: &str, told: &str| {
        is_primvar(name) && (told.starts_with("texCoord") || told.starts_with("float2") || told.starts_with("double2"))
    };
    let is_color =
        |name: &str, told: &str| is_primvar(name) && (told.starts_with("color") || name.ends_with(":displayOpacity"));
    let is_other = |name: &str, told: &str| {
        is_primvar(name)
            && !(is_skin(name) || is_normals(name, told) || is_coordinates(name, told) || is_color(name, told))
    };
    let told = |what: &str, names: &[&str]| format!("{what} ({})", listed(names.iter().map(|name| name.as_bytes())));
    let coordinates = of_type(&is_coordinates);
    if !coordinates.is_empty() {
        dropped.add_on_faces(told("texture coordinates", &coordinates));
    }
    let normals = of_type(&is_normals);
    if !normals.is_empty() {
        dropped.add_on_faces(told("normals", &normals));
    }
    let others = [
        ("colours", of_type(&is_color)),
        ("a skin", of_type(&|name: &str, _: &str| is_skin(name))),
        ("primvars", of_type(&is_other)),
    ];
    for (what, names) in others {
        if !names.is_empty() {
            dropped.add_on_faces(told(what, &names));
        }
    }
    for (name, what) in KINDS {
        if properties.iter().any(|(found, _)| found == name) {
            dropped.add(what);
        }
    }
    if let Some(scheme) = layer.attribute(mesh, "subdivisionScheme")?.still() {
        let scheme = layer.tokens(scheme, 1)?.concat();
        if scheme != "none" {
            dropped.add(told("the subdivision scheme", &[&scheme]));
        }
    }
    let is_subset = |k: &usize| layer.prims()[*k].kind == Kind::Subset && layer.nodes()[*k].parent == Some(mesh);
    let subsets: Vec<usize> = (0..layer.prims().len()).filter(is_subset).collect();
    let bound = |k: usize| layer.properties(k).iter().any(|(name, _)| name.starts_with("material:binding"));
    if subsets.iter().copied().chain(ancestry(layer.nodes(), mesh)).any(bound) {
        dropped.add_on_faces("materials (material:binding)");
    }
    if !subsets.is_empty() {
        dropped.add_on_faces(format!("{} (GeomSubset)", counted(subsets.len(), "set") + " of faces"));
    }
    Ok(())
}

/// A note of a mesh that is hidden in some frames.
pub(super) fn visibility<'a>(layer: &mut (dyn Layer + 'a), mesh: usize) -> Result<Option<String>, Failure> {
    for prim in ancestry(layer.nodes(), mesh).collect::<Vec<_>>() {
        let said = layer.attribute(prim, "visibility")?;
        let mut tokens = Vec::new();
        for value in said.values {
            tokens.extend(layer.tokens(value, 1)?);
        }
        if tokens.windows(2).any(|pair| pair[0] != pair[1]) {
            return Ok(Some("its visibility is animated, which is not kept".to_owned()));
        }
    }
    Ok(None)
}
