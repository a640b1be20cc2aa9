//! Points of a surface: at random, even by area; and the farthest from each other.

use cager_geometry::vector::{Point, combination};

use super::matching::join;
use crate::points::area_vector;

/// A point of a triangle mesh, by its triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The triangle.
    pub face: u32,
    /// Weights of its corners; they sum to one.
    pub weights: [f64; 3],
}

impl SurfacePoint {
    /// Where it is.
    pub fn at(&self, vertices: &[Point], triangles: &[[u32; 3]]) -> Point {
        combination(self.weights, triangles[self.face as usize].map(|v| vertices[v as usize]))
    }
}

/// The vertices that triangles use, in their order; all where there are no triangles.
pub fn surface_vertices(vertices: &[Point], triangles: &[[u32; 3]]) -> Vec<Point> {
    let mut used = vec![triangles.is_empty(); vertices.len()];
    triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    vertices.iter().zip(used).filter(|(_, used)| *used).map(|(&p, _)| p).collect()
}

/// `count` random points of a surface, one in each of as many parts of equal area, in the order of
/// the triangles. None where it has no area.
pub fn sample_surface(vertices: &[Point], triangles: &[[u32; 3]], count: usize, seed: u64) -> Vec<SurfacePoint> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut sums = Vec::with_capacity(triangles.len());
    let mut area = 0.0;
    for triangle in triangles {
        area += area_vector(triangle.map(|v| vertices[v as usize])).length();
        sums.push(area);
    }
    if area.is_nan() || area <= 0.0 || area.is_infinite() {
        return Vec::new();
    }
    (0..count)
        .map(|k| {
            let at = (k as f64 + random.f64()) / count as f64 * area;
            let face = sums.partition_point(|&sum| sum <= at).min(triangles.len() - 1);
            let (u, v) = (random.f64(), random.f64());
            let (low, high) = if u < v { (u, v) } else { (v, u) };
            SurfacePoint { face: face as u32, weights: [low, high - low, 1.0 - high] }
        })
        .collect()
}

/// Points that spread ones are chosen among, at the most.
const MAX_CANDIDATES: usize = 20_000;

/// Up to `count` of some points, spread by position and normal, which counts as a distance of
/// `normal_length`. Points without a normal are taken only where none has one; of very many, those
/// are chosen among that `seed` draws.
pub(crate) fn spread(points: &[Point], normals: &[Point], count: usize, normal_length: f64, seed: u64) -> Vec<u32> {
    let mut candidates: Vec<u32> = (0..points.len() as u32).filter(|&v| normals[v as usize] != [0.0; 3]).collect();
    if candidates.is_empty() {
        candidates = (0..points.len() as u32).collect();
    }
    if candidates.len() > MAX_CANDIDATES {
        fastrand::Rng::with_seed(seed).shuffle(&mut candidates);
        candidates.truncate(MAX_CANDIDATES);
        candidates.sort_unstable();
    }
    let joined: Vec<[f64; 6]> =
        candidates.iter().map(|&v| join(points[v as usize], normals[v as usize], normal_length)).collect();
    farthest(&joined, count).into_iter().map(|k| candidates[k as usize]).collect()
}

/// Up to `count` points, each the farthest from those before; first that of greatest second
/// coordinate.
pub fn farthest<const D: usize>(points: &[[f64; D]], count: usize) -> Vec<u32> {
    let Some(first) = (0..points.len()).max_by(|&i, &j| points[i][1].total_cmp(&points[j][1])) else {
        return Vec::new();
    };
    let mut distance2 = vec![f64::INFINITY; points.len()];
    let mut chosen = vec![first as u32];
    while chosen.len() < count {
        let last = points[chosen[chosen.len() - 1] as usize];
        let (mut most, mut next) = (0.0, None);
        for (i, (point, d2)) in points.iter().zip(&mut distance2).enumerate() {
            *d2 = d2.min((0..D).map(|k| (point[k] - last[k]).powi(2)).sum());
            if *d2 > most {
                (most, next) = (*d2, Some(i as u32));
            }
        }
        let Some(next) = next else { break };
        chosen.push(next);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_even_by_area_and_equal_for_equal_seeds() {
        let vertices = [[0.0; 3], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triangles = [[0, 1, 2], [0, 2, 3], [1, 1, 2]];
        let samples = sample_surface(&vertices, &triangles, 4000, 7);
        let in_first = samples.iter().filter(|s| s.face == 0).count();
        assert!((2999..=3001).contains(&in_first), "{in_first}");
        assert!(samples.iter().all(|s| s.face < 2 && (s.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12));
        assert_eq!(samples, sample_surface(&vertices, &triangles, 4000, 7));
        assert_eq!(sample_surface(&vertices, &[[1, 1, 2]], 10, 7), []);
    }

    #[test]
    fn of_very_many_points_some_are_chosen_among() {
        let mut random = fastrand::Rng::with_seed(2);
        let points: Vec<Point> = (0..100_000).map(|_| std::array::from_fn(|_| random.f64())).collect();
        let normals = vec![[0.0, 0.0, 1.0]; points.len()];
        let clock = std::time::Instant::now();
        let chosen = spread(&points, &normals, 60, 0.1, 0);
        let few = spread(&points[..20_000], &normals[..20_000], 60, 0.1, 0);
        assert!(chosen.len() == 60 && few.len() == 60 && clock.elapsed().as_secs() < 20);
        let highest = (0..100_000).max_by(|&i, &j| points[i][1].total_cmp(&points[j][1])).unwrap();
        assert_ne!(chosen[0] as usize, highest);
        assert_eq!(chosen, spread(&points, &normals, 60, 0.1, 0));
    }

    #[test]
    fn the_farthest_points_of_a_line_are_its_ends_and_its_middle() {
        let line: Vec<Point> = (0..=10).map(|i| [0.0, f64::from(i), 0.0]).collect();
        assert_eq!(farthest(&line, 3), [10, 0, 5]);
        assert_eq!(farthest(&[[1.0; 3]; 4], 3).len(), 1);
    }
}
