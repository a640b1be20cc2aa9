//! Rest pose and cage on a grid.

use super::goal::Goal;
use cager_codec::CodedMesh;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_geometry::mesh::{Model, Point, TriMesh, diagonal};
use cager_geometry::spatial::{outside, self_intersections};
use cager_proto::container::colors_bytes;

/// Points of the rest pose by which cages are checked, at most.
const CHECKED_POINTS: usize = 1 << 13;

/// The meshes at rest as a coded file holds them.
pub struct RestMeshes {
    /// The rest pose.
    pub rest: CodedMesh,
    /// The cage.
    pub cage: CodedMesh,
    /// The cage as it is decoded.
    pub checked: Cage,
}

impl RestMeshes {
    /// On a grid fine enough for the goal. `None` where they would not be valid there and are
    /// stored as they are.
    pub fn new(goal: Goal, rest: &Model, cage: &Cage, system: &dyn CoordinateSystem) -> Option<Self> {
        let diagonal = diagonal(&rest.points);
        let (step, rest) = coded_rest(goal, rest, diagonal)?;
        let (cage, checked) = coded_cage(cage, step, diagonal, &rest.mesh.points, system)?;
        Some(Self { rest, cage, checked })
    }
}

/// About what rest pose and cage take, before there is one.
pub(super) fn meshes_bytes(goal: Goal, rest: &Model) -> Option<u64> {
    let (_, coded) = coded_rest(goal, rest, diagonal(&rest.points))?;
    Some((coded.bytes() + coded.bytes() / 5 + colors_bytes(&rest.colors)) as u64)
}

/// The step, over the diagonal, and the rest pose in it.
fn coded_rest(goal: Goal, rest: &Model, diagonal: f64) -> Option<(f64, CodedMesh)> {
    let coded = |step: f64| Some((step, CodedMesh::new(rest, step * diagonal).ok()?));
    match goal {
        // Measured: rest pose and frames together are smallest here.
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

/// The cage on a grid as coarse as the rest pose's, if it is as sound there: no more
/// faces cut each other, and no more points lie outside.
fn coded_cage(
    cage: &Cage,
    step: f64,
    diagonal: f64,
    rest: &[Point],
    system: &dyn CoordinateSystem,
) -> Option<(CodedMesh, Cage)> {
    let model = Model::from(cage.mesh().clone());
    let checked = |coded: CodedMesh| {
        let triangles = coded.mesh.faces.triangulated();
        let checked = Cage::new(TriMesh { vertices: coded.mesh.points.clone(), triangles }).ok()?;
        let checked = checked.with_carriers(cage.carriers().to_vec()).ok()?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::coordinates::MeanValue;

    /// A box with a point at each corner.
    fn corners(size: [f64; 3]) -> Vec<Point> {
        (0..8).map(|k| std::array::from_fn(|axis| if k >> axis & 1 == 1 { size[axis] } else { 0.0 })).collect()
    }

    #[test]
    fn a_cage_close_to_its_model_keeps_every_point_inside() {
        const SIDES: [[u32; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[u32; 3]> = SIDES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mut finer = 0;
        for k in 0..40 {
            let size = [1.0 + 0.0011 * f64::from(k), 0.9 + 0.0007 * f64::from(k), 0.8 + 0.0003 * f64::from(k)];
            let rest = Model { points: corners(size), ..Model::default() };
            // A ten thousandth around the model, where steps are a thousandth.
            let around = |p: &Point| std::array::from_fn(|axis| p[axis] + if p[axis] > 0.0 { 1e-4 } else { -1e-4 });
            let vertices: Vec<Point> = rest.points.iter().map(around).collect();
            let cage = Cage::new(TriMesh { vertices, triangles: triangles.clone() }).unwrap();
            let unit = diagonal(&rest.points);
            let (coded, checked) = coded_cage(&cage, 1e-3, unit, &rest.points, &MeanValue).unwrap();
            assert!(outside(checked.mesh(), &rest.points).is_empty(), "{k}");
            let moved = |(a, b): (&Point, &Point)| (0..3).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f64::max);
            let farthest = coded.mesh.points.iter().zip(cage.vertices()).map(moved).fold(0.0, f64::max);
            finer += usize::from(farthest <= 0.5e-4 * unit + 1e-6);
        }
        assert!((1..40).contains(&finer), "{finer}");
    }
}
