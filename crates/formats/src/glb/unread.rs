//! What models do not keep of the meshes that are read.

use std::collections::BTreeSet;

use cager_geometry::mesh::Model;
use gltf::json::Index;
use gltf::json::animation::Property;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked::{self, Invalid, Valid};

use super::accessor::attribute;
use super::buffers::Buffers;
use super::materials::Look;
use super::scene::Placement;
use crate::dropped::{Dropped, counted, listed};

/// Of chosen meshes, which gave a model.
pub(super) fn of(buffers: &Buffers<'_>, placements: &[Placement], model: &Model) -> Dropped {
    let root = &buffers.root;
    // Targets that an animation drives are the motion, which is read.
    let channels = root.animations.iter().flat_map(|animation| &animation.channels);
    let weights = channels.filter(|channel| channel.target.path == Valid(Property::MorphTargetWeights));
    let driven: BTreeSet<usize> = weights.map(|channel| channel.target.node.value()).collect();
    let is_driven = |placement: &&Placement| placement.node.is_some_and(|node| driven.contains(&node));
    let moving: BTreeSet<usize> = placements.iter().filter(is_driven).map(|placement| placement.mesh).collect();
    let meshes: BTreeSet<usize> = placements.iter().map(|placement| placement.mesh).collect();
    let primitives = |mesh: &usize| root.meshes.get(*mesh).map_or(&[][..], |mesh| &mesh.primitives);
    let is_line = |found: &&Primitive| matches!(found.mode, Valid(Mode::Lines | Mode::LineLoop | Mode::LineStrip));
    let (lines, faces): (Vec<&Primitive>, Vec<_>) = meshes.iter().flat_map(primitives).partition(is_line);
    let still = meshes.difference(&moving).flat_map(primitives).filter(|found| !is_line(found));
    let targets = still.map(|found| found.targets.as_ref().map_or(0, Vec::len)).max().unwrap_or(0);

    let attributes: BTreeSet<&Checked<Semantic>> = faces.iter().flat_map(|found| found.attributes.keys()).collect();
    let parts = &model.surface.parts;
    let uv_sets = parts.iter().flat_map(|part| &part.uv_sets).map(|set| &set.name);
    let color_sets = parts.iter().flat_map(|part| &part.color_sets).map(|set| &set.name);
    let kept: BTreeSet<&String> = uv_sets.chain(color_sets).collect();
    let sets = |what: &str, is_one: &dyn Fn(&Semantic) -> bool| {
        let is_one = |found: &&&Checked<Semantic>| if let Valid(found) = found { is_one(found) } else { false };
        let names = attributes.iter().filter(is_one).map(|found| found.to_string());
        let names: Vec<String> = names.filter(|name| !kept.contains(name)).collect();
        (!names.is_empty()).then(|| format!("{what} ({})", listed(names.iter().map(String::as_bytes))))
    };
    let mut dropped = Dropped::default();
    let coordinates = sets("texture coordinates", &|found| matches!(found, Semantic::TexCoords(_)));
    coordinates.into_iter().for_each(|phrase| dropped.add(phrase));
    add_materials(&mut dropped, &buffers.materials, &faces);
    let has_normals = |found: &&Primitive| attribute(found, Semantic::Normals).is_some();
    let are_mixed = faces.iter().any(has_normals) && !faces.iter().all(has_normals);
    let others = [
        are_mixed.then(|| "normals, which not all primitives have (NORMAL)".to_owned()),
        sets("tangents", &|found| *found == Semantic::Tangents),
        sets("colours", &|found| matches!(found, Semantic::Colors(set) if *set > 0 || model.colors.is_empty())),
        attributes.contains(&Invalid).then(|| "attributes of its own".to_owned()),
        (targets > 0).then(|| counted(targets, "morph target")),
        (!lines.is_empty()).then(|| counted(lines.len(), "primitive") + " of lines"),
    ];
    others.into_iter().flatten().for_each(|phrase| dropped.add(phrase));

    let skins: BTreeSet<usize> = placements.iter().filter_map(|placement| placement.skin).collect();
    let joints = skins.iter().filter_map(|&skin| root.skins.get(skin)).flat_map(|skin| &skin.joints);
    let joints: BTreeSet<usize> = joints.map(Index::value).collect();
    if !skins.is_empty() {
        let its = if skins.len() == 1 { "its skin".to_owned() } else { counted(skins.len(), "skin") };
        dropped.add(format!("{its} of {}", counted(joints.len(), "joint")));
    }
    dropped
}

fn add_materials(dropped: &mut Dropped, materials: &[Look], faces: &[&Primitive]) {
    let used: BTreeSet<usize> =
        faces.iter().filter_map(|found| found.material.map(|material| material.value())).collect();
    let used = || used.iter().filter_map(|&material| materials.get(material));
    let as_text = used().flat_map(|look| &look.embedded).filter(|found| found.view.is_none());
    let embedded: BTreeSet<&str> = as_text.map(|found| found.path.as_str()).collect();
    if !embedded.is_empty() {
        dropped.add(counted(embedded.len(), "texture") + " as text within the file");
    }
    used().flat_map(|look| &look.dropped).for_each(|phrase| dropped.add(*phrase));
}
