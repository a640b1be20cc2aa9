//! Paths of joints: taken along with the cage by coordinates in it (Duveau et al. 2012, §6.2).

use crate::points::{cage_values, row_points};
use crate::rotation::between;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, CoordinatesError, DependentNormals};
use cager_formats::biovision::{Channel, Joint, Motion, Skeleton, bvh_bytes};
use cager_geometry::linalg::product;
use cager_geometry::mesh::Point;
use faer::Mat;
use glam::{DMat3, DVec3, EulerRot};
use std::fmt::Write as _;

/// Joints of a template, with their names and the tree that they form.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedJoints {
    /// Their names.
    pub names: Vec<String>,
    /// The joint above each, which comes before it; the first has none.
    pub parents: Vec<Option<usize>>,
    /// Where they are at rest.
    pub positions: Vec<Point>,
}

/// Why joints cannot be followed.
#[derive(Debug, thiserror::Error)]
pub enum JointsError {
    /// Names, parents and positions differ in number, or there are none.
    #[error(
        "there are {names} names, {parents} parents and {positions} positions of joints; each joint needs all three"
    )]
    Counts {
        /// Names there are.
        names: usize,
        /// Parents there are.
        parents: usize,
        /// Positions there are.
        positions: usize,
    },
    /// A joint before its parent, or several roots.
    #[error("joint {0} does not come after its parent; list parents first, and one joint without one")]
    Order(usize),
    /// Joints for which the coordinates are not defined.
    #[error(transparent)]
    Coordinates(#[from] CoordinatesError),
}

impl MarkedJoints {
    /// The joints of a rig's quads.
    pub fn of_rig(rig: &crate::people::rig::Rig) -> Self {
        let mut parents = vec![None; rig.quads.len()];
        for [above, below] in crate::people::rig::BONES {
            parents[below] = Some(above);
        }
        Self {
            names: crate::people::rig::QUAD_NAMES.map(str::to_owned).to_vec(),
            parents,
            positions: rig.quads.iter().map(|quad| quad.joint).collect(),
        }
    }

    fn check(&self) -> Result<(), JointsError> {
        let (names, parents, positions) = (self.names.len(), self.parents.len(), self.positions.len());
        if names == 0 || names != parents || names != positions {
            return Err(JointsError::Counts { names, parents, positions });
        }
        let in_order = |(k, parent): (usize, &Option<usize>)| {
            if k == 0 { parent.is_none() } else { parent.is_some_and(|p| p < k) }
        };
        self.parents.iter().enumerate().position(|at| !in_order(at)).map_or(Ok(()), |k| Err(JointsError::Order(k)))
    }
}

/// Joints in a cage.
pub struct CagedJoints {
    joints: MarkedJoints,
    phi: Mat<f64>,
    normals: Option<DependentNormals>,
}

impl CagedJoints {
    /// The coordinates of joints in a cage.
    ///
    /// # Errors
    /// See [`JointsError`].
    pub fn new(joints: MarkedJoints, cage: &Cage, system: &dyn CoordinateSystem) -> Result<Self, JointsError> {
        joints.check()?;
        let phi = system.coordinates(cage, &joints.positions, None)?.phi;
        Ok(Self { joints, phi, normals: system.values(cage).dependent_normals })
    }

    /// Where the joints are under a cage: its vertices and, of free normals, these as well.
    pub fn positions(&self, vertices: &[Point]) -> Vec<Point> {
        let values = cage_values(self.normals.as_ref(), vertices);
        row_points(product(self.phi.as_ref(), values.as_ref()).as_ref())
    }

    /// A table of the paths: `frame,joint,x,y,z`, one line for each joint of each frame.
    pub fn csv(&self, numbers: &[f64], frames: &[Vec<Point>]) -> String {
        let mut text = String::from("frame,joint,x,y,z\n");
        for (number, frame) in numbers.iter().zip(frames) {
            for (name, [x, y, z]) in self.joints.names.iter().zip(frame) {
                let quoted = name.contains([',', '"', '\n']).then(|| format!("\"{}\"", name.replace('"', "\"\"")));
                let _ = writeln!(text, "{number},{},{x},{y},{z}", quoted.as_deref().unwrap_or(name));
            }
        }
        text
    }

