//! Nearest points in a few dimensions, by a k-d tree.

use nabo::{CandidateContainer, KDTree, NotNan, Parameters, Point};

/// A point in `D` dimensions as the tree wants it.
#[derive(Clone, Copy)]
struct Node<const D: usize>([NotNan<f64>; D]);

impl<const D: usize> Default for Node<D> {
    fn default() -> Self {
        Self([NotNan::default(); D])
    }
}

impl<const D: usize> Point<f64> for Node<D> {
    const DIM: u32 = D as u32;

    fn set(&mut self, i: u32, value: NotNan<f64>) {
        self.0[i as usize] = value;
    }

    fn get(&self, i: u32) -> NotNan<f64> {
        self.0[i as usize]
    }
}

/// NaN counts as 0.
fn node<const D: usize>(point: [f64; D]) -> Node<D> {
    Node(point.map(|x| NotNan::new(x).unwrap_or_default()))
}

/// A tree over points in `D` dimensions. Coordinates that are NaN count as 0.
pub struct NearestPoints<const D: usize> {
    tree: KDTree<f64, Node<D>>,
    points: Vec<Node<D>>,
}

/// What is looked for beyond a known distance, since both are rounded.
const MARGIN: f64 = 1.0 + 1e-9;

impl<const D: usize> NearestPoints<D> {
    /// A tree over some points.
    ///
    /// # Panics
    /// Without any point.
    pub fn new(points: impl IntoIterator<Item = [f64; D]>) -> Self {
        let nodes: Vec<Node<D>> = points.into_iter().map(node).collect();
        assert!(!nodes.is_empty(), "a tree needs a point");
        Self { tree: KDTree::new(&nodes), points: nodes }
    }

    /// The number of the point nearest to `query`, and the squared distance.
    pub fn nearest(&self, query: [f64; D]) -> (usize, f64) {
        let found = self.tree.knn(1, &node(query));
        // None is found where squares of distances overflow.
        found.first().map_or((0, f64::INFINITY), |found| (found.index as usize, found.dist2.into_inner()))
    }

    /// [`Self::nearest`], looked for no farther than a known point.
    pub fn nearest_from(&self, query: [f64; D], known: usize) -> (usize, f64) {
        let query = node(query);
        let squares = query.0.iter().zip(&self.points[known].0).map(|(a, b)| (a.into_inner() - b.into_inner()).powi(2));
        let known_d2: f64 = squares.sum();
        let within = Parameters {
            epsilon: 0.0,
            max_radius: known_d2.sqrt() * MARGIN,
            allow_self_match: true,
            sort_results: false,
        };
        let found = self.tree.knn_advanced(1, &query, CandidateContainer::Linear, &within, None);
        let found = found.first().map(|found| (found.index as usize, found.dist2.into_inner()));
        found.filter(|(_, d2)| *d2 < known_d2).unwrap_or((known, known_d2))
    }

    /// The numbers of the `count` points nearest to `query`, nearest first.
    pub fn several(&self, count: u32, query: [f64; D]) -> Vec<usize> {
        self.tree.knn(count, &node(query)).iter().map(|found| found.index as usize).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_of_random_points_is_found_with_copies_among_them() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut points: Vec<[f64; 6]> = (0..500).map(|_| std::array::from_fn(|_| random.f64())).collect();
        points.extend_from_within(..100);
        let tree = NearestPoints::new(points.iter().copied());
        let distance2 = |a: [f64; 6], b: [f64; 6]| (0..6).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
        for _ in 0..200 {
            let query = std::array::from_fn(|_| random.f64());
            let least = points.iter().map(|&p| distance2(p, query)).fold(f64::INFINITY, f64::min);
            let (found, d2) = tree.nearest(query);
            assert!((d2 - least).abs() < 1e-12 && (distance2(points[found], query) - least).abs() < 1e-12);
            for known in [found, random.usize(..points.len())] {
                let (again, d2) = tree.nearest_from(query, known);
                assert!((d2 - least).abs() < 1e-12 && (distance2(points[again], query) - least).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn equal_points_and_few_points_are_found() {
        let tree = NearestPoints::new(vec![[1.0; 3]; 100]);
        assert_eq!(tree.several(7, [0.0; 3]).len(), 7);
        assert_eq!(NearestPoints::new([[2.0; 3]]).several(7, [0.0; 3]), [0]);
    }
}
