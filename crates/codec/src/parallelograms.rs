//! An order of a mesh's vertices in which as many as possible are predicted by parallelograms: of
//! two triangles with a common edge the far corners are predicted from each other.

use cager_geometry::mesh::Polygons;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Vertices in order, each with what predicts it.
pub(crate) struct Predictions {
    order: Vec<u32>,
    starts: Vec<u32>,
    /// The first and the second less the third are where the vertex is expected.
    triples: Vec<[u32; 3]>,
    /// A vertex before it on the mesh, or the one before it; itself for the first.
    near: Vec<u32>,
}

impl Predictions {
    /// For the vertices of these faces; those without a face come last.
    pub(crate) fn new(faces: &Polygons, points: usize) -> Self {
        let triangles = faces.triangulated();
        let mut edges: HashMap<(u32, u32), u32> = HashMap::with_capacity(3 * triangles.len());
        // The far corners of two triangles, and their common edge.
        let mut pairs: Vec<[u32; 4]> = Vec::with_capacity(3 * triangles.len() / 2);
        for &[a, b, c] in &triangles {
            for (from, to, far) in [(a, b, c), (b, c, a), (c, a, b)] {
                // Of faces that name a vertex twice nothing is predicted.
                if let Some(&other) = edges.get(&(to, from))
                    && other != far
                    && from != to
                    && ![from, to].iter().any(|end| [far, other].contains(end))
                {
                    pairs.push([far, other, from, to]);
                }
                edges.entry((from, to)).or_insert(far);
            }
        }
        drop(edges);
        let of_vertex = by_vertex(&pairs, points);
        let neighbours = by_vertex(&triangles, points);
        let mut found = Self { order: Vec::new(), starts: vec![0], triples: Vec::new(), near: Vec::new() };
        let mut placed = vec![false; points];
        let mut counts = vec![0u32; points];
        let mut heap: BinaryHeap<(u32, Reverse<u32>, u32, u32)> = BinaryHeap::new();
        let mut turn = 0;
        let mut next = 0;
        loop {
            let (vertex, near) = match heap.pop() {
                Some((count, _, vertex, near)) => {
                    if placed[vertex as usize] || count < counts[vertex as usize] {
                        continue;
                    }
                    (vertex, near)
                }
                None => {
                    while next < points && (placed[next] || neighbours.of(next).is_empty()) {
                        next += 1;
                    }
                    if next == points {
                        break;
                    }
                    (next as u32, found.order.last().copied().unwrap_or(next as u32))
                }
            };
            placed[vertex as usize] = true;
            for &pair in of_vertex.of(vertex as usize) {
                let [a, b, from, to] = pairs[pair as usize];
                let is_placed = |v: u32| placed[v as usize];
                if !(is_placed(from) && is_placed(to)) {
                    continue;
                }
                match (is_placed(a), is_placed(b)) {
                    (true, true) if vertex == a || vertex == b => {
                        found.triples.push([from, to, if vertex == a { b } else { a }]);
                    }
                    (true, false) | (false, true) => {
                        let expected = if is_placed(a) { b } else { a };
                        counts[expected as usize] += 1;
                        heap.push((counts[expected as usize], Reverse(turn), expected, vertex));
                        turn += 1;
                    }
                    _ => {}
                }
            }
            for &triangle in neighbours.of(vertex as usize) {
                for other in triangles[triangle as usize] {
                    if !placed[other as usize] && counts[other as usize] == 0 {
                        heap.push((0, Reverse(turn), other, vertex));
                        turn += 1;
                    }
                }
            }
            found.add(vertex, near);
        }
        for (vertex, _) in placed.iter().enumerate().filter(|(_, placed)| !**placed) {
            let near = found.order.last().copied().unwrap_or(vertex as u32);
            found.add(vertex as u32, near);
        }
        found
    }

    fn add(&mut self, vertex: u32, near: u32) {
        self.order.push(vertex);
        self.near.push(near);
        self.starts.push(self.triples.len() as u32);
    }

    /// Each vertex, the triples that predict it, and one near it.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, &[[u32; 3]], usize)> {
        (0..self.order.len()).map(|k| {
            let triples = &self.triples[self.starts[k] as usize..self.starts[k + 1] as usize];
            (self.order[k] as usize, triples, self.near[k] as usize)
        })
    }
}

/// The items that name each vertex.
struct ByVertex {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl ByVertex {
    fn of(&self, vertex: usize) -> &[u32] {
        &self.items[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}

fn by_vertex<const N: usize>(items: &[[u32; N]], points: usize) -> ByVertex {
    let mut starts = vec![0u32; points + 1];
    items.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
    for k in 0..points {
        starts[k + 1] += starts[k];
    }
    let mut places = starts.clone();
    let mut list = vec![0; starts[points] as usize];
    for (k, item) in items.iter().enumerate() {
        for &v in item {
            list[places[v as usize] as usize] = k as u32;
            places[v as usize] += 1;
        }
    }
    ByVertex { starts, items: list }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertex_comes_once_and_after_what_predicts_it() {
        let mut random = fastrand::Rng::with_seed(9);
        for _ in 0..200 {
            let points = random.u32(1..40);
            let mut faces = Polygons::new();
            for _ in 0..random.usize(..60) {
                let face: Vec<u32> = (0..random.usize(1..6)).map(|_| random.u32(..points)).collect();
                faces.push(&face);
            }
            let mut known = vec![false; points as usize];
            for (k, (vertex, triples, near)) in Predictions::new(&faces, points as usize).iter().enumerate() {
                assert!(!known[vertex] && (known[near] || k == 0));
                assert!(triples.as_flattened().iter().all(|&v| known[v as usize]));
                known[vertex] = true;
            }
            assert!(known.iter().all(|&k| k));
        }
    }
}
