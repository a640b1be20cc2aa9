//! What models do not keep of the meshes that are read.

use std::collections::{BTreeSet, HashSet};

use gltf::json::Root;
use gltf::json::animation::Property;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::scene::Placement;
use crate::dropped::{Dropped, counted, listed};

/// Of chosen meshes, where colours of points are kept or not.
pub(super) fn of(root: &Root, placements: &[Placement], has_colors: bool) -> Dropped {
    let mut unread = Unread::default();
    // Targets that an animation drives are the motion, which is read.
    let channels = root.animations.iter().flat_map(|animation| &animation.channels);
    let weights = channels.filter(|channel| channel.target.path == Checked::Valid(Property::MorphTargetWeights));
    let driven: HashSet<usize> = weights.map(|channel| channel.target.node.value()).collect();
    let is_driven = |placement: &Placement| placement.node.is_some_and(|node| driven.contains(&node));
    let moving: HashSet<usize> = placements.iter().filter(|p| is_driven(p)).map(|p| p.mesh).collect();
    let mut meshes = HashSet::new();
    let mut skins = HashSet::new();
    for placement in placements {
        skins.extend(placement.skin);
        if meshes.insert(placement.mesh)
            && let Some(mesh) = root.meshes.get(placement.mesh)
        {
            let is_moving = moving.contains(&placement.mesh);
            mesh.primitives.iter().for_each(|primitive| unread.note(primitive, is_moving));
        }
    }
    let mut dropped = unread.told(root, has_colors);
    let joints: HashSet<usize> = skins
        .iter()
        .filter_map(|&skin| root.skins.get(skin))
        .flat_map(|skin| &skin.joints)
        .map(gltf::json::Index::value)
        .collect();
    if !skins.is_empty() {
        let its = if skins.len() == 1 { "its skin".to_owned() } else { counted(skins.len(), "skin") };
        dropped.add(format!("{its} of {}", counted(joints.len(), "joint")));
    }
    dropped
}

#[derive(Default)]
struct Unread {
    /// By the names of attributes.
    texture_coordinates: BTreeSet<u32>,
    colors: BTreeSet<u32>,
    normals: bool,
    tangents: bool,
    others: bool,
    materials: BTreeSet<usize>,
    /// Whether some primitive has no material.
    is_plain: bool,
    targets: usize,
    lines: usize,
}

impl Unread {
    fn note(&mut self, primitive: &Primitive, is_moving: bool) {
        if matches!(primitive.mode, Checked::Valid(Mode::Lines | Mode::LineLoop | Mode::LineStrip)) {
            self.lines += 1;
            return;
        }
        for semantic in primitive.attributes.keys() {
            match semantic {
                Checked::Valid(Semantic::TexCoords(set)) => drop(self.texture_coordinates.insert(*set)),
                Checked::Valid(Semantic::Colors(set)) => drop(self.colors.insert(*set)),
                Checked::Valid(Semantic::Normals) => self.normals = true,
                Checked::Valid(Semantic::Tangents) => self.tangents = true,
                // Joints and weights are told as a skin.
                Checked::Valid(_) => {}
                Checked::Invalid => self.others = true,
            }
        }
        match primitive.material {
            Some(material) => drop(self.materials.insert(material.value())),
            None => self.is_plain = true,
        }
        let targets = primitive.targets.as_ref().filter(|_| !is_moving);
        self.targets = self.targets.max(targets.map_or(0, Vec::len));
    }

    fn told(self, root: &Root, has_colors: bool) -> Dropped {
        let mut dropped = Dropped::default();
        if !self.texture_coordinates.is_empty() {
            dropped.add(format!("texture coordinates ({})", sets("TEXCOORD", &self.texture_coordinates)));
        }
        if !self.materials.is_empty() {
            let textures = match root.textures.len() {
                0 => String::new(),
                count => format!(" with {}", counted(count, "texture")),
            };
            let phrase = counted(self.materials.len(), "material") + &textures;
            // One for all is put back without numbers of faces.
            let is_one = self.materials.len() == 1 && !self.is_plain;
            if is_one { dropped.add(phrase) } else { dropped.add_on_faces(phrase) }
        }
        if self.normals {
            dropped.add("normals (NORMAL)");
        }
        if self.tangents {
            dropped.add("tangents (TANGENT)");
        }
        let colors: BTreeSet<u32> = self.colors.into_iter().filter(|&set| set > 0 || !has_colors).collect();
        if !colors.is_empty() {
            dropped.add(format!("colours ({})", sets("COLOR", &colors)));
        }
        if self.others {
            dropped.add("attributes of its own");
        }
        if self.targets > 0 {
            dropped.add(counted(self.targets, "morph target"));
        }
        if self.lines > 0 {
            dropped.add(counted(self.lines, "primitive") + " of lines");
        }
        dropped
    }
}

/// `TEXCOORD_0 and TEXCOORD_1`.
fn sets(name: &str, sets: &BTreeSet<u32>) -> String {
    let names: Vec<String> = sets.iter().map(|set| format!("{name}_{set}")).collect();
    listed(names.iter().map(String::as_bytes))
}
