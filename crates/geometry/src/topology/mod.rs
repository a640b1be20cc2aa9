//! Which vertices, edges and faces of a mesh meet, without assumptions on their validity.

mod adjacency;
mod edges;
mod union_find;

pub use adjacency::{Adjacency, faces_around, ring};
pub use edges::{Edges, border_loops, edges, fans, orientations, shells, sides};
pub use union_find::UnionFind;
