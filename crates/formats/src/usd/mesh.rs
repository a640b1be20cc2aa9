//! What a layer says of meshes and the transforms above them.

use std::collections::HashSet;

use cager_geometry::surface::{Part, Picture};
use cager_geometry::units::{Units, Up};

use super::choice::choose;
use super::layer::{Layer, Stage};
use super::materials::Materials;
use super::timing::timeline;
use super::unread::Unread;
use super::{surface, transform};
use crate::dropped::Dropped;
use crate::error::Fault;
use crate::scene::{MeshTracks, MovingScene, SceneTracks, Steps, Track, Wanted, ancestry, path};

/// The unit of layers that do not say theirs: a centimetre.
const USUAL_UNIT: f64 = 0.01;

/// Opens the meshes that are wanted; of their first frame alone, whatever moves them, and with the
/// `pictures` in the file, where what is not read is to be told.
pub(super) fn open<'a>(
    mut layer: Layer<'a>,
    wanted: Wanted<'_>,
    model: Option<(&mut Dropped, Vec<Picture>)>,
) -> Result<MovingScene<'a>, Fault> {
    let (prims, notes) = choose(&mut layer, wanted)?;
    let mut tracks = SceneTracks { notes, units: units(&layer.stage), ..SceneTracks::default() };
    for &prim in &prims {
        let name = path(&layer.nodes, prim);
        let named = |fault: Fault| if prims.len() > 1 { fault.within(&name) } else { fault };
        tracks.meshes.push(read_mesh(&mut layer, prim, model.is_some()).map_err(named)?);
    }
    let of_mesh = |mesh: &MeshTracks| {
        let moved = mesh.chain.moving().flatten();
        mesh.positions.times.iter().chain(moved).copied().collect::<Vec<f64>>()
    };
    tracks.timeline = timeline(&layer.stage, tracks.meshes.iter().flat_map(of_mesh).collect())?;
    if let Some((dropped, mut pictures)) = model {
        tracks.timeline.at.truncate(1);
        let (mut materials, mut unread) = (Materials::new(&layer), Unread::default());
        for (&prim, mesh) in prims.iter().zip(&mut tracks.meshes) {
            // What cannot be read is no reason to refuse a mesh.
            let read = surface::read(&mut layer, prim, &mut materials, &mut mesh.part).unwrap_or_default();
            unread.take(&mut layer, prim, &mesh.part, &read);
        }
        unread.tell(materials.names_alone, dropped);
        pictures.retain(|picture| materials.names(&picture.path));
        (tracks.materials, tracks.pictures) = (materials.list, pictures);
    }
    MovingScene::new(layer.source, tracks)
}

fn read_mesh(layer: &mut Layer<'_>, prim: usize, is_still: bool) -> Result<MeshTracks, Fault> {
    let mut attribute = |name| layer.attribute(prim, name);
    let positions = attribute("points")?;
    let faces = [attribute("faceVertexCounts")?, attribute("faceVertexIndices")?];
    for (name, mover) in [("primvars:skel:jointIndices", "a skeleton moves"), ("skel:blendShapes", "blend shapes move")]
    {
        if !is_still && positions.times.is_empty() && !attribute(name)?.is_empty() {
            let what =
                format!("has a mesh that {mover}, which is not read; export it with its points baked, or as Alembic");
            return Err(Fault::unsupported(what));
        }
    }
    let chain = transform::above(layer, prim)?;
    let is_clockwise = layer.tokens(prim, "orientation", 1)?.is_some_and(|told| told == ["leftHanded"]);
    let part = Part { path: path(&layer.nodes, prim), ..Part::default() };
    Ok(MeshTracks { positions, faces, is_clockwise, chain, shown: visible(layer, prim)?, part })
}

/// When a prim is shown: what is invisible hides all below it.
fn visible(layer: &mut Layer<'_>, prim: usize) -> Result<Steps, Fault> {
    let mut tracks = Vec::new();
    for prim in ancestry(&layer.nodes, prim).collect::<Vec<_>>() {
        let track = layer.attribute(prim, "visibility")?;
        let mut hidden = HashSet::new();
        for value in track.values.iter().chain(&track.default) {
            if layer.source.tokens(*value, 1)? == ["invisible"] {
                hidden.insert(value.0);
            }
        }
        if !hidden.is_empty() {
            tracks.push((track, hidden));
        }
    }
    let times = tracks.iter().flat_map(|(track, _)| track.times.iter().copied().chain(track.default.map(|_| 0.0)));
    Steps::of(times.collect(), |time| {
        let is_hidden = |(track, hidden): &(Track, HashSet<u64>)| {
            track.at(time).is_some_and(|(value, ..)| hidden.contains(&value.0))
        };
        Ok(!tracks.iter().any(is_hidden))
    })
}

pub(super) fn units(stage: &Stage) -> Units {
    let unit = stage.metres_per_unit.filter(|&unit| Units::is_length(unit));
    if unit.is_none() && stage.up_is_z.is_none() {
        return Units::UNKNOWN;
    }
    Units::new(if stage.up_is_z == Some(true) { Up::Z } else { Up::Y }, unit.unwrap_or(USUAL_UNIT))
}
