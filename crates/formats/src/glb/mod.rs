//! glTF 2.0, binary or in several files: the triangles and points of its default scene, at rest and
//! as an animation moves them, and animations of one mesh written.
//!
//! The `gltf` crate has the types of the document; what it refers to is looked up here with checks,
//! as the crate's accessors and validation panic on indices out of range.

mod accessor;
mod alike;
mod buffers;
mod builder;
mod channel;
mod choice;
mod clip;
mod container;
mod document;
mod draco;
mod faults;
mod frames;
mod materials;
mod meshopt;
mod part;
mod scene;
mod skin;
mod unread;
mod write;

use std::collections::HashSet;

use cager_geometry::mesh::Model;
use cager_geometry::surface::{Picture, Surface};

use crate::dropped::Dropped;
use crate::error::Fault;
use crate::faces::Contents;
use buffers::Buffers;
pub(crate) use buffers::Source;
use builder::Builder;
pub(crate) use frames::{is_animated, open_frames};
use scene::Scene;
pub(crate) use write::{MOST_FRAMES, Morphs, Piece, Scene as MorphScene, Wanted, lost_pictures, write_head};

/// The pictures in the file that materials of a surface name.
fn pictures(buffers: &Buffers<'_>, surface: &Surface) -> Vec<Picture> {
    let names: HashSet<&str> =
        surface.materials.iter().flat_map(|found| &found.textures).map(|texture| texture.path.as_str()).collect();
    let mut found: Vec<Picture> = Vec::new();
    for embedded in buffers.materials.iter().flat_map(|look| &look.embedded) {
        let Some(view) = embedded.view.filter(|_| names.contains(embedded.path.as_str())) else { continue };
        let is_new = found.len() < MOST_PICTURES && found.iter().all(|picture| picture.path != embedded.path);
        // A picture that is not there is no reason to refuse a mesh.
        if is_new && let Ok((bytes, _)) = buffers.view(view, "a picture") {
            found.push(Picture { path: embedded.path.clone(), bytes: bytes.into() });
        }
    }
    found
}

/// Pictures that are taken of a file, so that many of the same bytes take little.
const MOST_PICTURES: usize = 256;

/// The meshes of the default scene at rest as one, or those of several that are named.
pub(crate) fn read(bytes: &[u8], source: &Source<'_>, prims: &[String]) -> Result<(Model, Dropped), Fault> {
    let buffers = Buffers::open(bytes, source)?;
    let scene = Scene::of(&buffers.root)?;
    let chosen = choice::choose(&buffers.root, &scene, prims)?;
    let placements = &scene.placements[chosen];
    let builder = Builder::new(&buffers, &scene, Contents::PointsAndFaces, source.is_split);
    let mut model = builder.build(placements)?.model;
    model.surface.pictures = pictures(&buffers, &model.surface);
    let dropped = unread::of(&buffers, placements, &model);
    Ok((model, dropped))
}
