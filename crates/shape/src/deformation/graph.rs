//! A target seen through a cage: strains on a graph of few of its points, as linear functions of the cage.

use crate::registration::{NodeGraph, surface_vertices};
use cager_geometry::linalg::{
    cholesky, gram, mirrored, nearest_rotation, rows_of, solve_cholesky, tall_product, transposed_product,
};
use cager_geometry::mesh::{Point, diagonal};
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::canonical::canonical_frame;
use crate::points::{matrix, outer, row_points};

/// Edges between points of a model in a cage. Energies are squared relative strains, in the mean over the edges.
pub(crate) struct CageGraph {
    pub(crate) nodes: Vec<u32>,
    edges: Vec<[u32; 2]>,
    /// At rest.
    vectors: Vec<DVec3>,
    weights: Vec<f64>,
    /// Of the nodes, k × m.
    coordinates: Mat<f64>,
    /// Half the Hessian, m × m.
    pub(crate) hessian: Mat<f64>,
}

/// Points of the graph, and what their normals count where they are spread, as a share of the diagonal.
const NODES: usize = 1500;
const NORMAL_LENGTH: f64 = 0.1;
/// Edges shorter than this share of the diagonal count as of this length.
const MIN_LENGTH: f64 = 1e-3;
const BLOCK_ROWS: usize = 256;

impl CageGraph {
    /// Of a model with these unit normals and coordinates.
    pub(crate) fn new(points: &[Point], normals: &[Point], triangles: &[[u32; 3]], phi: MatRef<'_, f64>) -> Self {
        // In a frame that turns with the model, so that the same points are chosen however it is turned.
        let frame = canonical_frame(points);
        let turned = frame.apply_all(points);
        let normals: Vec<Point> = normals.iter().map(|&n| (frame.rotation * DVec3::from(n)).to_array()).collect();
        let size = diagonal(&surface_vertices(&turned, triangles));
        let NodeGraph { nodes, edges } = NodeGraph::new(&turned, &normals, triangles, NODES, NORMAL_LENGTH * size);
        let at = |k: u32| DVec3::from(points[nodes[k as usize] as usize]);
        let vectors: Vec<DVec3> = edges.iter().map(|&[a, b]| at(b) - at(a)).collect();
        let count = edges.len().max(1) as f64;
        let weights: Vec<f64> =
            vectors.iter().map(|e| 1.0 / e.length().max(MIN_LENGTH * size).powi(2) / count).collect();
        let coordinates = rows_of(phi, &nodes);
        let differences = Mat::from_fn(edges.len(), phi.ncols(), |e, j| {
            let [a, b] = edges[e].map(|k| k as usize);
            weights[e].sqrt() * (coordinates[(b, j)] - coordinates[(a, j)])
        });
        let hessian = mirrored(gram(differences.as_ref(), BLOCK_ROWS));
        Self { nodes, edges, vectors, weights, coordinates, hessian }
    }

    /// Where the nodes are in a cage, m × 3.
    pub(crate) fn positions(&self, cage: MatRef<'_, f64>) -> Vec<DVec3> {
        row_points(tall_product(self.coordinates.as_ref(), cage).as_ref())
    }

    /// What pulls a cage, whose nodes are at `positions`, towards edges that are turned and stretched by the means of `by` at both ends: minus half the
    /// gradient, m × 3.
    pub(crate) fn pull(&self, positions: &[DVec3], by: &[DMat3]) -> Mat<f64> {
        let mut forces = Mat::<f64>::zeros(positions.len(), 3);
        for (e, &[a, b]) in self.edges.iter().enumerate() {
            let [a, b] = [a as usize, b as usize];
            let wanted = 0.5 * (by[a] * self.vectors[e] + by[b] * self.vectors[e]);
            let force = self.weights[e] * (wanted - (positions[b] - positions[a]));
            for k in 0..3 {
                forces[(b, k)] += force[k];
                forces[(a, k)] -= force[k];
            }
        }
        transposed_product(self.coordinates.as_ref(), forces.as_ref(), BLOCK_ROWS)
    }

    /// The rotation of each node's surroundings.
    pub(crate) fn rotations(&self, positions: &[DVec3]) -> Vec<DMat3> {
        let mut sums = vec![DMat3::ZERO; positions.len()];
        for (e, &[a, b]) in self.edges.iter().enumerate() {
            let [a, b] = [a as usize, b as usize];
            let moved = self.weights[e] * (positions[b] - positions[a]);
            let term = outer(moved, self.vectors[e]);
            sums[a] += term;
            sums[b] += term;
        }
        sums.par_iter().with_min_len(64).map(|&sum| nearest_rotation(sum)).collect()
    }
}

/// A target that follows gradients inside the space of a cage: one linear solve a pose. For models whose own triangles cannot be solved on, and clouds.
pub(crate) struct CageSpace {
    pub(crate) graph: CageGraph,
    phi: Mat<f64>,
    rest: Mat<f64>,
    points: Vec<DVec3>,
    factor: Mat<f64>,
}

/// Holds what no edge determines, over the mean of the Hessian's diagonal.
const HOLD: f64 = 1e-7;

impl CageSpace {
    /// Of a model in a cage, whose columns' values at rest are `rest`. `None` where nothing can be solved.
    pub(crate) fn new(
        points: &[Point],
        normals: &[Point],
        triangles: &[[u32; 3]],
        phi: MatRef<'_, f64>,
        rest: &[Point],
    ) -> Option<Self> {
        let graph = CageGraph::new(points, normals, triangles, phi);
        let m = phi.ncols();
        let hold = HOLD * (0..m).map(|k| graph.hessian[(k, k)]).sum::<f64>() / m as f64;
        let mut sum = graph.hessian.clone();
        (0..m).for_each(|k| sum[(k, k)] += hold);
        let factor = cholesky(sum)?;
        let points = points.iter().map(|&p| p.into()).collect();
        Some(Self { graph, phi: phi.to_owned(), rest: matrix(rest), points, factor })
    }

    /// The pose whose edges are turned and stretched as these gradients at the nodes ask, the mean as at rest.
    pub(crate) fn solve(&self, gradients: &[DMat3]) -> Vec<DVec3> {
        // From where the mean gradient takes the cage, which is the answer where all are equal.
        let mean = gradients.iter().copied().sum::<DMat3>() * (1.0 / gradients.len() as f64);
        let linear = |rest: &Mat<f64>| {
            Mat::from_fn(rest.nrows(), 3, |i, k| (0..3).map(|l| mean.col(l)[k] * rest[(i, l)]).sum::<f64>())
        };
        let start = linear(&self.rest);
        let mut change = self.graph.pull(&self.graph.positions(start.as_ref()), gradients);
        solve_cholesky(self.factor.as_ref(), &mut change);
        let moved = row_points(tall_product(self.phi.as_ref(), change.as_ref()).as_ref());
        let shape: Vec<DVec3> = moved.iter().zip(&self.points).map(|(d, p)| mean * *p + *d).collect();
        let count = shape.len() as f64;
        let by = (self.points.iter().sum::<DVec3>() - shape.iter().sum::<DVec3>()) / count;
        shape.iter().map(|p| *p + by).collect()
    }
}

/// The factor by which the edges of a mesh are longer in a pose, in the root mean square.
pub(crate) fn edge_growth(rest: &[DVec3], pose: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let sum = |of: &[DVec3]| {
        let sides = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| of[v as usize]);
            a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a)
        };
        triangles.iter().map(sides).sum::<f64>()
    };
    let (before, after) = (sum(rest), sum(pose));
    if before > 0.0 { (after / before).sqrt() } else { 1.0 }
}
