//! Cage animations of a template, recovered from surfaces that have no correspondence.
//!
//! People: a rig of oriented quads that makes a cage (`rig`), a manifold of poses learned from motion-capture clips (`poses`, `manifold`), the fit of
//! both to observed surfaces (`people`) and the paths of joints (`joints`), after Duveau, Courtemanche, Reveret and Boyer 2012, "Cage-based motion
//! recovery using manifold learning".

pub mod change;
pub mod joints;
pub mod manifold;
pub mod offsets;
pub mod people;
pub mod poses;
pub mod rig;
mod rotation;
pub mod track;
