//! What a mesh of a layer has that is not read.

use std::collections::HashSet;

use cager_geometry::surface::Part;

use super::layer::Layer;
use crate::dropped::{Dropped, listed};

/// Attributes beside points and faces, and what they are.
const KINDS: [(&str, &str); 9] = [
    ("velocities", "velocities"),
    ("accelerations", "velocities"),
    ("cornerIndices", "sharp corners"),
    ("cornerSharpnesses", "sharp corners"),
    ("creaseIndices", "creases"),
    ("creaseSharpnesses", "creases"),
    ("creaseLengths", "creases"),
    ("holeIndices", "holes"),
    ("skel:blendShapes", "blend shapes"),
];

/// Adds what a mesh has beside the properties that were read.
pub(super) fn add(layer: &mut Layer<'_>, mesh: usize, part: &Part, read: &HashSet<String>, dropped: &mut Dropped) {
    let mut properties = layer.source.properties(mesh);
    properties.retain(|(name, _)| !read.contains(name));
    properties.sort_unstable();
    properties.dedup();
    for what in ["texture coordinates", "normals", "colours", "a skin", "primvars"] {
        let of_kind = properties.iter().filter(|(name, type_name)| kind(name, type_name) == Some(what));
        let names: Vec<&[u8]> = of_kind.map(|(name, _)| name.as_bytes()).collect();
        if !names.is_empty() {
            dropped.add_on_faces(format!("{what} ({})", listed(names)));
        }
    }
    for (name, what) in KINDS {
        if properties.iter().any(|(found, _)| found == name) {
            dropped.add(what);
        }
    }
    if part.materials.is_empty() && properties.iter().any(|(name, _)| name.starts_with("material:binding")) {
        dropped.add_on_faces("materials (material:binding)");
    }
}

/// What corners or points have in an attribute.
pub(super) fn kind(name: &str, type_name: &str) -> Option<&'static str> {
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
