//! Edges of a cage, and faces with their edges.

/// An edge of a cage, shared by exactly two faces.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Its ends, the smaller index first.
    pub vertices: [u32; 2],
    /// The faces at it, in the mesh's order.
    pub faces: [u32; 2],
}

/// A face of a cage with its edges.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Corners, counter-clockwise seen from outside.
    pub vertices: [u32; 3],
    /// `edges[i]` is the edge opposite corner i.
    pub edges: [u32; 3],
    /// +1 where the face traverses the edge from the smaller vertex index to the larger, −1 where it traverses it in the opposite direction.
    pub signs: [f64; 3],
}
