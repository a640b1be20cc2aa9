//! How far one surface lies from another, without a floor from sampling: points to triangles.

use cager_geometry::spatial::Surface;
use cager_geometry::spatial::distance::point_triangle2;
use cager_geometry::vector::Point;
use glam::DVec3;
use rayon::prelude::*;

use super::matching::OrientedPoints;
use super::observation::Observation;
use super::sampling::sample_surface;
use crate::points::{area_vector, vectors};

/// A surface to which points with normals are measured.
pub struct MeasuredSurface {
    shape: Shape,
    /// What distances are shares of.
    size: f64,
}

enum Shape {
    Triangles { surface: Surface, normals: Vec<DVec3> },
    Points { tree: OrientedPoints, points: Vec<DVec3>, normals: Vec<DVec3> },
}

/// What a difference of normals of one adds to distances, in squares, as a share of the size.
const NORMAL_LENGTH: f64 = 0.02;
/// Points of each surface that are measured.
const MEASURED: usize = 3000;

impl MeasuredSurface {
    /// Distances count no more than this share of the size.
    pub const MAX_DISTANCE: f64 = 0.05;

    /// Triangles, facing outwards. Distances are shares of `size`.
    pub fn of_mesh(vertices: &[Point], triangles: &[[u32; 3]], size: f64) -> Self {
        let normal = |t: &[u32; 3]| area_vector(t.map(|v| vertices[v as usize])).normalize_or_zero();
        let normals = triangles.iter().map(normal).collect();
        Self { shape: Shape::Triangles { surface: Surface::new(vectors(vertices), triangles.to_vec()), normals }, size }
    }

    /// Points, each of which stands for the plane through it.
    ///
    /// # Panics
    /// Without points.
    pub fn of_cloud(cloud: &Observation, size: f64) -> Self {
        let tree = OrientedPoints::new(&cloud.points, &cloud.normals, NORMAL_LENGTH * size);
        Self { shape: Shape::Points { tree, points: vectors(&cloud.points), normals: vectors(&cloud.normals) }, size }
    }

    /// Mean distance both ways between this surface, of which `own` are points, and outward
    /// triangles, as a share of the size; what faces away is farther off (by up to 4 %). Distances
    /// beyond 5 % count as 5 %. NaN where one of them is not finite.
    pub fn distance(&self, own: &Observation, vertices: &[Point], triangles: &[[u32; 3]], seed: u64) -> f64 {
        let samples = sample_surface(vertices, triangles, MEASURED, seed);
        let normal = |face: u32| area_vector(triangles[face as usize].map(|v| vertices[v as usize]));
        let there: Vec<f64> = samples
            .par_iter()
            .with_min_len(64)
            .map(|s| self.far(s.at(vertices, triangles).into(), normal(s.face).normalize_or_zero()))
            .collect();
        let other = Self::of_mesh(vertices, triangles, self.size);
        let every = own.points.len().div_ceil(MEASURED).max(1);
        let back: Vec<f64> = (0..own.points.len())
            .into_par_iter()
            .step_by(every)
            .with_min_len(64)
            .map(|k| other.far(own.points[k].into(), own.normals[k].into()))
            .collect();
        let mean = |distances: &[f64]| distances.iter().sum::<f64>() / distances.len() as f64;
        0.5 * (mean(&there) + mean(&back)) / self.size
    }

    /// How far a point with a unit normal is.
    fn far(&self, point: DVec3, normal: DVec3) -> f64 {
        let most = Self::MAX_DISTANCE * self.size;
        let turned = |other: DVec3| (NORMAL_LENGTH * self.size).powi(2) * normal.distance_squared(other);
        if !point.is_finite() {
            return f64::NAN;
        }
        match &self.shape {
            Shape::Triangles { surface, normals } => {
                let distance2 =
                    |face: u32| point_triangle2(point, surface.corners(face)) + turned(normals[face as usize]);
                surface.tree.nearest(point, most * most, distance2).map_or(most, |(_, d2)| d2.sqrt())
            }
            Shape::Points { tree, points, normals } => {
                let (k, d2) = tree.nearest(point, normal);
                let plane = (point - points[k]).dot(normals[k]);
                if d2 < most * most { (plane * plane + turned(normals[k])).sqrt() } else { most }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::observation::ObservationOptions;

    /// A square of so many cells on a side, at a height.
    fn square(cells: u32, height: f64) -> (Vec<Point>, Vec<[u32; 3]>) {
        let at = |i: u32, j: u32| i * (cells + 1) + j;
        let place = |k: u32| f64::from(k) / f64::from(cells);
        let vertices = (0..=cells).flat_map(|i| (0..=cells).map(move |j| [place(i), place(j), height])).collect();
        let cell = |i: u32, j: u32| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        };
        (vertices, (0..cells).flat_map(|i| (0..cells).flat_map(move |j| cell(i, j))).collect())
    }

    #[test]
    fn a_surface_lies_on_itself_however_it_is_meshed_and_sampled() {
        let ((vertices, triangles), (other, others)) = (square(7, 0.0), square(4, 0.0));
        let draw = ObservationOptions { points: 5000, seed: 3 };
        let seen = Observation::of_mesh(&vertices, &triangles, &draw).unwrap().0;
        let surfaces = [MeasuredSurface::of_mesh(&vertices, &triangles, 1.0), MeasuredSurface::of_cloud(&seen, 1.0)];
        for surface in &surfaces {
            let score = surface.distance(&seen, &other, &others, 1);
            assert!(score < 1e-9, "{score}");
            let raised = surface.distance(&seen, &square(4, 0.01).0, &others, 1);
            assert!((raised - 0.01).abs() < 1e-9, "{raised}");
            let far = surface.distance(&seen, &square(4, 1.0).0, &others, 1);
            assert!((far - 0.05).abs() < 1e-9, "{far}");
            let turned: Vec<[u32; 3]> = others.iter().map(|&[a, b, c]| [a, c, b]).collect();
            let turned = surface.distance(&seen, &other, &turned, 1);
            assert!((turned - 0.04).abs() < 1e-9, "{turned}");
        }
    }

    #[test]
    fn what_is_not_finite_has_no_distance() {
        let (vertices, triangles) = square(3, 0.0);
        let seen = Observation::of_mesh(&vertices, &triangles, &ObservationOptions::default()).unwrap().0;
        let surface = MeasuredSurface::of_mesh(&vertices, &triangles, 1.0);
        let lost = vec![[f64::NAN; 3]; vertices.len()];
        assert!(surface.distance(&seen, &lost, &triangles, 1).is_nan());
    }
}
