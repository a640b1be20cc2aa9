//! People, after Duveau, Courtemanche, Reveret and Boyer 2012, "Cage-based motion recovery using
//! manifold learning": a rig of oriented quads that makes a cage, a manifold of poses learned from
//! motion-capture clips, and the paths of joints.
//!
//! A template is fitted to observed surfaces of a person (§5) by Gauss–Newton in three stages:
//! placement and latent numbers; quads held to manifold, bone lengths and the frame before;
//! vertices of the cage.
//!
//! Residuals are distances to the planes of matched points, both ways, in the unit `0.005 ·
//! height`, that count less the farther and not at all where the surfaces face apart.

mod equations;
mod first_fit;
mod fit;
pub mod joints;
mod limbs;
pub mod manifold;
mod matching;
mod model;
mod options;
pub mod poses;
pub mod rig;
mod search;
mod stages;
#[cfg(test)]
pub(crate) mod tests;
mod track;

pub use fit::{FrameFit, PersonFit};
pub use model::{ModelError, PersonModel};
pub use options::{COORDINATES, FitOptions, Method, SAMPLES};
pub use track::{PersonTracker, TrackedFrame};