    /// The paths as a BVH file. Joints turn by the smallest rotations that take their bones along,
    /// and have positions as well, since bones need not keep their lengths.
    pub fn bvh(&self, frames: &[Vec<Point>], frame_time: f64) -> Vec<u8> {
        let (skeleton, rest) = (self.skeleton(), &self.joints.positions);
        let first_below: Vec<Option<usize>> =
            (0..rest.len()).map(|k| self.joints.parents.iter().position(|parent| *parent == Some(k))).collect();
        let mut values = Vec::with_capacity(frames.len() * skeleton.channels());
        for frame in frames {
            let mut world: Vec<DMat3> = Vec::with_capacity(rest.len());
            for k in 0..rest.len() {
                let above = self.joints.parents[k].map_or(DMat3::IDENTITY, |parent| world[parent]);
                let bone = |at: &[Point], to: usize| DVec3::from(at[to]) - DVec3::from(at[k]);
                let own = first_below[k].map_or(above, |to| between(above * bone(rest, to), bone(frame, to)) * above);
                let from = self.joints.parents[k].map_or(DVec3::ZERO, |parent| frame[parent].into());
                let local = above.transpose() * (DVec3::from(frame[k]) - from);
                let (z, y, x) = (above.transpose() * own).to_euler(EulerRot::ZYX);
                values.extend([local.x, local.y, local.z, z.to_degrees(), y.to_degrees(), x.to_degrees()]);
                world.push(own);
            }
        }
        bvh_bytes(&skeleton, &Motion { frame_time, channels: skeleton.channels(), values })
    }

    fn skeleton(&self) -> Skeleton {
        let rest = &self.joints.positions;
        let channels = vec![
            Channel::Position(0),
            Channel::Position(1),
            Channel::Position(2),
            Channel::Rotation(2),
            Channel::Rotation(1),
            Channel::Rotation(0),
        ];
        let joint = |k: usize| {
            let parent = self.joints.parents[k];
            let from = parent.map_or([0.0; 3], |parent| rest[parent]);
            let leaf = !self.joints.parents.contains(&Some(k));
            Joint {
                name: self.joints.names[k].clone(),
                parent,
                offset: cager_geometry::vector::sub(rest[k], from),
                channels: channels.clone(),
                end_sites: if leaf { vec![[0.0; 3]] } else { Vec::new() },
            }
        };
        Skeleton { joints: (0..rest.len()).map(joint).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::people::tests::mannequin;
    use cager_core::coordinates::Green;
    use cager_formats::biovision::read_bvh_bytes;
    use std::path::Path;

    #[test]
    fn joints_leave_as_bvh_exactly_where_they_are() {
        let rig = mannequin();
        let cage = Cage::new(rig.cage()).unwrap();
        let joints = CagedJoints::new(MarkedJoints::of_rig(&rig), &cage, &Green::Consistent).unwrap();
        let bent = |p: &Point| [p[0] + 0.1 * p[1] * p[1], p[1] - 0.3 * p[2], p[2] + 0.2 * p[0]];
        let frames: Vec<Vec<Point>> = [cage.vertices().to_vec(), cage.vertices().iter().map(bent).collect()]
            .iter()
            .map(|vertices| joints.positions(vertices))
            .collect();
        for (found, marked) in frames[0].iter().zip(&rig.quads) {
            assert!((0..3).all(|k| (found[k] - marked.joint[k]).abs() < 1e-9), "{found:?} {marked:?}");
        }
        let clip = read_bvh_bytes(Path::new("joints.bvh"), &joints.bvh(&frames, 0.04)).unwrap();
        for (number, frame) in frames.iter().enumerate() {
            // Files list joints depth first.
            let poses = clip.skeleton.pose(clip.motion.frame(number));
            for (name, p) in joints.joints.names.iter().zip(frame) {
                let found = poses[clip.skeleton.joint(name).unwrap()].translation;
                assert!((0..3).all(|k| (found[k] - p[k]).abs() < 1e-9), "{name}: {found:?} {p:?}");
            }
        }
        let csv = joints.csv(&(0..frames.len()).map(|k| k as f64).collect::<Vec<_>>(), &frames);
        assert_eq!((csv.lines().count(), csv.lines().nth(1).unwrap().starts_with("0,pelvis,")), (2 * 21 + 1, true));
        let mut wrong = MarkedJoints::of_rig(&rig);
        wrong.parents[3] = Some(7);
        assert!(matches!(CagedJoints::new(wrong, &cage, &Green::Consistent), Err(JointsError::Order(3))));
    }
}
