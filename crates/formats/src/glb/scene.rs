//! Where the meshes of a scene stand.

use std::collections::HashSet;

use cager_geometry::mesh::Point;
use glam::{DAffine3, DQuat, DVec3, Vec3};
use gltf::json::{Index, Mesh, Node, Root};

use super::faults::item;
use crate::error::Fault;

pub(super) struct Scene {
    pub(super) placements: Vec<Placement>,
    /// Where each node is; none for those outside the scene.
    pub(super) places: Vec<Option<Place>>,
}

pub(super) struct Place {
    /// From its space to the world's.
    pub(super) world: DAffine3,
    pub(super) parent: Option<usize>,
    /// How many nodes are in its path.
    pub(super) depth: usize,
    /// Whether it, or one above it, is switched off.
    is_hidden: bool,
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
        item(&root.meshes, "mesh", self.mesh)
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
    /// The meshes of the default scene that are shown, or all of it where none is, in the order of
    /// their nodes; all meshes as they are where no node has one.
    pub(super) fn of(root: &Root) -> Result<Self, Fault> {
        let (places, mut placements) = (places(root)?, Vec::new());
        let of_mesh = |(node, place): (&Node, &Option<Place>)| node.mesh.and(place.as_ref()).map(|p| p.is_hidden);
        let all_hidden = root.nodes.iter().zip(&places).filter_map(of_mesh).all(|is_hidden| is_hidden);
        for (k, (node, place)) in root.nodes.iter().zip(&places).enumerate() {
            let (Some(mesh), Some(place)) = (node.mesh, place) else { continue };
            if place.is_hidden && !all_hidden {
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
            let transform = if skin.is_some() { DAffine3::IDENTITY } else { place.world };
            placements.push(Placement { mesh: mesh.value(), node: Some(k), skin, transform });
        }
        if root.nodes.iter().all(|node| node.mesh.is_none()) {
            let alone = |mesh| Placement { mesh, node: None, skin: None, transform: DAffine3::IDENTITY };
            placements.extend((0..root.meshes.len()).map(alone));
        } else if placements.is_empty() {
            let scene = root.scene.map_or(0, |scene| scene.value());
            return Err(Fault::invalid(format!(
                "has meshes, but none in the scene that it shows, scene {scene}; make the scene with the mesh the \
                 active one and export again"
            )));
        }
        Ok(Self { placements, places })
    }

    /// From a node's space to the world's.
    pub(super) fn world(&self, node: usize) -> Result<&DAffine3, Fault> {
        let place = item(&self.places, "node", node)?.as_ref();
        place.map(|place| &place.world).ok_or_else(|| {
            Fault::unsupported(format!("node {node} moves a skin but is not in the scene; export the mesh again"))
        })
    }
}

/// Where the nodes of the default scene are.
fn places(root: &Root) -> Result<Vec<Option<Place>>, Fault> {
    let mut places: Vec<Option<Place>> = root.nodes.iter().map(|_| None).collect();
    let mut open: Vec<_> = roots(root)?.into_iter().map(|node| (node, None)).collect();
    while let Some((index, parent)) = open.pop() {
        let node = item(&root.nodes, "node", index)?;
        if places[index].is_some() {
            return Err(Fault::damaged(format!(
                "node {index} is reached twice, but nodes make a tree; export the mesh again"
            )));
        }
        let above = parent.and_then(|parent: usize| places[parent].as_ref());
        let place = Place {
            world: above.map_or(DAffine3::IDENTITY, |above| above.world) * local(node),
            parent,
            depth: 1 + above.map_or(0, |above| above.depth),
            is_hidden: above.is_some_and(|above| above.is_hidden) || hides(node),
        };
        places[index] = Some(place);
        open.extend(children(node).map(|child| (child, Some(index))));
    }
    Ok(places)
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
    if root.scene.is_some() || !root.scenes.is_empty() {
        return Ok(item(&root.scenes, "scene", scene)?.nodes.iter().map(Index::value).collect());
    }
    let below: HashSet<usize> = root.nodes.iter().flat_map(children).collect();
    Ok((0..root.nodes.len()).filter(|node| !below.contains(node)).collect())
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
