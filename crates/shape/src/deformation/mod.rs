//! Meshes as deformation gradients, and from them; cages as graphs of transforms.

mod detail;
pub(crate) mod gradients;
pub(crate) mod graph;
pub(crate) mod poisson;
pub(crate) mod rows;
pub(crate) mod ties;

pub use detail::Detail;
pub use gradients::Gradients;
pub use poisson::Poisson;
