//! The true joints of a capture.

#![allow(dead_code, unreachable_pub)]

use cager_geometry::linalg::nearest_rotation;
use cager_geometry::mesh::Point;
use cager_geometry::vector::distance;
use glam::{DMat3, DVec3};

use crate::common::{Capture, data, npy};

/// Left and right hips, knees, ankles, shoulders, elbows and wrists of anny's captures: heads of the limbs' bones.
pub const LIMBS: [usize; 12] = [2, 3, 4, 27, 28, 29, 10, 11, 12, 20, 21, 22];

/// Joints in every frame.
pub struct TrueJoints {
    joints: usize,
    values: Vec<f32>,
}

impl TrueJoints {
    pub fn of(capture: &str) -> Self {
        let (shape, values) = npy(&data().join(capture).join("joints.npy"));
        Self { joints: shape[1], values }
    }

    pub fn at(&self, frame: usize, joint: usize) -> Point {
        [0, 1, 2].map(|k| f64::from(self.values[(frame * self.joints + joint) * 3 + k]))
    }

    /// A joint in the rest pose: taken back by the rigid motions of the vertices around it.
    pub fn at_rest(&self, capture: &Capture, frames: &[usize], joint: usize) -> Point {
        let first = &capture.frames[frames[0]];
        let far = |v: usize| distance(first[v], self.at(frames[0], joint));
        let mut order: Vec<usize> = (0..first.len()).collect();
        order.sort_by(|&a, &b| far(a).total_cmp(&far(b)));
        let near = &order[..150];
        let mean = |all: &[Point]| near.iter().map(|&v| DVec3::from(all[v])).sum::<DVec3>() / near.len() as f64;
        let rest = &capture.rest.vertices;
        let to = mean(rest);
        let back = |&f: &usize| {
            let now = &capture.frames[f];
            let from = mean(now);
            let moment = near.iter().fold(DMat3::ZERO, |sum, &v| {
                let (a, b) = (DVec3::from(now[v]) - from, DVec3::from(rest[v]) - to);
                sum + DMat3::from_cols(b * a.x, b * a.y, b * a.z)
            });
            nearest_rotation(moment) * (DVec3::from(self.at(f, joint)) - from) + to
        };
        (frames.iter().map(back).sum::<DVec3>() / frames.len() as f64).to_array()
    }
}
