//! Oriented-quads rigs (Duveau et al. 2012, §3): 21 rigid quads at the joints of a person, whose 84
//! corners and two vertices at the crotch are a cage.

mod correction;
mod deformation;
mod enclosure;
mod error;
mod file;
mod landmarks;
mod placement;
mod sections;
mod topology;

pub use correction::{Corrected, correct};
pub(crate) use deformation::stepped;
pub use deformation::{Deformed, QUAD_UNKNOWNS, deform};
pub(crate) use enclosure::extent;
pub use enclosure::{Enclosure, enclose};
pub use error::RigError;
pub use placement::{PlacedRig, PlacementOptions, place};
pub(crate) use topology::BONES;
pub use topology::{CAGE_FACES, CAGE_VERTICES, QUAD_NAMES, QUADS, owner, triangles};

use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::vector::cross;

/// A rigid quad of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// The joint that it turns about.
    pub joint: Point,
    /// Its corners as the person sees them: across the trunk front left, front right, back right,
    /// back left; across legs front outer, front inner, back inner, back outer; across arms lower
    /// front, lower back, upper back, upper front.
    pub corners: [Point; 4],
}

/// A rig in the rest pose of a template, in its coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The quads, in the order of [`QUAD_NAMES`].
    pub quads: Vec<Quad>,
    /// The vertices at the crotch, front and back, which belong to the pelvis.
    pub crotch: [Point; 2],
    /// Unit vector from the feet to the head.
    pub up: Point,
    /// Unit vector to where the person looks, orthogonal to `up`.
    pub forward: Point,
}

impl Rig {
    /// The cage at rest.
    pub fn cage(&self) -> TriMesh {
        let corners = self.quads.iter().flat_map(|quad| quad.corners);
        TriMesh { vertices: corners.chain(self.crotch).collect(), triangles: triangles().to_vec() }
    }

    /// The direction of the person's left side.
    pub fn left(&self) -> Point {
        cross(self.up, self.forward)
    }

    /// The unknowns of the rest pose, see [`deform`].
    pub fn rest_pose(&self) -> Vec<f64> {
        self.quads.iter().flat_map(|quad| quad.joint.into_iter().chain([0.0; 3])).collect()
    }
}
