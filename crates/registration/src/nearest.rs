//! Nearest points in a few dimensions, by a k-d tree.

use nabo::{KDTree, NotNan, Point};

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
pub struct NearestPoints<const D: usize>(KDTree<f64, Node<D>>);

impl<const D: usize> NearestPoints<D> {
    /// A tree over some points.
    ///
    /// # Panics
    /// Without any point.
    pub fn new(points: impl IntoIterator<Item = [f64; D]>) -> Self {
        let nodes: Vec<Node<D>> = points.into_iter().map(node).collect();
        assert!(!nodes.is_empty(), "a tree needs a point");
        Self(KDTree::new(&nodes))
    }

    /// The number of the point nearest to `query`, and the squared distance.
    pub fn nearest(&self, query: [f64; D]) -> (usize, f64) {
        let found = self.0.knn(1, &node(query));
        // None is found where squares of distances overflow.
        found.first().map_or((0, f64::INFINITY), |found| (found.index as usize, found.dist2.into_inner()))
    }

    /// The numbers of the `count` points nearest to `query`, nearest first.
    pub fn several(&self, count: u32, query: [f64; D]) -> Vec<usize> {
        self.0.knn(count, &node(query)).iter().map(|found| found.index as usize).collect()
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
        }
    }

    #[test]
    fn equal_points_and_few_points_are_found() {
        let tree = NearestPoints::new(vec![[1.0; 3]; 100]);
        assert_eq!(tree.several(7, [0.0; 3]).len(), 7);
        assert_eq!(NearestPoints::new([[2.0; 3]]).several(7, [0.0; 3]), [0]);
    }
}
