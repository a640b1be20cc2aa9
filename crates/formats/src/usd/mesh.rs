//! What a layer says of meshes and the transforms above them.

use cager_geometry::surface::{Part, Picture};
use cager_geometry::units::{Units, Up};

use super::choice::{choose, visible};
use super::layer::{Layer, Stage};
use super::materials::Materials;
use super::skel::Rigs;
use super::timing::timeline;
use super::unread::Unread;
use super::{surface, transform};
use crate::dropped::Dropped;
use crate::error::Fault;
use crate::scene::{Deformer, MeshTracks, MovingScene, SceneTracks, Visibility, Wanted, path};

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
    let mut visibility = Visibility::default();
    let mut tracks = SceneTracks { notes, units: units(&layer.stage), ..SceneTracks::default() };
    let mut rigs = Rigs::default();
    for &prim in &prims {
        let name = path(&layer.nodes, prim);
        let named = |fault: Fault| if prims.len() > 1 { fault.within(&name) } else { fault };
        let mut mesh = read_mesh(&mut layer, prim, &mut rigs).map_err(named)?;
        mesh.shown = visible(&mut layer, prim, &mut visibility).map_err(named)?;
        tracks.meshes.push(mesh);
    }
    let of_mesh = |mesh: &MeshTracks| {
        let moved = mesh.chain.moving().flatten();
        let deformed = mesh.deformer.as_ref().map_or(Vec::new(), |deformer| deformer.times());
        mesh.positions.times.iter().chain(moved).copied().chain(deformed).collect::<Vec<f64>>()
    };
    tracks.timeline = timeline(&layer.stage, tracks.meshes.iter().flat_map(of_mesh).collect())?;
    if let Some((dropped, pictures)) = model {
        tracks.timeline.at.truncate(1);
        let (mut materials, mut unread) = (Materials::new(&layer), Unread::default());
        for (&prim, mesh) in prims.iter().zip(&mut tracks.meshes) {
            // What cannot be read is no reason to refuse a mesh.
            let read = surface::read(&mut layer, prim, &mut materials, mesh).unwrap_or_default();
            unread.take(&mut layer, prim, mesh, &read);
        }
        unread.tell(materials.names_alone, dropped);
        (tracks.materials, tracks.pictures) = (materials.list, pictures);
    } else {
        // What cannot be read is no reason to refuse a capture.
        tracks.sequences = Materials::sequences(&mut layer, &prims, &tracks.timeline.at).unwrap_or_default();
    }
    MovingScene::new(layer.source, tracks)
}

fn read_mesh(layer: &mut Layer<'_>, prim: usize, rigs: &mut Rigs) -> Result<MeshTracks, Fault> {
    let mut attribute = |name| layer.attribute(prim, name);
    let positions = attribute("points")?;
    let faces = [attribute("faceVertexCounts")?, attribute("faceVertexIndices")?];
    let is_clockwise = layer.tokens(prim, "orientation", 1)?.is_some_and(|told| told == ["leftHanded"]);
    // Points that move are where a skeleton has taken them.
    let still = positions.default.filter(|_| positions.times.is_empty());
    let points = still.map(|value| layer.source.points(value)).transpose()?;
    let bound = match points.filter(|points| points.count > 0) {
        Some(points) => rigs.bind(layer, prim, points.count)?,
        None => None,
    };
    let chain = transform::above(layer, bound.as_ref().map_or(prim, |bound| bound.space))?;
    let is_mirrored = bound.as_ref().is_some_and(|bound| bound.is_mirrored);
    let deformer = bound.map(|bound| Box::new(bound.skin) as Box<dyn Deformer>);
    let part = Part { path: path(&layer.nodes, prim), ..Part::default() };
    Ok(MeshTracks { positions, faces, is_clockwise, is_mirrored, deformer, chain, part, ..MeshTracks::default() })
}

pub(super) fn units(stage: &Stage) -> Units {
    let unit = stage.metres_per_unit.filter(|&unit| Units::is_length(unit));
    if unit.is_none() && stage.up_is_z.is_none() {
        return Units::UNKNOWN;
    }
    Units::new(if stage.up_is_z == Some(true) { Up::Z } else { Up::Y }, unit.unwrap_or(USUAL_UNIT))
}
