//! Distances along the edges of a mesh (Dijkstra 1959).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use cager_geometry::topology::Adjacency;
use glam::DVec3;

/// The source of a vertex that no source reaches.
pub(crate) const NO_SOURCE: u32 = u32::MAX;

/// Of each vertex, the nearest source, by its number in `sources`, and the distance to it.
pub(crate) fn nearest_sources(vertices: &[DVec3], adjacency: &Adjacency, sources: &[u32]) -> (Vec<u32>, Vec<f64>) {
    let mut nearest = vec![NO_SOURCE; vertices.len()];
    let mut distance = vec![f64::INFINITY; vertices.len()];
    // Bits of non-negative numbers are in the order of the numbers.
    let mut next: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
    for (k, &source) in sources.iter().enumerate() {
        (nearest[source as usize], distance[source as usize]) = (k as u32, 0.0);
        next.push(Reverse((0, source)));
    }
    while let Some(Reverse((bits, a))) = next.pop() {
        let so_far = f64::from_bits(bits);
        if so_far > distance[a as usize] {
            continue;
        }
        for &b in adjacency.of(a as usize) {
            let longer = so_far + vertices[a as usize].distance(vertices[b as usize]);
            if longer < distance[b as usize] {
                (distance[b as usize], nearest[b as usize]) = (longer, nearest[a as usize]);
                next.push(Reverse((longer.to_bits(), b)));
            }
        }
    }
    (nearest, distance)
}
