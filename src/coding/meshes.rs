//! Rest pose and cage on a grid.

use super::Goal;
use cager_cages::geometry::{outside, self_intersections};
use cager_codec::CodedMesh;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::mesh::{Model, Point, TriMesh, diagonal};
use cager_proto::container::colors_bytes;

/// Points of the rest pose by which cages are checked, at most.
const CHECKED_POINTS: usize = 1 << 13;

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
        let (step, rest) = coded_rest(goal, rest, diagonal)?;
        let (cage, checked) = coded_cage(cage, step, diagonal, &rest.mesh.points, system)?;
        Some(Self { rest, cage, checked })
    }
}

/// The step, over the diagonal, and the rest pose in it.
fn coded_rest(goal: Goal, rest: &Model, diagonal: f64) -> Option<(f64, CodedMesh)> {
    let coded = |step: f64| Some((step, CodedMesh::new(rest, step * diagonal).ok()?));
    match goal {
        // What it adds to the error is paid for by finer steps of the frames, or by the residual: measured, this is where both together are smallest.
        Goal::MaxError(error) => coded((0.4 * error).min(1e-3)),
        Goal::MeanError(error) => coded((0.8 * error).min(1e-3)),
        Goal::Preview => coded(5e-4),
        Goal::Standard => coded(3e-4),
        Goal::Size(bytes) => {
            // A third of the file, if that is not too coarse.
            let most = bytes.saturating_sub(colors_bytes(&rest.colors) as u64) / 3;
            let mut last: Option<(f64, CodedMesh)> = None;
            for step in [5e-5, 1e-4, 2e-4, 4e-4, 8e-4] {
                last = match &last {
                    Some((_, mesh)) => mesh.in_steps(rest, step * diagonal).ok().map(|mesh| (step, mesh)),
                    None => coded(step),
                };
                if last.as_ref().is_some_and(|(_, mesh)| mesh.bytes() as u64 <= most) {
                    break;
                }
            }
            last
        }
    }
}

/// The cage on a grid. Frames have cages of their own, so the one at rest need not be where it was more exactly than the rest pose is, if it is as sound there: no more
/// faces cut each other, and no more points lie outside.
fn coded_cage(
    cage: &Cage,
    step: f64,
    diagonal: f64,
    rest: &[Point],
    system: &dyn CoordinateSystem,
) -> Option<(CodedMesh, Cage)> {
    let mesh = cage.mesh();
    let mut model = Model { points: mesh.vertices.clone(), ..Model::default() };
    mesh.triangles.iter().for_each(|triangle| model.faces.push(triangle));
    let checked = |coded: CodedMesh| {
        let triangles = coded.mesh.faces.triangulated();
        let checked = Cage::new(TriMesh { vertices: coded.mesh.points.clone(), triangles }).ok()?;
        system.check(&checked, rest).ok()?;
        Some((coded, checked))
    };
    let sample: Vec<Point> = rest.iter().step_by(rest.len().div_ceil(CHECKED_POINTS).max(1)).copied().collect();
    let faults = |cage: &Cage| [self_intersections(cage.mesh()).len(), outside(cage.mesh(), &sample).len()];
    let coarse = CodedMesh::new(&model, step * diagonal).ok()?;
    let fine_step = (0.25 * step).min(1e-4) * diagonal;
    let is_sound = |(_, coarse): &(CodedMesh, Cage)| {
        let (now, before) = rayon::join(|| faults(coarse), || faults(cage));
        now.iter().zip(before).all(|(now, before)| *now <= before)
    };
    let fine = || checked(coarse.in_steps(&model, fine_step).ok()?);
    checked(coarse.clone()).filter(is_sound).or_else(fine)
}
