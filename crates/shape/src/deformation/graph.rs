//! A target seen through a cage: strains on a graph of few points, linear in the cage.

use crate::registration::{NodeGraph, StrainGraph, surface_vertices};
use cager_geometry::linalg::{cholesky, mirrored, rows_of, solve_cholesky, transposed_product};
use cager_geometry::mesh::{Point, diagonal};
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3};

use crate::canonical::canonical_frame;
use crate::points::{matrix, points_in};

/// Edges between points of a model in a cage; energies are means over the edges.
pub(crate) struct CageGraph {
    pub(crate) nodes: Vec<u32>,
    pub(crate) graph: StrainGraph,
    /// Of the nodes, k × m.
    coordinates: Mat<f64>,
    /// Half the Hessian, m × m.
    pub(crate) hessian: Mat<f64>,
}

/// Points of the graph, and what their normals count, as a share of the diagonal.
const NODES: usize = 1500;
const NORMAL_LENGTH: f64 = 0.1;
const BLOCK_ROWS: usize = 256;

impl CageGraph {
    /// Of a model with these unit normals and coordinates.
    pub(crate) fn new(points: &[Point], normals: &[Point], triangles: &[[u32; 3]], phi: MatRef<'_, f64>) -> Self {
        // In a frame that turns with the model, so that the same points are chosen.
        let frame = canonical_frame(points);
        let turned = frame.apply_all(points);
        let size = diagonal(&surface_vertices(&turned, triangles));
        let normals = frame.turn_all(normals);
        let NodeGraph { nodes, edges } = NodeGraph::new(&turned, &normals, triangles, NODES, NORMAL_LENGTH * size, 0);
        let at: Vec<DVec3> = nodes.iter().map(|&node| points[node as usize].into()).collect();
        let graph = StrainGraph::new(&at, &[(&edges, 1.0)], size);
        let coordinates = rows_of(phi, &nodes);
        let hessian = mirrored(graph.hessian(coordinates.as_ref()));
        Self { nodes, graph, coordinates, hessian }
    }

    /// Where the nodes are in a cage, m × 3.
    pub(crate) fn positions(&self, cage: MatRef<'_, f64>) -> Vec<DVec3> {
        points_in(self.coordinates.as_ref(), cage)
    }

    /// What pulls a cage towards edges turned and stretched by the means of `by` at both ends:
    /// minus half the gradient, m × 3.
    pub(crate) fn pull(&self, positions: &[DVec3], by: &[DMat3]) -> Mat<f64> {
        let forces = matrix(&self.graph.forces(positions, by));
        transposed_product(self.coordinates.as_ref(), forces.as_ref(), BLOCK_ROWS)
    }
}

/// A target that follows gradients in the space of a cage, by one linear solve a pose: for soups
/// and clouds.
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
    /// Of a model in a cage whose columns have these values at rest; `None` where nothing can be
    /// solved.
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

    /// The pose whose edges follow these gradients at the nodes, the mean as at rest.
    pub(crate) fn solve(&self, gradients: &[DMat3]) -> Vec<DVec3> {
        // From where the mean gradient takes the cage, which is the answer where all are equal.
        let mean = gradients.iter().copied().sum::<DMat3>() * (1.0 / gradients.len() as f64);
        let linear = |rest: &Mat<f64>| {
            Mat::from_fn(rest.nrows(), 3, |i, k| (0..3).map(|l| mean.col(l)[k] * rest[(i, l)]).sum::<f64>())
        };
        let start = linear(&self.rest);
        let mut change = self.graph.pull(&self.graph.positions(start.as_ref()), gradients);
        solve_cholesky(self.factor.as_ref(), &mut change);
        let moved: Vec<DVec3> = points_in(self.phi.as_ref(), change.as_ref());
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
