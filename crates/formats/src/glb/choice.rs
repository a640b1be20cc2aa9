//! Which mesh of a scene is meant.

use std::collections::HashSet;
use std::ops::Range;

use gltf::json::Root;
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::scene::Scene;
use crate::error::Fault;
use crate::scene::{Node, Tree, Wanted, choose as choose_meshes, list};

/// The placements that are read: those that are named, or all as one mesh.
pub(super) fn choose(root: &Root, scene: &Scene, prims: &[String]) -> Result<Range<usize>, Fault> {
    let all = 0..scene.placements.len();
    if prims.is_empty() || all.is_empty() {
        return Ok(all);
    }
    let (mut tree, meshes) = Meshes::of(root, scene);
    let chosen = choose_meshes(&mut tree, &meshes, Wanted { prims, ..Wanted::default() })?;
    let [first, last] = [chosen[0], chosen[chosen.len() - 1]].map(|mesh| mesh - root.nodes.len());
    Ok(first..last + 1)
}

/// All meshes with their points, as messages have them.
pub(super) fn listed(root: &Root, scene: &Scene) -> String {
    let (mut tree, meshes) = Meshes::of(root, scene);
    list(&mut tree, &meshes)
}

/// The nodes of a scene, and below them the meshes that they place.
struct Meshes<'a> {
    root: &'a Root,
    scene: &'a Scene,
    nodes: Vec<Node>,
}

impl<'a> Meshes<'a> {
    /// These, and the indices of the meshes among them.
    fn of(root: &'a Root, scene: &'a Scene) -> (Self, Vec<usize>) {
        let place = |k: usize| scene.places.get(k).and_then(Option::as_ref);
        let depth = |k: usize| place(k).map_or(0, |place| place.depth);
        let of = |(k, node): (usize, &gltf::json::Node)| {
            let parent = place(k).and_then(|place| place.parent);
            Node { name: called(node.name.as_ref(), "node", k).into_bytes().into(), parent, depth: depth(k) }
        };
        let mut nodes: Vec<Node> = root.nodes.iter().enumerate().map(of).collect();
        let meshes = (nodes.len()..nodes.len() + scene.placements.len()).collect();
        for placement in &scene.placements {
            let name = root.meshes.get(placement.mesh).and_then(|mesh| mesh.name.as_ref());
            let name = called(name, "mesh", placement.mesh).into_bytes().into();
            let depth = 1 + placement.node.map_or(0, depth);
            nodes.push(Node { name, parent: placement.node, depth });
        }
        (Self { root, scene, nodes }, meshes)
    }
}

/// The name of the item of a list, or one that says which it is.
pub(super) fn called(name: Option<&String>, kind: &str, k: usize) -> String {
    name.map_or_else(|| format!("{kind}_{k}"), String::clone)
}

impl Tree for Meshes<'_> {
    fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    fn points(&mut self, mesh: usize) -> Option<u64> {
        let placement = &self.scene.placements[mesh - self.root.nodes.len()];
        let positions = placement.mesh_in(self.root).into_iter().flat_map(|mesh| &mesh.primitives);
        let positions =
            positions.filter_map(|primitive| primitive.attributes.get(&Checked::Valid(Semantic::Positions)));
        let distinct: HashSet<usize> = positions.map(gltf::json::Index::value).collect();
        let counts = distinct.iter().filter_map(|&index| self.root.accessors.get(index));
        Some(counts.fold(0_u64, |sum, accessor| sum.saturating_add(accessor.count.0)))
    }
}
