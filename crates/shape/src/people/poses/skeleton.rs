//! Poses of a rig from those of a skeleton.
//!
//! Where all its angles are zero a skeleton need not stand as the rig does: each limb is first
//! turned to the skeleton's bone by the smallest rotation. Lengths are the rig's throughout.

use super::error::PoseError;
use super::names::Naming;
use crate::people::rig::{QUADS, Rig};
use crate::rotation::{between, halfway, log};
use cager_formats::biovision::Skeleton;
use glam::{DAffine3, DMat3, DVec3};

/// Bones by their place among [`super::BONES`].
const PELVIS: usize = 0;
const ABDOMEN: usize = 1;
const CHEST: usize = 2;
const HEAD: usize = 3;
/// Upper arm, forearm, hand, thigh, shin, foot of the left side; those of the right follow.
const SIDE: usize = 4;
const SIDE_BONES: usize = 6;

/// Quads at both ends of the bones of a side, left.
const SEGMENTS: [[usize; 2]; SIDE_BONES] = [[5, 6], [6, 7], [7, 8], [9, 10], [10, 11], [11, 12]];

/// Takes a rig along with a skeleton.
#[derive(Clone, Debug)]
pub struct SkeletonPoses {
    joints: Vec<(usize, Option<usize>)>,
    /// Of each bone, the rotation from the rig's to the skeleton's at zero angles, in its axes.
    alignments: Vec<DMat3>,
    /// From the skeleton's axes to the rig's.
    to_rig: DMat3,
    /// Joints of the rig, in its own axes.
    rest: Vec<DVec3>,
}

impl SkeletonPoses {
    /// Prepares a skeleton for a rig.
    ///
    /// # Errors
    /// See [`PoseError`].
    pub fn new(skeleton: &Skeleton, naming: &Naming, rig: &Rig) -> Result<Self, PoseError> {
        let joints = naming.joints(skeleton)?;
        let zero = skeleton.zero_pose();
        let at = |joint: usize| zero[joint].translation;
        let left = at(joints[SIDE + 3].0) - at(joints[SIDE + SIDE_BONES + 3].0);
        let up = at(joints[HEAD].0) - at(joints[PELVIS].0);
        let own = axes(nearest_axis(up), nearest_axis(left)).or_else(|| axes(up, left)).ok_or(PoseError::NoAxes)?;
        let of_rig = axes(rig.up.into(), rig.left().into()).ok_or(PoseError::NoAxes)?;
        let to_rig = of_rig * own.transpose();
        let rest: Vec<DVec3> = rig.quads.iter().map(|quad| quad.joint.into()).collect();
        let mut alignments = vec![DMat3::IDENTITY; joints.len()];
        for side in 0..2 {
            for (k, [from, to]) in SEGMENTS.into_iter().enumerate() {
                let bone = SIDE + side * SIDE_BONES + k;
                let (joint, end) = joints[bone];
                let Some(end) = end else { continue };
                let of_rig = to_rig.transpose() * (rest[on_side(to, side)] - rest[on_side(from, side)]);
                let of_skeleton = at(end) - at(joint);
                if of_skeleton.length() > 0.0 {
                    alignments[bone] = between(of_rig, of_skeleton);
                }
            }
        }
        Ok(Self { joints, alignments, to_rig, rest })
    }

    /// The pose of the rig that goes with these joints, see [`crate::people::rig::deform`].
    pub fn pose(&self, joints: &[DAffine3]) -> Vec<f64> {
        let world = |bone: usize| joints[self.joints[bone].0].matrix3 * self.alignments[bone];
        let pelvis = world(PELVIS).transpose();
        let turns: Vec<DMat3> =
            (0..self.joints.len()).map(|bone| self.to_rig * pelvis * world(bone) * self.to_rig.transpose()).collect();
        let mut position = [DVec3::ZERO; QUADS];
        let mut rotation = [DMat3::IDENTITY; QUADS];
        position[0] = self.rest[0];
        let chain = [(0, 1, PELVIS, ABDOMEN), (1, 2, ABDOMEN, CHEST), (2, 3, CHEST, HEAD)];
        for (from, to, bone, next) in chain {
            position[to] = position[from] + turns[bone] * (self.rest[to] - self.rest[from]);
            rotation[to] = halfway(turns[bone], turns[next]);
        }
        position[4] = position[3] + turns[HEAD] * (self.rest[4] - self.rest[3]);
        rotation[4] = turns[HEAD];
        for side in 0..2 {
            for (trunk, trunk_bone, first) in [(2, CHEST, 0), (0, PELVIS, 3)] {
                let (mut quad, mut above) = (trunk, trunk_bone);
                for k in first..first + 3 {
                    let bone = SIDE + side * SIDE_BONES + k;
                    let next = on_side(SEGMENTS[k][0], side);
                    position[next] = position[quad] + turns[above] * (self.rest[next] - self.rest[quad]);
                    rotation[next] = halfway(turns[above], turns[bone]);
                    (quad, above) = (next, bone);
                }
                let last = on_side(SEGMENTS[first + 2][1], side);
                position[last] = position[quad] + turns[above] * (self.rest[last] - self.rest[quad]);
                rotation[last] = turns[above];
            }
        }
        let numbers = |k: usize| position[k].to_array().into_iter().chain(log(rotation[k]).to_array());
        (0..QUADS).flat_map(numbers).collect()
    }
}

/// A quad on the left, or its counterpart on the right.
fn on_side(quad: usize, side: usize) -> usize {
    quad + 8 * side
}

/// Columns: left, up, forward.
fn axes(up: DVec3, left: DVec3) -> Option<DMat3> {
    let up = up.try_normalize()?;
    let left = left.reject_from_normalized(up).try_normalize()?;
    Some(DMat3::from_cols(left, up, left.cross(up)))
}

fn nearest_axis(a: DVec3) -> DVec3 {
    let k = a.abs().max_position();
    let mut axis = DVec3::ZERO;
    axis[k] = a[k].signum();
    axis
}
