//! As-rigid-as-possible energy (Sorkine and Alexa 2007) of relative strain on a graph of few nodes.

use cager_geometry::linalg::{gram, nearest_rotation};
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3, Vec3A};
use rayon::prelude::*;

use super::dense_rows::DenseRows;
use super::sparse_rows::SparseRows;
use crate::points::outer;

/// Edges between nodes, and the squared relative strain of each.
pub(crate) struct StrainGraph {
    edges: Vec<[u32; 2]>,
    /// From the first end of each to the second, at rest.
    pub(crate) rest: Vec<DVec3>,
    /// Weights over squared lengths.
    weights: Vec<f64>,
}

/// Edges shorter than this share of the diagonal count as of this length.
const MIN_EDGE_LENGTH: f64 = 1e-3;
/// Blocks of rows in which products are summed.
const BLOCK_ROWS: usize = 256;

impl StrainGraph {
    /// Sets of edges, each with the weight of all of them, in a model of this diagonal.
    pub(crate) fn new(nodes: &[DVec3], sets: &[(&[[u32; 2]], f64)], diagonal: f64) -> Self {
        let mut graph = Self { edges: Vec::new(), rest: Vec::new(), weights: Vec::new() };
        for &(edges, weight) in sets {
            graph.edges.extend(edges);
            graph.set_rest(nodes);
            let squares = graph.rest[graph.weights.len()..]
                .iter()
                .map(|edge| edge.length().max(MIN_EDGE_LENGTH * diagonal).powi(2));
            graph.weights.extend(squares.map(|square| weight / edges.len() as f64 / square));
        }
        graph
    }

    /// Takes the shape of nodes in these positions for the one at rest; weights stay.
    pub(crate) fn set_rest(&mut self, nodes: &[DVec3]) {
        self.rest = self.edges.iter().map(|&[a, b]| nodes[b as usize] - nodes[a as usize]).collect();
    }

    /// Half the Hessian with held rotations, its lower triangle, by what has these coordinates.
    pub(crate) fn hessian(&self, coordinates: MatRef<'_, f64>) -> Mat<f64> {
        let differences = Mat::from_fn(self.edges.len(), coordinates.ncols(), |e, j| {
            let [a, b] = self.edges[e].map(|k| k as usize);
            self.weights[e].sqrt() * (coordinates[(b, j)] - coordinates[(a, j)])
        });
        gram(differences.as_ref(), BLOCK_ROWS)
    }

    /// The rotation of each node's surroundings.
    pub(crate) fn rotations(&self, nodes: &[DVec3]) -> Vec<DMat3> {
        let mut sums = vec![DMat3::ZERO; nodes.len()];
        for ((&[a, b], &rest), &weight) in self.edges.iter().zip(&self.rest).zip(&self.weights) {
            let [a, b] = [a as usize, b as usize];
            let term = outer(weight * (nodes[b] - nodes[a]), rest);
            sums[a] += term;
            sums[b] += term;
        }
        sums.par_iter().with_min_len(64).map(|&sum| nearest_rotation(sum)).collect()
    }

    /// What pulls nodes towards edges turned and stretched by the means of `by` at both ends: minus
    /// half the gradient.
    pub(crate) fn forces(&self, nodes: &[DVec3], by: &[DMat3]) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; nodes.len()];
        for ((&[a, b], &rest), &weight) in self.edges.iter().zip(&self.rest).zip(&self.weights) {
            let [a, b] = [a as usize, b as usize];
            let wanted = 0.5 * (by[a] * rest + by[b] * rest);
            let force = weight * (wanted - (nodes[b] - nodes[a]));
            forces[b] += force;
            forces[a] -= force;
        }
        forces
    }

    /// Half the Hessian by the nodes times a change of them.
    fn hessian_times(&self, change: &[Vec3A]) -> Vec<Vec3A> {
        let mut forces = vec![Vec3A::ZERO; change.len()];
        for (&[a, b], &weight) in self.edges.iter().zip(&self.weights) {
            let [a, b] = [a as usize, b as usize];
            let force = weight as f32 * (change[a] - change[b]);
            forces[a] += force;
            forces[b] -= force;
        }
        forces
    }
}

/// A graph whose nodes follow a cage.
pub(crate) struct Rigidity {
    pub(crate) graph: StrainGraph,
    /// Half the Hessian by the cage, m × m, its lower triangle.
    pub(crate) hessian: Mat<f64>,
    /// Coordinates of the nodes, k × m.
    dense: DenseRows,
    sparse: SparseRows,
}

impl Rigidity {
    /// Of a graph with these coordinates; those up to `threshold` do not count in steps.
    pub(crate) fn new(graph: StrainGraph, coordinates: MatRef<'_, f64>, threshold: f64) -> Self {
        let (dense, sparse) = (DenseRows::new(coordinates), SparseRows::new(coordinates, threshold));
        Self { hessian: graph.hessian(coordinates), graph, dense, sparse }
    }

    /// Where the nodes are in a cage.
    pub(crate) fn positions(&self, cage: &[DVec3]) -> Vec<DVec3> {
        self.dense.times(cage)
    }

    /// What pulls the cage's vertices towards local rigidity: minus half the gradient.
    pub(crate) fn pull(&self, nodes: &[DVec3]) -> Vec<DVec3> {
        self.dense.transposed_times(&self.graph.forces(nodes, &self.graph.rotations(nodes)))
    }

    /// The Hessian, of coordinates without their small entries, times a change of the cage.
    pub(crate) fn hessian_times(&self, change: &[Vec3A]) -> Vec<Vec3A> {
        self.sparse.transposed_times(&self.graph.hessian_times(&self.sparse.times(change)))
    }
}
