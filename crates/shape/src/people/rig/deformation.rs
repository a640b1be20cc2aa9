//! The cage of a posed rig, and its derivatives (Duveau et al. 2012, §3 and Eq. 6).
//!
//! A pose has six numbers a quad, in the pelvis frame at rest: the position `p` of its joint and a
//! rotation vector `w`. With the placement of the pelvis, `G` and `t`, a corner with offset `u` is
//! at `v = G (p + exp(w) u) + t`.

use super::Rig;
use super::topology::{CAGE_VERTICES, QUADS, owner};
use crate::Similarity;
use crate::rotation::{exp, right_jacobian, skew};
use cager_geometry::mesh::Point;
use glam::{DMat3, DVec3};

/// Numbers of a pose.
pub const QUAD_UNKNOWNS: usize = 6 * QUADS;

/// A placement after a small turn about the origin of the pelvis frame and a small translation: the
/// step of [`Deformed::pull`]'s first six derivatives.
#[must_use]
pub(crate) fn stepped(placement: &Similarity, step: &[f64]) -> Similarity {
    let rotation = exp(DVec3::from_slice(&step[..3])) * placement.rotation;
    Similarity { rotation, translation: placement.translation + DVec3::from_slice(&step[3..6]), ..*placement }
}

/// The cage of a posed rig, with what its derivatives need.
#[derive(Clone, Debug)]
pub struct Deformed {
    /// The 86 vertices.
    pub vertices: Vec<Point>,
    rotation: DMat3,
    /// Of each vertex, its turned position from the pelvis frame's origin: `G (p + exp(w) u)`.
    arms: Vec<DVec3>,
    /// Of each vertex, its derivative by the rotation vector of its quad, transposed.
    by_rotation: Vec<DMat3>,
}

/// The cage of a rig in this pose, where the pelvis frame is placed without a factor.
///
/// # Panics
/// Where the pose does not have [`QUAD_UNKNOWNS`] numbers.
pub fn deform(rig: &Rig, pose: &[f64], placement: &Similarity) -> Deformed {
    assert_eq!(pose.len(), QUAD_UNKNOWNS, "six numbers for each quad");
    let g = placement.rotation;
    let quads: Vec<(DVec3, DMat3, DMat3)> = pose
        .chunks_exact(6)
        .map(|q| {
            let w = DVec3::from_slice(&q[3..]);
            (DVec3::from_slice(&q[..3]), exp(w), right_jacobian(w))
        })
        .collect();
    let mut deformed = Deformed {
        vertices: Vec::with_capacity(CAGE_VERTICES),
        rotation: g,
        arms: Vec::with_capacity(CAGE_VERTICES),
        by_rotation: Vec::with_capacity(CAGE_VERTICES),
    };
    let corners = rig.quads.iter().flat_map(|quad| quad.corners).chain(rig.crotch);
    for (vertex, corner) in corners.enumerate() {
        let quad = owner(vertex);
        let (position, turn, jacobian) = &quads[quad];
        let offset = DVec3::from(corner) - DVec3::from(rig.quads[quad].joint);
        let arm = g * (*position + *turn * offset);
        deformed.vertices.push((arm + placement.translation).to_array());
        deformed.arms.push(arm);
        deformed.by_rotation.push(-(g * *turn * skew(offset) * *jacobian).transpose());
    }
    deformed
}

impl Deformed {
    /// Derivatives of `Σ row · v`, by the placement (turn, then translation) and the pose.
    pub fn pull(&self, row: &[f64], out: &mut [f64]) {
        let (place, pose) = out.split_at_mut(6);
        let back = self.rotation.transpose();
        let (mut turn, mut shift) = (DVec3::ZERO, DVec3::ZERO);
        let mut by_position = [DVec3::ZERO; QUADS];
        let mut by_rotation = [DVec3::ZERO; QUADS];
        for ((vertex, a), (arm, by)) in row.chunks_exact(3).enumerate().zip(self.arms.iter().zip(&self.by_rotation)) {
            let (a, quad) = (DVec3::from_slice(a), owner(vertex));
            turn += arm.cross(a);
            shift += a;
            by_position[quad] += a;
            by_rotation[quad] += *by * a;
        }
        place[..3].copy_from_slice(&turn.to_array());
        place[3..].copy_from_slice(&shift.to_array());
        for (out, (position, rotation)) in pose.chunks_exact_mut(6).zip(by_position.iter().zip(&by_rotation)) {
            out[..3].copy_from_slice(&(back * *position).to_array());
            out[3..].copy_from_slice(&rotation.to_array());
        }
    }
}
