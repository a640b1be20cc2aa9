//! What a pose does to a mesh: folded and stretched triangles, volume.

use crate::points::welded;
use cager_geometry::mesh::{Point, TriMesh};
use glam::{DMat3, DVec3};

use crate::deformation::gradients::Gradients;
use crate::points::{area_vector, renamed, vectors};

/// Measures poses of one mesh.
pub struct Quality {
    rest: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    gradients: Gradients,
    /// At rest, of a closed mesh.
    volume: Option<f64>,
}

/// What a pose does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Share of the area whose triangles face against the rotation of their surroundings.
    pub folded: f64,
    /// Share of the area whose triangles are twice as long, or half as long, in some direction.
    pub stretched: f64,
    /// Volume over that at rest; none for a mesh that is not closed.
    pub volume: Option<f64>,
}

/// Passes over which the surroundings' rotation is a mean.
const SURROUNDINGS: usize = 12;

impl Quality {
    /// Of a mesh at rest.
    pub fn new(rest: &TriMesh) -> Self {
        let vertices = vectors(&rest.vertices);
        let volume = is_closed(rest).then(|| volume(&vertices, &rest.triangles)).filter(|volume| *volume != 0.0);
        Self { rest: vertices, triangles: rest.triangles.clone(), gradients: Gradients::new(rest), volume }
    }

    /// Measures a pose.
    pub fn measure(&self, pose: &[Point]) -> Measured {
        let pose = vectors(pose);
        let gradients = self.gradients.of(&pose);
        let rotations = Gradients::rotations(&self.gradients.smoothed(gradients.clone(), SURROUNDINGS));
        let (mut folded, mut stretched, mut total) = (0.0, 0.0, 0.0);
        for (t, triangle) in self.triangles.iter().enumerate() {
            let area = self.gradients.areas()[t];
            let normal = |of: &[DVec3]| area_vector(triangle.map(|v| of[v as usize])).normalize_or_zero();
            let (before, after) = (normal(&self.rest), normal(&pose));
            total += area;
            if after.dot(rotations[t] * before) < 0.0 {
                folded += area;
            }
            let [most, least] = stretches(gradients[t], before);
            if most > 2.0 || least < 0.5 {
                stretched += area;
            }
        }
        let volume = self.volume.map(|at_rest| volume(&pose, &self.triangles) / at_rest);
        Measured { folded: folded / total, stretched: stretched / total, volume }
    }
}

/// The largest and the smallest stretch in the plane with this normal.
fn stretches(gradient: DMat3, normal: DVec3) -> [f64; 2] {
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let (u, v) = (gradient * u, gradient * v);
    let (mean, half, skew) = (0.5 * (u.dot(u) + v.dot(v)), 0.5 * (u.dot(u) - v.dot(v)), u.dot(v));
    let spread = (half * half + skew * skew).sqrt();
    [mean + spread, mean - spread].map(|x| x.max(0.0).sqrt())
}

/// Whether each side of a triangle runs against one of another; vertices at the same place are one.
fn is_closed(mesh: &TriMesh) -> bool {
    let place = welded(&mesh.vertices);
    let faces = renamed(&mesh.triangles, &place);
    let mut sides: Vec<[u32; 2]> =
        faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).filter(|[a, b]| a != b).collect();
    let mut against: Vec<[u32; 2]> = sides.iter().map(|&[a, b]| [b, a]).collect();
    sides.sort_unstable();
    against.sort_unstable();
    sides == against
}

fn volume(points: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| points[v as usize]);
        a.dot(b.cross(c))
    };
    triangles.iter().map(of).sum::<f64>() / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane of 10 × 10 squares, closed by a second one below it where that is asked for.
    fn slab(closed: bool) -> TriMesh {
        let at = |i: u32, j: u32, below: u32| 121 * below + 11 * i + j;
        let layers = 0..1 + u32::from(closed);
        let place = |below: u32| move |k: u32| [f64::from(k / 11), f64::from(k % 11), -f64::from(below)];
        let vertices = layers.clone().flat_map(|below| (0..121).map(place(below))).collect();
        let mut triangles = Vec::new();
        for below in layers {
            for (i, j) in (0..10).flat_map(|i| (0..10).map(move |j| (i, j))) {
                let [a, b, c, d] = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| at(i, j, below));
                triangles.extend(if below == 0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
            }
        }
        if closed {
            for k in 0..10 {
                for [from, to] in
                    [[[k + 1, 0], [k, 0]], [[k, 10], [k + 1, 10]], [[0, k], [0, k + 1]], [[10, k + 1], [10, k]]]
                {
                    let [a, b] = [from, to].map(|[i, j]| at(i, j, 0));
                    triangles.extend([[a, b, b + 121], [a, b + 121, a + 121]]);
                }
            }
        }
        TriMesh { vertices, triangles }
    }

    #[test]
    fn a_flap_that_is_turned_over_is_folded_and_a_long_row_is_stretched() {
        let plane = slab(false);
        let quality = Quality::new(&plane);
        let rest = quality.measure(&plane.vertices);
        assert_eq!(rest, Measured { folded: 0.0, stretched: 0.0, volume: None });
        // The corner goes over its own triangle.
        let mut pose = plane.vertices.clone();
        pose[10] = [2.0, 8.0, 0.0];
        assert!((quality.measure(&pose).folded - 0.005).abs() < 1e-9, "{:?}", quality.measure(&pose));
        let wide: Vec<Point> =
            plane.vertices.iter().map(|p| [p[0] + 2.0 * (p[0] - 9.0).max(0.0), p[1], p[2]]).collect();
        assert!((quality.measure(&wide).stretched - 0.1).abs() < 1e-9);
        let narrow: Vec<Point> =
            plane.vertices.iter().map(|p| [p[0] - 0.6 * (p[0] - 8.0).max(0.0), p[1], p[2]]).collect();
        assert!((quality.measure(&narrow).stretched - 0.2).abs() < 1e-9);
    }

    #[test]
    fn only_a_closed_mesh_has_a_volume() {
        let closed = slab(true);
        let grown: Vec<Point> = closed.vertices.iter().map(|p| p.map(|x| 1.1 * x + 5.0)).collect();
        assert!((Quality::new(&closed).measure(&grown).volume.unwrap() - 1.331).abs() < 1e-9);
        let mut open = closed.clone();
        open.triangles.pop();
        assert_eq!(Quality::new(&open).measure(&grown).volume, None);
    }
}
