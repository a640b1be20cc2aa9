//! What is around the vertices of triangles.

/// The faces around each vertex, ascending.
///
/// # Panics
/// Where a face has a vertex that does not exist.
pub fn faces_around(vertices: usize, faces: &[impl AsRef<[u32]>]) -> Vec<Vec<u32>> {
    let mut around = vec![Vec::new(); vertices];
    for (f, face) in faces.iter().enumerate() {
        face.as_ref().iter().for_each(|&v| around[v as usize].push(f as u32));
    }
    around
}

/// The vertices, other than the one itself, of the triangles around a vertex, ascending, each once.
pub fn ring(vertex: u32, around: &[u32], triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut ring: Vec<u32> = around.iter().flat_map(|&f| triangles[f as usize]).filter(|&w| w != vertex).collect();
    ring.sort_unstable();
    ring.dedup();
    ring
}
