//! Skeletons and their motion in Biovision's BVH files: read, posed, written.
//!
//! A file is a tree of joints, each with an offset from its parent and a list of channels, and one row of channel values for each frame. Angles are
//! degrees; a joint's rotation is the product of those of its channels in the order of the file. Lengths are in the unit of the file.

mod hierarchy;
mod kinematics;
mod motion;
mod write;

pub use kinematics::JointPose;
pub use write::{bvh_bytes, write_bvh};

use crate::error::Error;
use crate::signature::Signature;
use crate::text::{Lines, words};
use cager_geometry::mesh::Point;
use std::path::Path;

/// What one value of a frame moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The position along axis 0, 1 or 2, which replaces that of the offset.
    Position(u8),
    /// The angle about axis 0, 1 or 2, in degrees.
    Rotation(u8),
}

/// A joint of a [`Skeleton`].
#[derive(Clone, Debug, PartialEq)]
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

/// Reads a BVH file.
///
/// # Errors
/// See [`Error`]; its message names the line: a file that ends early, braces that do not match, channels that are unknown, two joints of one name,
/// values that are not numbers or not finite, or too few or many of them.
pub fn read_bvh(path: impl AsRef<Path>) -> Result<Clip, Error> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|cause| Error::read(path, cause))?;
    read_bvh_bytes(path, &bytes)
}

/// As [`read_bvh`], of bytes; `name` stands for the file in messages.
///
/// # Errors
/// As [`read_bvh`].
pub fn read_bvh_bytes(name: &Path, bytes: &[u8]) -> Result<Clip, Error> {
    let mut text = Words { lines: Lines::new(bytes), line: &[] };
    let clip = hierarchy::read(&mut text).and_then(|skeleton| {
        let motion = motion::read(&mut text, skeleton.channels())?;
        Ok(Clip { skeleton, motion })
    });
    clip.map_err(|fault| Signature::other_than("bvh", bytes).map_or(fault, crate::error::Fault::damaged).at(name))
}

/// The words of a text one after the other, over the ends of lines.
struct Words<'a> {
    lines: Lines<'a>,
    /// What is left of the present line.
    line: &'a [u8],
}

impl<'a> Words<'a> {
    /// The next word; `None` at the end.
    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            if let Some(word) = words(self.line).next() {
                let start = self.line.iter().position(|b| !b.is_ascii_whitespace())?;
                self.line = &self.line[start + word.len()..];
                return Some(word);
            }
            self.line = self.lines.next()?;
        }
    }

    /// What is left of the present line; nothing is left afterwards.
    fn rest_of_line(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.line).trim_ascii()
    }

    /// Number of the present line, from 1.
    fn number(&self) -> usize {
        self.lines.number()
    }
}
