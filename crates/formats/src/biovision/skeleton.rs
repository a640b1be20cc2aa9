//! Joints, how they move, and where they are: forward kinematics.

use cager_geometry::mesh::Point;
use glam::{DAffine3, DMat3};

/// What one value of a frame moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The position along axis 0, 1 or 2, which replaces that of the offset.
    Position(u8),
    /// The angle about axis 0, 1 or 2, in degrees.
    Rotation(u8),
}

/// A joint of a [`Skeleton`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Joint {
    /// Its name, of which there is one in a skeleton.
    pub name: String,
    /// The joint above it, which comes before it.
    pub parent: Option<usize>,
    /// From its parent, where all angles are zero.
    pub offset: Point,
    /// What its values move, in the order in which they are applied.
    pub channels: Vec<Channel>,
    /// Ends of bones without a joint, from this one.
    pub end_sites: Vec<Point>,
}

/// A tree of joints, each after its parent; the first is the root.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    /// The joints.
    pub joints: Vec<Joint>,
}

impl Skeleton {
    /// The number of the joint with this name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Values of a frame.
    pub fn channels(&self) -> usize {
        self.joints.iter().map(|joint| joint.channels.len()).sum()
    }

    /// From each joint's frame to that of the file under these values, in the order of joints.
    ///
    /// # Panics
    /// Where there are not as many values as channels.
    pub fn pose(&self, values: &[f64]) -> Vec<DAffine3> {
        assert_eq!(values.len(), self.channels(), "one value for each channel");
        let mut values = values.iter();
        let mut poses: Vec<DAffine3> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let mut pose = DAffine3::from_translation(joint.offset.into());
            for (channel, &value) in joint.channels.iter().zip(values.by_ref()) {
                match *channel {
                    Channel::Position(axis) => pose.translation[usize::from(axis)] = value,
                    Channel::Rotation(axis) => {
                        let about = [DMat3::from_rotation_x, DMat3::from_rotation_y, DMat3::from_rotation_z];
                        pose.matrix3 *= about[usize::from(axis)](value.to_radians());
                    }
                }
            }
            poses.push(joint.parent.map_or(pose, |parent| poses[parent] * pose));
        }
        poses
    }

    /// Every joint where all angles are zero and no position replaces an offset.
    pub fn zero_pose(&self) -> Vec<DAffine3> {
        let channels = self.joints.iter().flat_map(|joint| joint.channels.iter().map(move |channel| (joint, channel)));
        let value = |(joint, channel): (&Joint, &Channel)| match *channel {
            Channel::Position(axis) => joint.offset[usize::from(axis)],
            Channel::Rotation(_) => 0.0,
        };
        self.pose(&channels.map(value).collect::<Vec<_>>())
    }
}

/// Frames of a [`Skeleton`].
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Seconds from one frame to the next.
    pub frame_time: f64,
    /// Values of a frame.
    pub channels: usize,
    /// Those of all frames, back to back.
    pub values: Vec<f64>,
}

impl Motion {
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.values.len().checked_div(self.channels).unwrap_or(0)
    }

    /// The values of one frame, in the order of the joints and their channels.
    ///
    /// # Panics
    /// For a frame that there is not.
    pub fn frame(&self, frame: usize) -> &[f64] {
        &self.values[frame * self.channels..(frame + 1) * self.channels]
    }
}

/// A skeleton and its motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// The skeleton.
    pub skeleton: Skeleton,
    /// Its motion.
    pub motion: Motion,
}
