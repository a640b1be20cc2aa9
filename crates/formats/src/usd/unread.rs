//! What a mesh of a layer has that is not read.

use std::collections::{BTreeSet, HashSet};

use super::layer::Layer;
use crate::dropped::{Dropped, counted, listed};
use crate::scene::MeshTracks;

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

/// The names and types of properties of meshes that were not read.
#[derive(Default)]
pub(super) struct Unread {
    properties: BTreeSet<(String, String)>,
    /// Whether some of them belong to faces or corners.
    is_on_faces: bool,
    has_materials: bool,
}

impl Unread {
    /// Adds what a mesh has beside the properties that were read.
    pub(super) fn take(&mut self, layer: &mut Layer<'_>, prim: usize, mesh: &MeshTracks, read: &HashSet<String>) {
        let (part, is_moved) = (&mesh.part, mesh.deformer.is_some());
        let is_read =
            |name: &str| read.contains(name) || (is_moved && name.trim_start_matches("primvars:").starts_with("skel:"));
        for (name, type_name) in layer.source.properties(prim).into_iter().filter(|(name, _)| !is_read(name)) {
            self.has_materials |= part.materials.is_empty() && name.starts_with("material:binding");
            if kind(&name, &type_name).is_some() {
                let told = layer.source.interpolation(prim, &name).unwrap_or_default();
                self.is_on_faces |= !matches!(told.as_str(), "" | "constant" | "vertex" | "varying");
            }
            self.properties.insert((name, type_name));
        }
    }

    /// Says it, and of how many materials the names alone are kept.
    pub(super) fn tell(&self, names_alone: usize, dropped: &mut Dropped) {
        let mut add = |phrase: String| {
            if self.is_on_faces { dropped.add_on_faces(phrase) } else { dropped.add(phrase) }
        };
        for what in ["texture coordinates", "normals", "colours", "a skin", "primvars"] {
            let of_kind = self.properties.iter().filter(|(name, type_name)| kind(name, type_name) == Some(what));
            let names: Vec<&[u8]> = of_kind.map(|(name, _)| name.as_bytes()).collect();
            if !names.is_empty() {
                add(format!("{what} ({})", listed(names)));
            }
        }
        for (name, what) in KINDS {
            if self.properties.iter().any(|(found, _)| found == name) {
                dropped.add(what);
            }
        }
        if self.has_materials {
            dropped.add_on_faces("materials (material:binding)");
        }
        if names_alone > 0 {
            dropped.add(format!("the values of {} (no UsdPreviewSurface)", counted(names_alone, "material")));
        }
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
