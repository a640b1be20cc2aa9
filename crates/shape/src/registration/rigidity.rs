//! How far a template is from moving rigidly, locally: as-rigid-as-possible energy (Sorkine and Alexa 2007) of relative strain on a graph of few
//! nodes of the model and of the cage's vertices.

use std::cmp::Reverse;

use cager_geometry::linalg::{gram, nearest_rotation};
use cager_geometry::mesh::Polygons;
use cager_geometry::topology::{Adjacency, UnionFind};
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3, Vec3A};
use rayon::prelude::*;

use crate::edge_distances::{NO_SOURCE, nearest_sources};

use super::dense_rows::DenseRows;
use super::sparse_rows::SparseRows;
use crate::points::{matrix, outer, row_points};

/// Nodes and the edges between them.
pub(crate) struct Rigidity {
    /// `½ Δ` of the energy, m × m, its lower triangle: its Hessian where rotations are held.
    hessian: Mat<f64>,
    /// Coordinates of the nodes of the model, and the identity for the cage's vertices, k × m.
    dense: DenseRows,
    sparse: SparseRows,
    /// The first edge of each node, and their number.
    first: Vec<u32>,
    edges: Vec<Edge>,
}

/// An edge as one of its ends sees it.
struct Edge {
    to: u32,
    /// From this end to the other, at rest.
    rest: DVec3,
    /// Half its weight over its squared length.
    weight: f64,
}

/// Edges shorter than this share of the diagonal count as of this length.
const MIN_EDGE_LENGTH: f64 = 1e-3;
/// Blocks of rows in which products are summed.
const BLOCK_ROWS: usize = 256;

impl Rigidity {
    /// The graph of nodes at `rest` (of `edges.0` and then of the cage, `edges.1`), the weight of all edges of the cage beside that of all of
    /// the model, and the model's `diagonal`.
    pub(crate) fn new(
        rest: &[DVec3],
        coordinates: MatRef<'_, f64>,
        [model_edges, cage_edges]: [&[[u32; 2]]; 2],
        cage_weight: f64,
        diagonal: f64,
        threshold: f64,
    ) -> Self {
        let mut by_node: Vec<Vec<Edge>> = (0..rest.len()).map(|_| Vec::new()).collect();
        for (edges, weight) in [(model_edges, 1.0), (cage_edges, cage_weight)] {
            for &[a, b] in edges {
                let vector = rest[b as usize] - rest[a as usize];
                let length = vector.length().max(MIN_EDGE_LENGTH * diagonal);
                let weight = weight / edges.len() as f64 / 2.0 / (length * length);
                by_node[a as usize].push(Edge { to: b, rest: vector, weight });
                by_node[b as usize].push(Edge { to: a, rest: -vector, weight });
            }
        }
        let mut first = vec![0];
        first.extend(by_node.iter().scan(0, |sum, edges| {
            *sum += edges.len() as u32;
            Some(*sum)
        }));
        let sparse = SparseRows::new(coordinates, threshold);
        let dense = DenseRows::new(coordinates);
        let hessian = hessian(coordinates, &by_node);
        Self { hessian, dense, sparse, first, edges: by_node.into_iter().flatten().collect() }
    }

    fn edges(&self, node: usize) -> &[Edge] {
        &self.edges[self.first[node] as usize..self.first[node + 1] as usize]
    }

    /// The vectors of all edges at rest, to be given back to [`Self::restore`].
    pub(crate) fn rest(&self) -> Vec<DVec3> {
        self.edges.iter().map(|edge| edge.rest).collect()
    }

    /// Takes vectors of all edges for those at rest.
    pub(crate) fn restore(&mut self, rest: &[DVec3]) {
        self.edges.iter_mut().zip(rest).for_each(|(edge, &rest)| edge.rest = rest);
    }

    /// Takes the shape that the nodes have in these positions for the one at rest. Weights stay as they are.
    pub(crate) fn set_rest(&mut self, positions: &[DVec3]) {
        for node in 0..self.first.len() - 1 {
            for edge in &mut self.edges[self.first[node] as usize..self.first[node + 1] as usize] {
                edge.rest = positions[edge.to as usize] - positions[node];
            }
        }
    }

    fn of_each_node<T: Send>(&self, what: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        (0..self.first.len() - 1).into_par_iter().with_min_len(64).map(what).collect()
    }

    /// `½ Δ` of the energy, m × m, its lower triangle: its Hessian where rotations are held.
    pub(crate) fn hessian(&self) -> &Mat<f64> {
        &self.hessian
    }

    /// Where the nodes are in a cage, m × 3.
    pub(crate) fn positions(&self, cage: MatRef<'_, f64>) -> Vec<DVec3> {
        self.dense.times(&row_points(cage))
    }

