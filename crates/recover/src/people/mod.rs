//! A template with a rig laid onto observed surfaces of a person (Duveau et al. 2012, §5), by Gauss–Newton with analytic derivatives, in three stages:
//! placement and latent numbers of the manifold; quads held to the manifold, to their bones' lengths and to the frame before; vertices of the cage.
//!
//! What is fitted are distances of points of the template to the planes of the observed points that they are matched with, both ways, in the unit
//! `0.005 · height`, less the farther apart and not at all where the surfaces face apart.

mod anew;
mod equations;
mod fit;
mod limbs;
mod matching;
mod model;
mod observed;
mod options;
mod search;
mod stages;
#[cfg(test)]
pub(crate) mod tests;
mod track;

pub use cager_registration::Observation;
pub use fit::{FrameFit, PersonFit};
pub use model::{ModelError, PersonModel};
pub use options::{FitOptions, Method, SystemKind};
pub use track::{PersonTracker, TrackedFrame, WayBack, track};
