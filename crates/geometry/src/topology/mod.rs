//! Which vertices, edges and faces of a mesh meet: polygons of any arity and triangles, without assumptions on their validity.

mod adjacency;
mod edges;
mod rings;
mod union_find;

pub use adjacency::Adjacency;
pub use edges::{Edges, border_loops, edges, fans, shells, sides};
pub use rings::{faces_around, ring};
pub use union_find::UnionFind;
