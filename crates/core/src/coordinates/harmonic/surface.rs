//! The closest point of the cage's surface, and whether a point is inside, outside or on it.

use cager_geometry::mesh::{self, Point};
use cager_geometry::vector;
use rayon::prelude::*;

/// Nearer to the surface than this, over the cage's diagonal, a point counts as on it.
const ON_SURFACE: f64 = 1e-9;

/// Side of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    On,
    Outside,
}

/// The point of the surface closest to another.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClosestPoint {
    pub(super) face: u32,
    /// Barycentric coordinates in the face.
    pub(super) weights: [f64; 3],
    pub(super) place: Point,
    pub(super) distance: f64,
    pub(super) side: Side,
}

/// A closed surface with bounding spheres and normals, for closest points.
pub(super) struct Surface<'a> {
    vertices: &'a [Point],
    faces: &'a [[u32; 3]],
    /// Centre and radius of each face.
    spheres: Vec<(Point, f64)>,
    normals: Vec<Point>,
    /// Sums of the normals around each vertex by angle, and the faces across the edges opposite
    /// each corner: they tell the sides of edges and vertices apart (Bærentzen and Aanæs 2005).
    vertex_normals: Vec<Point>,
    across: Vec<[u32; 3]>,
    /// Distance up to which points are on it.
    thickness: f64,
}

impl<'a> Surface<'a> {
    pub(super) fn new(vertices: &'a [Point], cage: &'a crate::cage::Cage) -> Self {
        let faces = cage.mesh().triangles.as_slice();
        let corners = |f: usize| faces[f].map(|v| vertices[v as usize]);
        let mut vertex_normals = vec![[0.0; 3]; vertices.len()];
        let (mut spheres, mut normals) = (Vec::new(), Vec::new());
        for f in 0..faces.len() {
            let p = corners(f);
            let centre = vector::centroid(p);
            spheres.push((centre, p.iter().map(|&p| vector::norm(vector::sub(p, centre))).fold(0.0, f64::max)));
            let normal = vector::cross(vector::sub(p[1], p[0]), vector::sub(p[2], p[0]));
            let length = vector::norm(normal);
            let normal = normal.map(|c| c / length);
            normals.push(normal);
            for i in 0..3 {
                let (a, b) = (vector::sub(p[(i + 1) % 3], p[i]), vector::sub(p[(i + 2) % 3], p[i]));
                let angle = vector::norm(vector::cross(a, b)).atan2(vector::dot(a, b));
                let sum = &mut vertex_normals[faces[f][i] as usize];
                *sum = vector::along(*sum, angle, normal);
            }
        }
        let other =
            |e: u32, f: usize| cage.edges()[e as usize].faces.into_iter().find(|&g| g != f as u32).unwrap_or(f as u32);
        let across = cage.faces().iter().enumerate().map(|(f, face)| face.edges.map(|e| other(e, f))).collect();
        let thickness = ON_SURFACE * mesh::diagonal(vertices);
        Self { vertices, faces, spheres, normals, vertex_normals, across, thickness }
    }

    /// Distance up to which points count as on the surface.
    pub(super) fn thickness(&self) -> f64 {
        self.thickness
    }

    /// The closest point of the surface to each point.
    pub(super) fn closest_points(&self, points: &[Point]) -> Vec<ClosestPoint> {
        points.par_iter().map(|&x| self.closest(x)).collect()
    }

