//! What a layer says of one mesh and the transforms above it.

use cager_geometry::units::{Units, Up};

use super::choice::choose;
use super::layer::{Layer, Stage};
use super::timing::timeline;
use super::{transform, unread};
use crate::dropped::Dropped;
use crate::error::Fault;
use crate::scene::{MeshTracks, MovingMesh};

/// The unit of layers that do not say theirs: a centimetre.
const USUAL_UNIT: f64 = 0.01;

/// Opens the mesh that `prim` names, or the only one; of its first frame alone, whatever moves it,
/// where what is not read is to be told.
pub(super) fn open<'a>(
    mut layer: Layer<'a>,
    prim: Option<&str>,
    dropped: Option<&mut Dropped>,
) -> Result<MovingMesh<'a>, Fault> {
    let (mesh, note) = choose(&mut layer, prim)?;
    let notes = note.into_iter().chain(unread::visibility(&mut layer, mesh).unwrap_or_default()).collect();
    let mut attribute = |name| layer.attribute(mesh, name);
    let positions = attribute("points")?;
    let faces = [attribute("faceVertexCounts")?, attribute("faceVertexIndices")?];
    for (name, mover) in [("primvars:skel:jointIndices", "a skeleton moves"), ("skel:blendShapes", "blend shapes move")]
    {
        if dropped.is_none() && positions.times.is_empty() && !attribute(name)?.is_empty() {
            let what =
                format!("has a mesh that {mover}, which is not read; export it with its points baked, or as Alembic");
            return Err(Fault::unsupported(what));
        }
    }
    let chain = transform::above(&mut layer, mesh)?;
    let samples = positions.times.iter().chain(chain.moving().flatten()).copied().collect();
    let mut timeline = timeline(&layer.stage, samples)?;
    let is_clockwise = layer.tokens(mesh, "orientation", 1)?.is_some_and(|told| told == ["leftHanded"]);
    if let Some(dropped) = dropped {
        timeline.at.truncate(1);
        // What cannot be named is no reason to refuse a mesh.
        unread::add(&mut layer, mesh, dropped).unwrap_or_default();
    }
    let units = units(&layer.stage);
    MovingMesh::new(layer.source, MeshTracks { positions, faces, is_clockwise, chain, timeline, units, notes })
}

fn units(stage: &Stage) -> Units {
    let unit = stage.metres_per_unit.filter(|&unit| Units::is_length(unit));
    if unit.is_none() && stage.up_is_z.is_none() {
        return Units::UNKNOWN;
    }
    Units::new(if stage.up_is_z == Some(true) { Up::Z } else { Up::Y }, unit.unwrap_or(USUAL_UNIT))
}
