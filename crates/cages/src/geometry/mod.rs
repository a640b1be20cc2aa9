//! Queries on points and triangles: nearest points, winding numbers, intersections. All results are independent of the number of
//! threads.

pub mod bounding;
pub mod bvh;
pub mod distance;
pub mod intersect;
pub mod predicates;
pub mod surface;
pub mod winding;

pub use bounding::Aabb;
pub use bvh::Bvh;
pub use intersect::{self_intersections, triangles_intersect};
pub use surface::{Nearest, Surface, outside};
pub use winding::GeneralizedWinding;
