//! A graph of few nodes spread over a model.

use std::cmp::Reverse;

use cager_geometry::mesh::Polygons;
use cager_geometry::topology::{Adjacency, UnionFind};
use cager_geometry::vector::Point;
use glam::DVec3;

use super::nearest::NearestPoints;
use super::sampling::spread;
use crate::edge_distances::{NO_SOURCE, nearest_sources};
use crate::points::{vectors, welded};

/// Points of a model that are spread over it, and the edges between those whose surroundings touch.
#[derive(Clone, Debug)]
pub(crate) struct NodeGraph {
    /// The points, by their numbers in the model.
    pub(crate) nodes: Vec<u32>,
    /// Edges, by the numbers of the nodes in `nodes`.
    pub(crate) edges: Vec<[u32; 2]>,
}

/// Neighbours of a point of a cloud.
const NEIGHBOURS: u32 = 9;

impl NodeGraph {
    /// Up to `count` points of a model, spread by position and normal, which counts as a distance
    /// of `normal_length`, and edges; of clouds to the nearest points. Points at one place are one;
    /// points without a normal are taken only where none has one.
    ///
    /// # Panics
    /// Without points.
    pub(crate) fn new(
        points: &[Point],
        normals: &[Point],
        triangles: &[[u32; 3]],
        count: usize,
        normal_length: f64,
        seed: u64,
    ) -> Self {
        let place = welded(points);
        let first: Vec<u32> = (0..points.len() as u32).filter(|&v| place[v as usize] == v).collect();
        let of_first = |all: &[Point]| -> Vec<Point> { first.iter().map(|&v| all[v as usize]).collect() };
        let places = of_first(points);
        let nodes = spread(&places, &of_first(normals), count, normal_length, seed);
        let number = |v: u32| first.partition_point(|&other| other < place[v as usize]) as u32;
        let links =
            if triangles.is_empty() { links(&places) } else { triangles.iter().map(|t| t.map(number)).collect() };
        let edges = node_edges(&vectors(&places), &links, &nodes);
        Self { nodes: nodes.into_iter().map(|k| first[k as usize]).collect(), edges }
    }
}

/// Each point with its nearest ones, as triangles without an area.
fn links(points: &[Point]) -> Vec<[u32; 3]> {
    let tree = NearestPoints::new(points.iter().copied());
    let of = |(k, &p): (usize, &Point)| {
        let near = tree.several(NEIGHBOURS, p);
        near.into_iter().filter(move |&other| other != k).map(move |other| [k as u32, other as u32, other as u32])
    };
    points.iter().enumerate().flat_map(of).collect()
}

/// Edges between nodes whose cells touch: a cell is what is nearest to a node along the mesh. Parts
/// that touch no other are tied to the nearest node of the rest, by up to three edges each.
fn node_edges(vertices: &[DVec3], triangles: &[[u32; 3]], nodes: &[u32]) -> Vec<[u32; 2]> {
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

/// Connects all nodes: to the largest part comes the nearest one, again and again (Prim).
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of squares, each of its triangles with vertices of its own.
    fn soup() -> (Vec<Point>, Vec<[u32; 3]>) {
        let corner = |i: u32, j: u32| [f64::from(i), f64::from(j), 0.0];
        let triangles = (0..20).flat_map(|i| {
            let [a, b, c, d] = [corner(i, 0), corner(i + 1, 0), corner(i + 1, 1), corner(i, 1)];
            [[a, b, c], [a, c, d]]
        });
        let points: Vec<Point> = triangles.flatten().collect();
        let faces = (0..points.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        (points, faces)
    }

    #[test]
    fn triangles_of_a_soup_are_joined_where_their_corners_meet() {
        let (points, faces) = soup();
        let normals = vec![[0.0, 0.0, 1.0]; points.len()];
        for triangles in [&faces[..], &[]] {
            let graph = NodeGraph::new(&points, &normals, triangles, 1000, 0.1, 0);
            assert_eq!(graph.nodes.len(), 42);
            let length = |e: &[u32; 2]| {
                let [a, b] = e.map(|k| points[graph.nodes[k as usize] as usize]);
                cager_geometry::vector::distance(a, b)
            };
            // Ties of parts that nothing connects would be no edges of triangles.
            assert!(graph.edges.len() >= 61 && graph.edges.iter().all(|e| length(e) > 0.9), "{:?}", graph.edges);
            if !triangles.is_empty() {
                assert!(graph.edges.len() == 81 && graph.edges.iter().all(|e| length(e) < 1.5));
            }
        }
    }

    #[test]
    fn many_points_at_one_place_do_not_cut_a_cloud() {
        let mut points: Vec<Point> = (0..30).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        points.extend(std::iter::repeat_n([10.0, 0.0, 0.0], 50));
        let normals = vec![[0.0, 0.0, 1.0]; points.len()];
        let graph = NodeGraph::new(&points, &normals, &[], 100, 0.1, 0);
        assert!(graph.nodes.len() == 30 && graph.edges.iter().all(|e| e[0] != e[1]));
    }
}
