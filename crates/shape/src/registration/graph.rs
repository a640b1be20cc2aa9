//! A graph of few nodes spread over a model.

use cager_geometry::vector::Point;

use super::nearest::NearestPoints;
use super::rigidity::node_edges;
use super::sampling::spread;
use super::welded;
use crate::points::vectors;

/// Points of a model that are spread over it, and the edges between those whose surroundings touch.
#[derive(Clone, Debug)]
pub struct NodeGraph {
    /// The points, by their numbers in the model.
    pub nodes: Vec<u32>,
    /// Edges, by the numbers of the nodes in `nodes`.
    pub edges: Vec<[u32; 2]>,
}

/// Neighbours of a point of a cloud.
const NEIGHBOURS: u32 = 9;

impl NodeGraph {
    /// Up to `count` points of a model with these unit normals, spread by position and normal; a normal counts as much as a distance of `normal_length`. Points of
    /// a model without triangles are connected with the nearest ones. Points at the same place are one; points without a normal are taken only where none
    /// has one.
    ///
    /// # Panics
    /// Without points.
    pub fn new(points: &[Point], normals: &[Point], triangles: &[[u32; 3]], count: usize, normal_length: f64) -> Self {
        let place = welded(points);
        let first: Vec<u32> = (0..points.len() as u32).filter(|&v| place[v as usize] == v).collect();
        let of_first = |all: &[Point]| -> Vec<Point> { first.iter().map(|&v| all[v as usize]).collect() };
        let places = of_first(points);
        let nodes = spread(&places, &of_first(normals), count, normal_length, 0);
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
            let graph = NodeGraph::new(&points, &normals, triangles, 1000, 0.1);
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
        let graph = NodeGraph::new(&points, &normals, &[], 100, 0.1);
        assert!(graph.nodes.len() == 30 && graph.edges.iter().all(|e| e[0] != e[1]));
    }
}
