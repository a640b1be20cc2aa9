//! People, after Duveau, Courtemanche, Reveret and Boyer 2012, "Cage-based motion recovery using manifold learning": a rig of oriented quads that makes
//! a cage (`rig`), a manifold of poses learned from motion-capture clips (`poses`, `manifold`), and the paths of joints (`joints`).
//!
//! A template with a rig is fitted to observed surfaces of a person (§5) by Gauss–Newton with analytic derivatives, in three stages:
//! placement and latent numbers of the manifold; quads held to the manifold, to their bones' lengths and to the frame before; vertices of the cage.
//!
//! What is fitted are distances of points of the template to the planes of the observed points that they are matched with, both ways, in the unit
//! `0.005 · height`, less the farther apart and not at all where the surfaces face apart.

mod equations;
mod first_fit;
mod fit;
pub mod joints;
mod limbs;
pub mod manifold;
mod matching;
mod model;
mod observed;
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
pub use options::{COORDINATES, FitOptions, Method};
pub use track::{BackwardPass, PersonTracker, TrackedFrame};
