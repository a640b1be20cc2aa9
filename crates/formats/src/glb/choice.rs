//! Which mesh of a scene is meant.

use std::collections::HashSet;
use std::ops::Range;

use gltf::json::Root;
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::scene::{Placement, Scene};
use crate::scene::{Failure, Objects, choose as choose_object, list};

/// The placements that are read: the one that `prim` names, or all as one mesh.
pub(super) fn choose(root: &Root, scene: &Scene, prim: Option<&str>) -> Result<Range<usize>, Failure> {
    let all = 0..scene.placements.len();
    if prim.is_none() || all.is_empty() {
        return Ok(all);
    }
    let mut tree = Tree::of(root, scene);
    let meshes = tree.meshes();
    let chosen = choose_object(&mut tree, &meshes, prim)? - root.nodes.len();
    Ok(chosen..chosen + 1)
}

/// All meshes with their points, as messages have them.
pub(super) fn listed(root: &Root, scene: &Scene) -> String {
    let mut tree = Tree::of(root, scene);
    let meshes = tree.meshes();
    list(&mut tree, &meshes)
}

/// Nodes, and below them the meshes that they place.
struct Tree<'a> {
    root: &'a Root,
    scene: &'a Scene,
    names: Vec<String>,
    depths: Vec<usize>,
}

impl<'a> Tree<'a> {
    fn of(root: &'a Root, scene: &'a Scene) -> Self {
        let called =
            |name: &Option<String>, kind: &str, k: usize| name.clone().unwrap_or_else(|| format!("{kind}_{k}"));
        let mut names: Vec<String> =
            root.nodes.iter().enumerate().map(|(k, node)| called(&node.name, "node", k)).collect();
        names.extend(scene.placements.iter().map(|placement| {
            let name = root.meshes.get(placement.mesh).and_then(|mesh| mesh.name.clone());
            called(&name, "mesh", placement.mesh)
        }));
        let mut tree = Self { root, scene, names, depths: Vec::new() };
        tree.depths = tree.find_depths();
        tree
    }

    fn find_depths(&self) -> Vec<usize> {
        let mut depths = vec![0; self.names.len()];
        let mut above = Vec::new();
        for object in 0..depths.len() {
            let mut next = Some(object);
            while let Some(k) = next.filter(|&k| depths[k] == 0) {
                above.push(k);
                next = self.parent(k);
            }
            let mut depth = next.map_or(0, |k| depths[k]);
            for k in above.drain(..).rev() {
                depth += 1;
                depths[k] = depth;
            }
        }
        depths
    }

    fn placement(&self, object: usize) -> Option<&'a Placement> {
        self.scene.placements.get(object.checked_sub(self.root.nodes.len())?)
    }

    fn meshes(&self) -> Vec<usize> {
        (self.root.nodes.len()..self.names.len()).collect()
    }
}

impl Objects for Tree<'_> {
    fn name(&self, object: usize) -> &[u8] {
        self.names[object].as_bytes()
    }

    fn parent(&self, object: usize) -> Option<usize> {
        match self.placement(object) {
            Some(placement) => placement.node,
            None => self.scene.parents[object],
        }
    }

    fn depth(&self, object: usize) -> usize {
        self.depths[object]
    }

    fn told(&mut self, object: usize) -> String {
        let mesh = self.placement(object).and_then(|placement| placement.mesh_in(self.root).ok());
        let positions = mesh.into_iter().flat_map(|mesh| &mesh.primitives);
        let positions =
            positions.filter_map(|primitive| primitive.attributes.get(&Checked::Valid(Semantic::Positions)));
        let distinct: HashSet<usize> = positions.map(gltf::json::Index::value).collect();
        let counts = distinct.iter().filter_map(|&index| self.root.accessors.get(index));
        format!("{} points", counts.fold(0_u64, |sum, accessor| sum.saturating_add(accessor.count.0)))
    }
}
