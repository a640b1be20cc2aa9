//! Shapes between poses and beyond them, of a model or of a cage.

mod features;
mod on_cage;
mod on_mesh;
mod path;
mod pose_cages;
mod poses;
mod rotations;

pub use on_cage::CagedShapes;
pub use on_mesh::ShapeSpace;
pub use path::ShapePath;
