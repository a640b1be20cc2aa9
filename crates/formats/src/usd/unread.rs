//! What a mesh of a layer has that is not read.

use super::layer::{Kind, Layer};
use crate::dropped::{Dropped, counted, listed};
use crate::error::Fault;
use crate::scene::ancestry;

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
pub(super) fn add(layer: &mut Layer<'_>, mesh: usize, dropped: &mut Dropped) -> Result<(), Fault> {
    let mut properties = layer.source.properties(mesh);
    properties.sort_unstable();
    properties.dedup();
    let told = |what: &str, names: &[&str]| format!("{what} ({})", listed(names.iter().map(|name| name.as_bytes())));
    for what in ["texture coordinates", "normals", "colours", "a skin", "primvars"] {
        let of_kind = properties.iter().filter(|(name, type_name)| kind(name, type_name) == Some(what));
        let names: Vec<&str> = of_kind.map(|(name, _)| name.as_str()).collect();
        if !names.is_empty() {
            dropped.add_on_faces(told(what, &names));
        }
    }
    for (name, what) in KINDS {
        if properties.iter().any(|(found, _)| found == name) {
            dropped.add(what);
        }
    }
    if let Some(scheme) = layer.tokens(mesh, "subdivisionScheme", 1)? {
        let scheme = scheme.concat();
        if scheme != "none" {
            dropped.add(told("the subdivision scheme", &[&scheme]));
        }
    }
    let is_subset = |k: &usize| layer.prims[*k].kind == Kind::Subset && layer.nodes[*k].parent == Some(mesh);
    let subsets: Vec<usize> = (0..layer.prims.len()).filter(is_subset).collect();
    let bound = |k: usize| layer.source.properties(k).iter().any(|(name, _)| name.starts_with("material:binding"));
    if subsets.iter().copied().chain(ancestry(&layer.nodes, mesh)).any(bound) {
        dropped.add_on_faces("materials (material:binding)");
    }
    if !subsets.is_empty() {
        dropped.add_on_faces(format!("{} (GeomSubset)", counted(subsets.len(), "set") + " of faces"));
    }
    Ok(())
}

/// What corners or points have in an attribute.
fn kind(name: &str, type_name: &str) -> Option<&'static str> {
    let plain = name.strip_prefix("primvars:");
    let is_of = |types: &[&str]| plain.is_some() && types.iter().any(|start| type_name.starts_with(start));
    match plain {
        _ if name.ends_with(":indices") => None,
        _ if name == "normals" || is_of(&["normal3"]) => Some("normals"),
        _ if is_of(&["texCoord", "float2", "double2"]) => Some("texture coordinates"),
        Some(plain) if is_of(&["color"]) || plain == "displayOpacity" => Some("colours"),
        _ if plain.unwrap_or(name).starts_with("skel:") => Some("a skin"),
        plain => plain.map(|_| "primvars"),
    }
}