    fn closest(&self, x: Point) -> ClosestPoint {
        // Centres are on the surface, so that the nearest of them bounds the distance.
        let apart: Vec<f64> = self.spheres.iter().map(|(centre, _)| vector::norm(vector::sub(*centre, x))).collect();
        let mut best = apart.iter().copied().fold(f64::INFINITY, f64::min);
        let mut found: Option<([f64; 3], Point, usize)> = None;
        for (f, (_, radius)) in self.spheres.iter().enumerate() {
            if apart[f] - radius > best {
                continue;
            }
            let corners = self.faces[f].map(|v| self.vertices[v as usize]);
            let (weights, place) = nearest_in_triangle(corners, self.normals[f], x);
            let distance = vector::norm(vector::sub(x, place));
            if distance < best || found.is_none() {
                best = distance.min(best);
                found = Some((weights, place, f));
            }
        }
        let (weights, place, face) = found.unwrap_or_default();
        let distance = vector::norm(vector::sub(x, place));
        let away = vector::sub(x, place);
        let at: Vec<usize> = (0..3).filter(|&i| weights[i] != 0.0).collect();
        let normal = match at[..] {
            [corner] => self.vertex_normals[self.faces[face][corner] as usize],
            [a, b] => {
                let other = self.normals[self.across[face][3 - a - b] as usize];
                vector::add(self.normals[face], other)
            }
            _ => self.normals[face],
        };
        let side = if distance <= self.thickness {
            Side::On
        } else if vector::dot(away, normal) > 0.0 {
            Side::Outside
        } else {
            Side::Inside
        };
        ClosestPoint { face: face as u32, weights, place, distance, side }
    }
}

/// The point of a triangle nearest to x, and its weights, by distances to the edges.
fn nearest_in_triangle(corners: [Point; 3], normal: Point, x: Point) -> ([f64; 3], Point) {
    let mut weights = [0.0; 3];
    let mut nearest: Option<([f64; 3], Point)> = None;
    let mut least = f64::INFINITY;
    for i in 0..3 {
        let [j, k] = [(i + 1) % 3, (i + 2) % 3];
        let (p, edge) = (corners[j], vector::sub(corners[k], corners[j]));
        let outward = vector::cross(edge, normal);
        let beyond = vector::dot(outward, vector::sub(x, p));
        weights[i] = beyond / vector::dot(outward, vector::sub(corners[i], p));
        if beyond > 0.0 {
            let t = (vector::dot(edge, vector::sub(x, p)) / vector::dot(edge, edge)).clamp(0.0, 1.0);
            let place = vector::along(p, t, edge);
            let away = vector::sub(x, place);
            if vector::dot(away, away) < least {
                least = vector::dot(away, away);
                let mut at = [0.0; 3];
                (at[j], at[k]) = (1.0 - t, t);
                nearest = Some((at, place));
            }
        }
    }
    nearest.unwrap_or_else(|| {
        let height = vector::dot(normal, vector::sub(x, corners[0]));
        let total: f64 = weights.iter().sum();
        (weights.map(|w| w / total), vector::along(x, -height, normal))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cage::Cage;
    use cager_demo::{Capture, Options};

    #[test]
    fn sides_and_distances_are_those_of_the_winding_number_and_of_all_faces() {
        let mesh = Capture::new(&Options { points: 500, frames: 1, cage_vertices: 60 }).cage;
        let cage = Cage::new(mesh).unwrap();
        let surface = Surface::new(cage.vertices(), &cage);
        let mut generator = fastrand::Rng::with_seed(1);
        let mut random = || generator.f64() - 0.5;
        let (low, high) = mesh::bounds(cage.vertices());
        let mut counts = [0, 0];
        for _ in 0..2000 {
            let x = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]) + 1.2 * random() * (high[k] - low[k]));
            let closest = surface.closest(x);
            let inside = mesh::winding_number(cage.vertices(), &cage.mesh().triangles, x) > 0.5;
            assert_eq!(closest.side, if inside { Side::Inside } else { Side::Outside }, "{x:?}");
            counts[usize::from(inside)] += 1;
            let distance = mesh::distance_to_surface(cage.vertices(), &cage.mesh().triangles, x);
            assert!((closest.distance - distance).abs() < 1e-12 * cage.diagonal(), "{} {distance}", closest.distance);
        }
        assert!(counts.iter().all(|&c| c > 100), "{counts:?}");
    }
}
