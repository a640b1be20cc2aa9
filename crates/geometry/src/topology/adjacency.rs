//! What is around the vertices of a mesh.

use crate::mesh::Polygons;

/// The neighbours of each vertex along the edges of polygons, each once, ascending unless
/// [renamed](Self::renamed).
pub struct Adjacency {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Adjacency {
    /// Of the vertices of these faces.
    pub fn new(faces: &Polygons, points: usize) -> Self {
        let mut edges: Vec<[u32; 2]> = Vec::with_capacity(2 * faces.indices().len());
        for face in faces.iter() {
            for (k, &a) in face.iter().enumerate() {
                let b = face[(k + 1) % face.len()];
                if a != b {
                    edges.extend([[a, b], [b, a]]);
                }
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let mut starts = vec![0; points + 1];
        edges.iter().for_each(|[a, _]| starts[*a as usize + 1] += 1);
        (0..points).for_each(|k| starts[k + 1] += starts[k]);
        Self { starts, items: edges.into_iter().map(|[_, b]| b).collect() }
    }

    /// The same with other names of the vertices; the neighbours come in another order.
    pub fn renamed(&self, names: &[u32]) -> Self {
        let mut starts = vec![0; self.starts.len()];
        (0..self.points()).for_each(|v| starts[names[v] as usize + 1] = self.of(v).len() as u32);
        (0..self.points()).for_each(|k| starts[k + 1] += starts[k]);
        let mut items = vec![0; self.items.len()];
        for v in 0..self.points() {
            let begin = starts[names[v] as usize] as usize;
            items[begin..].iter_mut().zip(self.of(v)).for_each(|(to, &w)| *to = names[w as usize]);
        }
        Self { starts, items }
    }

    /// Number of vertices.
    pub fn points(&self) -> usize {
        self.starts.len() - 1
    }

    /// The neighbours of a vertex.
    pub fn of(&self, vertex: usize) -> &[u32] {
        &self.items[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}

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
