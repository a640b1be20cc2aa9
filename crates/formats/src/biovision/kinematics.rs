//! Forward kinematics: where the joints of a skeleton are.

use super::skeleton::{Channel, Skeleton};
use cager_geometry::mesh::Point;
use cager_geometry::vector::add;

/// Where a joint is and how it is turned, in the frame of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPose {
    /// Its rotation, row by row.
    pub rotation: [Point; 3],
    /// Its position.
    pub position: Point,
}

impl JointPose {
    /// A point of the joint's own frame.
    pub fn at(&self, p: Point) -> Point {
        add(self.position, self.rotation.map(|row| cager_geometry::vector::dot(row, p)))
    }
}

impl Skeleton {
    /// Every joint under these values, in the order of the joints.
    ///
    /// # Panics
    /// Where there are not as many values as channels.
    pub fn pose(&self, values: &[f64]) -> Vec<JointPose> {
        assert_eq!(values.len(), self.channels(), "one value for each channel");
        let mut rest = values;
        let mut poses: Vec<JointPose> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let mut rotation = IDENTITY;
            let mut offset = joint.offset;
            for &channel in &joint.channels {
                let Some((&value, tail)) = rest.split_first() else { break };
                rest = tail;
                match channel {
                    Channel::Position(axis) => offset[axis as usize] = value,
                    Channel::Rotation(axis) => rotation = product(&rotation, &about(axis, value)),
                }
            }
            poses.push(match joint.parent {
                Some(parent) => {
                    let above = &poses[parent];
                    JointPose { rotation: product(&above.rotation, &rotation), position: above.at(offset) }
                }
                None => JointPose { rotation, position: offset },
            });
        }
        poses
    }

    /// Every joint where all angles are zero and no position replaces an offset.
    pub fn zero_pose(&self) -> Vec<JointPose> {
        let of_joint = |joint: &super::Joint| -> Vec<f64> {
            let value = |channel: &Channel| match channel {
                Channel::Position(axis) => joint.offset[*axis as usize],
                Channel::Rotation(_) => 0.0,
            };
            joint.channels.iter().map(value).collect()
        };
        let values: Vec<f64> = self.joints.iter().flat_map(of_joint).collect();
        self.pose(&values)
    }
}

const IDENTITY: [Point; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn about(axis: u8, degrees: f64) -> [Point; 3] {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let x = usize::from(axis);
    let (y, z) = ((x + 1) % 3, (x + 2) % 3);
    let mut rotation = IDENTITY;
    (rotation[y][y], rotation[y][z], rotation[z][y], rotation[z][z]) = (cosine, -sine, sine, cosine);
    rotation
}

fn product(a: &[Point; 3], b: &[Point; 3]) -> [Point; 3] {
    a.map(|row| [0, 1, 2].map(|j| row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]))
}
