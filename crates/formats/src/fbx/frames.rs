//! The meshes of a scene, one after another, frame by frame.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use cager_geometry::mesh::Model;
use cager_geometry::surface::{Part, Surface};
use cager_geometry::units::Units;
use ufbx::{Anim, Node};

use super::animation::{choose, is_hidden, shown_in, timeline};
use super::load::Scene;
use super::material::Materials;
use super::part::Kept;
use super::tree::Nodes;
use crate::dropped::Dropped;
use crate::error::{Error, Fault};
use crate::frames::{FrameReader, FrameSelection};
use crate::scene::{self, Animation, MeshInfo, Timeline, Tree, Wanted, path};

/// Opens the frames of the meshes that are selected.
pub(crate) fn open_frames<'a>(
    path: &Path,
    source: (impl Read + Seek, u64),
    expected_points: usize,
    selection: &FrameSelection,
    folder: Option<&Path>,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let open = || {
        let scene = Scene::load(&read_all(source)?, folder, false)?;
        let parts = selection.rest.as_ref().map_or(&[][..], |rest| &rest.surface.parts);
        let wanted = Wanted { prims: &selection.prims, points: Some(expected_points), parts };
        MeshFrames::open(scene, wanted, selection, None)
    };
    scene::open(path, open().map_err(|failure: Fault| failure.at(path))?, expected_points)
}

/// The first frame with what lies on its faces, how many faces were left out that have fewer than
/// three corners, and what is not read.
pub(crate) fn read(
    path: &Path,
    source: (impl Read + Seek, u64),
    wanted: Wanted<'_>,
    folder: Option<&Path>,
) -> Result<(Model, usize, Units, Dropped), Error> {
    let (mut surface, mut dropped, mut values) = (Surface::default(), Dropped::default(), Vec::new());
    let open = || {
        let scene = Scene::load(&read_all(source)?, folder, true)?;
        MeshFrames::open(scene, wanted, &FrameSelection::default(), Some((&mut surface, &mut dropped)))
    };
    let mut frames = open().map_err(|failure: Fault| failure.at(path))?;
    let (units, points, left_out) = (frames.info.units, frames.info.points, frames.left_out);
    let faces = std::mem::take(&mut frames.info.faces);
    scene::open(path, frames, points)?.read_next(&mut values)?;
    Ok((Model { points: values.as_chunks().0.to_vec(), faces, surface, ..Model::default() }, left_out, units, dropped))
}

fn read_all((mut source, length): (impl Read + Seek, u64)) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    source.seek(SeekFrom::Start(0))?;
    source.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

struct MeshFrames {
    scene: Scene,
    /// Numbers of the chosen nodes in the scene, and the points of each.
    chosen: Vec<(usize, usize)>,
    /// Number of the animation in the scene.
    stack: Option<usize>,
    /// Seconds of each frame.
    at: Vec<f64>,
    /// Faces of fewer than three corners.
    left_out: usize,
    info: MeshInfo,
}

impl MeshFrames {
    /// Fills in what lies on the faces, where that is wanted.
    fn open(
        scene: Scene,
        wanted: Wanted<'_>,
        selection: &FrameSelection,
        mut all: Option<(&mut Surface, &mut Dropped)>,
    ) -> Result<Self, Fault> {
        let (stack, others) = choose(&scene.root, selection.animation.as_deref())?;
        let Timeline { times, at } = timeline(&scene.root, stack, selection.rate)?;
        let mut nodes = Nodes::of(&scene);
        let (meshes, hidden) = nodes.choose(wanted, |nodes, mesh| is_hidden(stack, nodes.above(mesh)))?;
        let mut info = MeshInfo { frames: at.len(), times, units: scene.units, ..MeshInfo::default() };
        info.notes.extend([others, hidden, scene.note.clone()].into_iter().flatten());
        let anim = stack.map_or(&*scene.root.anim, |stack| &*stack.anim);
        let (mut chosen, mut left_out, mut materials) = (Vec::new(), 0, Materials::default());
        let first = scene.at(anim, at[0])?;
        for &number in &meshes {
            let Some(mesh) = nodes.mesh(number) else { continue };
            let node = nodes.stored(number);
            let name = path(nodes.nodes(), number);
            let now = first.nodes.as_ref().get(node.element.typed_id as usize);
            let kept = Kept::of(mesh, now.is_some_and(|now| is_mirrored(now))).map_err(|fault| fault.within(&name))?;
            left_out += mesh.num_faces - kept.faces.len();
            kept.add_to(&mut info.faces, info.points as u32);
            let above: Vec<&Node> = nodes.above(number).collect();
            info.shown.push(shown_in(anim, stack, &above, &at));
            if mesh.cache_deformers.iter().any(|cache| cache.external_channel.is_none()) {
                info.notes.push(format!(
                    "{name} is moved by a geometry cache that is not there, and is read without it; put its .xml and \
                     .mcx files beside the scene"
                ));
            }
            if let Some((surface, dropped)) = &mut all {
                if mesh.face_hole.iter().any(|&is_hole| is_hole) {
                    dropped.add("holes");
                }
                if mesh.vertex_crease.exists {
                    dropped.add("creases of points");
                }
                let materials = materials.of_faces(node, mesh, &kept.faces);
                surface.parts.push(Part { path: name, materials, ..kept.part(mesh) });
            }
            chosen.push((node.element.typed_id as usize, mesh.num_vertices));
            info.points += mesh.num_vertices;
        }
        if info.shown.iter().all(Option::is_none) {
            info.shown.clear();
        }
        if let Some((surface, _)) = all {
            (surface.materials, surface.pictures) = (materials.list, materials.pictures);
        }
        let stack = stack.map(|stack| stack.element.typed_id as usize);
        drop(first);
        Ok(Self { scene, chosen, stack, at, left_out, info })
    }
}

/// Whether faces are seen from behind where a node puts them.
fn is_mirrored(node: &Node) -> bool {
    ufbx::matrix_determinant(&node.geometry_to_world) < 0.0
}

impl Animation for MeshFrames {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Fault> {
        out.clear();
        let stored = &self.scene.root;
        let anim: &Anim = match self.stack.and_then(|stack| stored.anim_stacks.as_ref().get(stack)) {
            Some(stack) => &stack.anim,
            None => &stored.anim,
        };
        let scene = self.scene.at(anim, self.at[frame])?;
        for &(number, points) in &self.chosen {
            let node = scene.nodes.as_ref().get(number);
            let Some((node, mesh)) = node.and_then(|node| Some((node, node.mesh.as_deref()?))) else {
                return Ok(false);
            };
            let positions = mesh.skinned_position.values.as_ref().get(..points).unwrap_or_default();
            for &position in positions {
                let place = &node.geometry_to_world;
                let at = if mesh.skinned_is_local { ufbx::transform_position(place, position) } else { position };
                out.extend([at.x, at.y, at.z]);
            }
        }
        Ok(out.len() == 3 * self.info.points && out.iter().all(|x| x.is_finite()))
    }
}
