//! The nodes of a scene, and which of its meshes are meant.

use std::sync::Arc;

use ufbx::{Mesh, Node as Stored};

use super::load::Scene;
use crate::error::Fault;
use crate::scene::{Node, Tree, Wanted, ancestry, choose, list};

/// Bytes that copies of meshes may take together, and those of a point and of a corner in each.
const COPIES: usize = 512 << 20;
const ITEM: usize = 64;

pub(super) struct Nodes<'a> {
    /// Each before those below it, in the order of the file.
    nodes: Vec<Node>,
    stored: Vec<&'a Stored>,
}

impl<'a> Nodes<'a> {
    pub(super) fn of(scene: &'a Scene) -> Self {
        let mut all = Self { nodes: Vec::new(), stored: Vec::new() };
        let below = |node: &'a Stored, parent| node.children.as_ref().iter().rev().map(move |child| (&**child, parent));
        let mut waiting: Vec<(&Stored, Option<usize>)> = below(&scene.root.root_node, None).collect();
        while let Some((node, parent)) = waiting.pop() {
            let depth = parent.map_or(1, |parent: usize| all.nodes[parent].depth + 1);
            waiting.extend(below(node, Some(all.nodes.len())));
            all.nodes.push(Node { name: Arc::from(node.element.name.as_bytes()), parent, depth });
            all.stored.push(node);
        }
        all
    }

    /// A node and those above it.
    pub(super) fn above(&self, node: usize) -> impl Iterator<Item = &'a Stored> {
        ancestry(&self.nodes, node).map(|k| self.stored[k])
    }

    pub(super) fn stored(&self, node: usize) -> &'a Stored {
        self.stored[node]
    }

    /// The mesh of a node, where it has faces.
    pub(super) fn mesh(&self, node: usize) -> Option<&'a Mesh> {
        self.stored[node].mesh.as_deref().filter(|mesh| mesh.num_faces > 0 && mesh.num_vertices > 0)
    }

    /// The meshes that are wanted, and what the user should know of others. What is hidden is left
    /// out, where there is anything else and nothing is named.
    pub(super) fn choose(
        &mut self,
        wanted: Wanted<'_>,
        is_hidden: impl Fn(&Self, usize) -> bool,
    ) -> Result<(Vec<usize>, Option<String>), Fault> {
        let mut meshes: Vec<usize> = (0..self.nodes.len()).filter(|&k| self.mesh(k).is_some()).collect();
        if meshes.is_empty() {
            return Err(Fault::unsupported("holds no polygon mesh; export the mesh itself as FBX"));
        }
        let mut note = None;
        if wanted.prims.is_empty() && meshes.len() > 1 {
            let (hidden, shown): (Vec<_>, Vec<_>) = meshes.iter().copied().partition(|&mesh| is_hidden(self, mesh));
            if !hidden.is_empty() && !shown.is_empty() {
                note = Some(format!("left out what is hidden: {}; --prim reads it too", list(self, &hidden)));
                meshes = shown;
            }
        }
        let chosen = choose(self, &meshes, wanted)?;
        let size = |&node: &usize| self.mesh(node).map_or(0, |mesh| mesh.num_vertices + mesh.num_indices);
        let mut all: Vec<(u32, usize)> =
            chosen.iter().filter_map(|k| Some((self.mesh(*k)?.element.element_id, size(k)))).collect();
        let total = all.iter().map(|&(_, size)| size).fold(0, usize::saturating_add);
        all.sort_unstable();
        all.dedup();
        let once: usize = all.iter().map(|&(_, size)| size).sum();
        if (total - once).saturating_mul(ITEM) > COPIES || total > u32::MAX as usize {
            return Err(Fault::unsupported(
                "has copies of meshes that take more than 512 MiB, or more than 4294967295 points; export fewer, or \
                 choose some with --prim",
            ));
        }
        Ok((chosen, note))
    }
}

impl Tree for Nodes<'_> {
    fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    fn points(&mut self, mesh: usize) -> Option<u64> {
        self.mesh(mesh).map(|mesh| mesh.num_vertices as u64)
    }
}
