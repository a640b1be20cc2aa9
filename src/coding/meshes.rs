//! Rest pose and cage on a grid.

use super::Goal;
use cager_codec::CodedMesh;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::mesh::{Model, TriMesh, diagonal};
use cager_proto::container::colors_bytes;

/// The meshes at rest as a coded file holds them.
pub(crate) struct RestMeshes {
    pub(crate) rest: CodedMesh,
    pub(crate) cage: CodedMesh,
    pub(crate) checked: Cage,
}

impl RestMeshes {
    /// On a grid fine enough for the goal. `None` where the cage or the points would not be valid there: the meshes are then stored as they are.
    pub(crate) fn new(goal: Goal, rest: &Model, cage: &Cage, system: &dyn CoordinateSystem) -> Option<Self> {
        let diagonal = diagonal(&rest.points);
        let coded = |step: f64| CodedMesh::new(rest, step * diagonal).ok();
        let (step, coded_rest) = match goal {
            Goal::MaxError(error) | Goal::MeanError(error) => {
                let step = (0.5 * error).min(1e-3);
                (step, coded(step)?)
            }
            Goal::Preview => (5e-4, coded(5e-4)?),
            Goal::Standard => (3e-4, coded(3e-4)?),
            Goal::Size(bytes) => {
                // A third of the file, if that is not too coarse.
                let bytes = bytes.saturating_sub(colors_bytes(&rest.colors) as u64);
                let fits = |mesh: &CodedMesh| mesh.bytes() as u64 <= bytes / 3;
                let steps = [5e-5, 1e-4, 2e-4, 4e-4, 8e-4].into_iter();
                let mut tried = steps.filter_map(|step| Some((step, coded(step)?)));
                let mut last = None;
                tried
                    .find(|found| {
                        last = Some(found.clone());
                        fits(&found.1)
                    })
                    .or(last)?
            }
        };
        let mesh = cage.mesh();
        let mut model = Model { points: mesh.vertices.clone(), ..Model::default() };
        mesh.triangles.iter().for_each(|triangle| model.faces.push(triangle));
        let cage = CodedMesh::new(&model, (0.25 * step).min(1e-4) * diagonal).ok()?;
        let triangles = cage.mesh.faces.triangulated();
        let checked = Cage::new(TriMesh { vertices: cage.mesh.points.clone(), triangles }).ok()?;
        system.check(&checked, &coded_rest.mesh.points).ok()?;
        Some(Self { rest: coded_rest, cage, checked })
    }
}
