//! Local deviation of relative edge differences within a frame.

use super::deviation::{deviation, weighted_difference};
use cager_geometry::mesh::Polygons;
use cager_geometry::topology::Adjacency;
use rayon::prelude::*;

/// The edges near each vertex.
pub(super) struct Neighbourhoods {
    edges: Vec<[u32; 2]>,
    /// For each vertex, edges that have an end less than so many rings away.
    near: Vec<Vec<u32>>,
}

impl Neighbourhoods {
    pub(super) fn new(faces: &Polygons, points: usize, rings: usize) -> Self {
        let adjacency = Adjacency::new(faces, points);
        let mut edges = Vec::new();
        let mut incident = vec![Vec::new(); points];
        for a in 0..points {
            for &b in adjacency.of(a).iter().filter(|&&b| b as usize > a) {
                incident[a].push(edges.len() as u32);
                incident[b as usize].push(edges.len() as u32);
                edges.push([a as u32, b]);
            }
        }
        if rings == 1 {
            return Self { edges, near: incident };
        }
        let near = |vertex: usize| {
            let mut reached = vec![vertex as u32];
            for _ in 1..rings {
                let next: Vec<u32> = reached.iter().flat_map(|&v| adjacency.of(v as usize)).copied().collect();
                reached.extend(next);
                reached.sort_unstable();
                reached.dedup();
            }
            let mut near: Vec<u32> = reached.iter().flat_map(|&v| &incident[v as usize]).copied().collect();
            near.sort_unstable();
            near.dedup();
            near
        };
        Self { near: (0..points).into_par_iter().map(near).collect(), edges }
    }

    /// The deviation at each vertex, none where no edge near it has a length.
    pub(super) fn deviations<C, D>(&self, captured: &[C], decoded: &[D]) -> Vec<Option<f64>>
    where
        C: Copy + Into<f64> + Sync,
        D: Copy + Into<f64> + Sync,
    {
        let differences: Vec<(f64, f64)> = self
            .edges
            .par_iter()
            .map(|&edge| weighted_difference(length(captured, edge), length(decoded, edge)))
            .collect();
        self.near.par_iter().map(|near| deviation(near.iter().map(|&edge| differences[edge as usize]))).collect()
    }
}

fn length<T: Copy + Into<f64>>(positions: &[T], [a, b]: [u32; 2]) -> f64 {
    let along = |k: usize| -> f64 { positions[3 * a as usize + k].into() - positions[3 * b as usize + k].into() };
    (0..3).map(|k| along(k).powi(2)).sum::<f64>().sqrt()
}