    /// What pulls the cage's vertices towards local rigidity, m × 3: minus half the gradient.
    pub(crate) fn pull(&self, positions: &[DVec3]) -> Mat<f64> {
        let rotations = self.of_each_node(|i| {
            let covariance = self.edges(i).iter().fold(DMat3::ZERO, |sum, edge| {
                let moved = edge.weight * (positions[edge.to as usize] - positions[i]);
                sum + outer(moved, edge.rest)
            });
            nearest_rotation(covariance)
        });
        let forces = self.of_each_node(|i| {
            self.edges(i).iter().fold(DVec3::ZERO, |sum, edge| {
                let j = edge.to as usize;
                let turned = rotations[i] * edge.rest + rotations[j] * edge.rest;
                sum + edge.weight * (2.0 * (positions[j] - positions[i]) - turned)
            })
        });
        matrix(&self.dense.transposed_times(&forces))
    }

    /// The Hessian, of coordinates without their small entries, times a change of the cage.
    pub(crate) fn hessian_times(&self, change: &[Vec3A]) -> Vec<Vec3A> {
        let moved = self.sparse.times(change);
        let forces = self.of_each_node(|i| {
            self.edges(i)
                .iter()
                .fold(Vec3A::ZERO, |sum, edge| sum + (2.0 * edge.weight) as f32 * (moved[i] - moved[edge.to as usize]))
        });
        self.sparse.transposed_times(&forces)
    }
}

/// [`Rigidity::hessian`], from coordinates, k × m, and the edges of each node.
fn hessian(coordinates: MatRef<'_, f64>, by_node: &[Vec<Edge>]) -> Mat<f64> {
    let once: Vec<(usize, &Edge)> = by_node
        .iter()
        .enumerate()
        .flat_map(|(a, edges)| edges.iter().map(move |edge| (a, edge)))
        .filter(|(a, edge)| *a < edge.to as usize)
        .collect();
    let differences = Mat::from_fn(once.len(), coordinates.ncols(), |e, j| {
        let (a, edge) = once[e];
        (2.0 * edge.weight).sqrt() * (coordinates[(edge.to as usize, j)] - coordinates[(a, j)])
    });
    gram(differences.as_ref(), BLOCK_ROWS)
}

/// The edges between nodes of a mesh whose cells touch: a cell is what is nearer to its node than to others, along the mesh. Parts of
/// the mesh that hold nodes and touch no other are tied to the nearest node of the rest, by up to three edges each. Edges by the numbers of the nodes in `nodes`.
pub(crate) fn node_edges(vertices: &[DVec3], triangles: &[[u32; 3]], nodes: &[u32]) -> Vec<[u32; 2]> {
    let adjacency = Adjacency::new(&Polygons::of_triangles(triangles), vertices.len());
    let (cells, _) = nearest_sources(vertices, &adjacency, nodes);
    let mut edges = Vec::new();
    for a in 0..vertices.len() {
        let touching = adjacency.of(a).iter().map(|&b| [cells[a], cells[b as usize]]);
        edges.extend(touching.filter(|[a, b]| a < b && *b != NO_SOURCE));
    }
    edges.sort_unstable();
    edges.dedup();
    tie_parts(&nodes.iter().map(|&n| vertices[n as usize]).collect::<Vec<_>>(), edges)
}

/// Adds edges until all nodes are connected: to the largest part comes the one that is nearest to it, again and again (Prim's algorithm).
fn tie_parts(nodes: &[DVec3], mut edges: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    let mut parts = UnionFind::new(nodes.len());
    edges.iter().for_each(|&[a, b]| {
        parts.join(a, b);
    });
    let part: Vec<u32> = (0..nodes.len() as u32).map(|k| parts.root(k)).collect();
    let mut sizes = vec![0; nodes.len()];
    part.iter().for_each(|&p| sizes[p as usize] += 1);
    let Some(largest) = (0..nodes.len()).max_by_key(|&p| (sizes[p], Reverse(p))) else { return edges };
    let mut joined: Vec<u32> = (0..nodes.len() as u32).filter(|&k| part[k as usize] == largest as u32).collect();
    // Nodes outside with their nearest node inside: squared distance, both numbers.
    let mut ways: Vec<(f64, [u32; 2])> = (0..nodes.len() as u32)
        .filter(|&k| part[k as usize] != largest as u32)
        .map(|k| (f64::INFINITY, [k, joined[0]]))
        .collect();
    let order = |a: &(f64, [u32; 2]), b: &(f64, [u32; 2])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    while !ways.is_empty() {
        for way in &mut ways {
            let from = nodes[way.1[0] as usize];
            for &inside in &joined {
                let d2 = from.distance_squared(nodes[inside as usize]);
                if d2 < way.0 {
                    *way = (d2, [way.1[0], inside]);
                }
            }
        }
        if ways.len() > MAX_TIES {
            ways.select_nth_unstable_by(MAX_TIES, order);
        }
        let mut ties = ways[..MAX_TIES.min(ways.len())].to_vec();
        ties.sort_by(order);
        let nearest = part[ties[0].1[0] as usize];
        let ties = ties.iter().filter(|(_, [a, _])| part[*a as usize] == nearest);
        edges.extend(ties.map(|&(_, [a, b])| [a.min(b), a.max(b)]));
        joined = ways.iter().map(|way| way.1[0]).filter(|&k| part[k as usize] == nearest).collect();
        ways.retain(|way| part[way.1[0] as usize] != nearest);
    }
    edges
}

/// Edges that tie a part, at the most.
const MAX_TIES: usize = 3;
