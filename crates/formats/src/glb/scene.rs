//! Where the meshes of a scene stand.

use cager_geometry::mesh::Point;
use glam::{DAffine3, DQuat, DVec3, Vec3};
use gltf::json::{Index, Mesh, Node, Root};

use super::faults::dangling;
use crate::error::Fault;

/// The meshes of the default scene.
pub(super) struct Scene {
    pub(super) placements: Vec<Placement>,
    /// From each node's space to the world's; none for nodes outside the scene.
    worlds: Vec<Option<DAffine3>>,
    /// The node above each.
    pub(super) parents: Vec<Option<usize>>,
    /// How many nodes are in the path of each.
    pub(super) depths: Vec<usize>,
    /// Whether each, or one above it, is switched off.
    hidden: Vec<bool>,
}

/// A mesh at its place in the scene.
pub(super) struct Placement {
    pub(super) mesh: usize,
    /// The node that the mesh hangs on, if any does.
    pub(super) node: Option<usize>,
    /// The skin whose joints say where the mesh is.
    pub(super) skin: Option<usize>,
    transform: DAffine3,
}

impl Placement {
    pub(super) fn mesh_in<'a>(&self, root: &'a Root) -> Result<&'a Mesh, Fault> {
        let count = root.meshes.len();
        root.meshes.get(self.mesh).ok_or_else(|| dangling(&format!("mesh {}", self.mesh), count))
    }

    pub(super) fn apply(&self, p: Point) -> Point {
        if self.transform == DAffine3::IDENTITY { p } else { self.transform.transform_point3(p.into()).into() }
    }

    /// Whether triangles turn around, so that they must be turned back.
    pub(super) fn mirrored(&self) -> bool {
        mirrors(&self.transform)
    }
}

impl Scene {
    /// The meshes of the default scene that are shown, or all of it where none is, in the order of their nodes, or all meshes as they are where no node has one.
    pub(super) fn of(root: &Root) -> Result<Self, Fault> {
        let mut scene = Self::nodes(root)?;
        let Self { worlds, hidden, .. } = &scene;
        let mut placements = Vec::new();
        let all_hidden =
            (0..root.nodes.len()).all(|k| root.nodes[k].mesh.is_none() || worlds[k].is_none() || hidden[k]);
        for (k, (node, world)) in root.nodes.iter().zip(worlds).enumerate() {
            let (Some(mesh), Some(world)) = (node.mesh, world) else { continue };
            if hidden[k] && !all_hidden {
                continue;
            }
            let others = node.extensions.as_ref().map(|extensions| &extensions.others);
            if others.is_some_and(|others| others.contains_key("EXT_mesh_gpu_instancing")) {
                return Err(Fault::unsupported(format!(
                    "node {k} repeats its mesh by EXT_mesh_gpu_instancing; export the copies as meshes of their own"
                )));
            }
            // The joints of a skin, not its node, say where it is.
            let skin = node.skin.map(|skin| skin.value());
            let transform = if skin.is_some() { DAffine3::IDENTITY } else { *world };
            placements.push(Placement { mesh: mesh.value(), node: Some(k), skin, transform });
        }
        if root.nodes.iter().all(|node| node.mesh.is_none()) {
            let alone = |mesh| Placement { mesh, node: None, skin: None, transform: DAffine3::IDENTITY };
            placements.extend((0..root.meshes.len()).map(alone));
        } else if placements.is_empty() {
            let scene = root.scene.map_or(0, |scene| scene.value());
            return Err(Fault::invalid(format!(
                "has meshes, but none in the scene that it shows, scene {scene}; make the scene with the mesh the active one and export again"
            )));
        }
        scene.placements = placements;
        Ok(scene)
    }

    /// The nodes of the default scene, without meshes.
    fn nodes(root: &Root) -> Result<Self, Fault> {
        let count = root.nodes.len();
        let mut tree = Self {
            placements: Vec::new(),
            worlds: vec![None; count],
            parents: vec![None; count],
            depths: vec![0; count],
            hidden: vec![false; count],
        };
        let mut open: Vec<_> = roots(root)?.into_iter().map(|node| (node, DAffine3::IDENTITY, None, false)).collect();
        while let Some((index, parent, above, is_hidden)) = open.pop() {
            let node = root.nodes.get(index).ok_or_else(|| dangling(&format!("node {index}"), count))?;
            if tree.worlds[index].is_some() {
                return Err(Fault::damaged(format!(
                    "node {index} is reached twice, but nodes make a tree; export the mesh again"
                )));
            }
            let (world, is_hidden) = (parent * local(node), is_hidden || hides(node));
            (tree.worlds[index], tree.parents[index], tree.hidden[index]) = (Some(world), above, is_hidden);
            tree.depths[index] = 1 + above.map_or(0, |above: usize| tree.depths[above]);
            open.extend(children(node).map(|child| (child, world, Some(index), is_hidden)));
        }
        Ok(tree)
    }

    /// From a node's space to the world's.
    pub(super) fn world(&self, node: usize) -> Result<&DAffine3, Fault> {
        let world = self.worlds.get(node).ok_or_else(|| dangling(&format!("node {node}"), self.worlds.len()))?;
        world.as_ref().ok_or_else(|| {
            Fault::unsupported(format!("node {node} moves a skin but is not in the scene; export the mesh again"))
        })
    }
}

/// Whether a node is switched off with all below it.
fn hides(node: &Node) -> bool {
    let others = node.extensions.as_ref().map(|extensions| &extensions.others);
    let visible = others.and_then(|others| others.get("KHR_node_visibility")?.get("visible")?.as_bool());
    visible == Some(false)
}

/// Whether triangles turn around.
pub(super) fn mirrors(transform: &DAffine3) -> bool {
    transform.matrix3.determinant() < 0.0
}

fn roots(root: &Root) -> Result<Vec<usize>, Fault> {
    let scene = root.scene.map_or(0, |scene| scene.value());
    match root.scenes.get(scene) {
        Some(scene) => Ok(scene.nodes.iter().map(Index::value).collect()),
        None if root.scene.is_some() => Err(dangling(&format!("scene {scene}"), root.scenes.len())),
        None => {
            let mut is_root = vec![true; root.nodes.len()];
            for child in root.nodes.iter().flat_map(children) {
                if let Some(is_root) = is_root.get_mut(child) {
                    *is_root = false;
                }
            }
            Ok((0..root.nodes.len()).filter(|&node| is_root[node]).collect())
        }
    }
}

fn children(node: &Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(Index::value)
}

fn local(node: &Node) -> DAffine3 {
    if let Some(m) = &node.matrix {
        return affine(&m.map(f64::from));
    }
    let [scale, translation] = [node.scale.unwrap_or([1.0; 3]), node.translation.unwrap_or_default()]
        .map(|vector| Vec3::from(vector).as_dvec3());
    let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
}

/// From the columns of a 4 × 4 matrix, whose last row is 0 0 0 1.
pub(super) fn affine(columns: &[f64; 16]) -> DAffine3 {
    let [a, b, c, d] = [0, 4, 8, 12].map(|column| DVec3::from_slice(&columns[column..]));
    DAffine3::from_cols(a, b, c, d)
}
