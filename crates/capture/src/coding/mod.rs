//! Coded frames: the steps of cages and residual for a goal, and groups as a container holds them.
//!
//! One number, the step of the residual, decides a file's size and error. A step of the cage that
//! moves all points by as much in the root mean square costs as much per binary digit; how far
//! apart the two are best is measured on frames of the first group, and so is the step that meets
//! an error or a size.

mod cage_size;
mod error;
mod goal;
mod group;
mod inversion;
mod meshes;
mod model;
mod steps;

pub use cage_size::suited_cage_size;
pub use error::{CodingError, Farthest};
pub(crate) use goal::BYTES_PER_POSITION;
pub use goal::{Carried, Goal, Room, group_frames, slack};
pub use group::{CodedGroup, GroupCoder};
pub use inversion::InversionChoices;
pub use meshes::RestMeshes;
pub use model::GroupDecoder;
pub(crate) use model::GroupSpace;
