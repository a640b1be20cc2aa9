//! Queries on points and triangles: nearest points, winding numbers, intersections.

pub mod bounding;
pub mod bvh;
pub mod distance;
pub mod intersect;
mod nesting;
pub mod predicates;
pub mod surface;
pub mod winding;

pub use bounding::Aabb;
pub use bvh::Bvh;
pub use intersect::{self_intersections, triangles_intersect};
pub use nesting::{Nesting, part_volumes};
pub use surface::{Nearest, Surface, outside};
pub use winding::GeneralizedWinding;
