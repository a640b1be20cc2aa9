//! Face normals as functions of the vertices of a deformed cage (Lipman, Levin and Cohen-Or 2008,
//! Eq. 8): the unit normal of each face, times the factor by which the face is stretched.
//!
//! With edges `u`, `v` of a face at rest and `u'`, `v'` of the deformed one, `s² = (|u'|²|v|² − 2
//! (u'·v')(u·v) + |v'|²|u|²) / 8 area²`, the mean square of the face's two factors of stretch. The
//! normal of a collapsed face is zero.

use crate::cage::Cage;
use cager_geometry::mesh::Point;
use cager_geometry::vector::{cross, dot, norm, sub};

/// Computes a cage's face normals from its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct DependentNormals {
    faces: Vec<[u32; 3]>,
    /// Of each face, factors of `|u'|²`, `u'·v'` and `|v'|²` in the square of the normal's length.
    weights: Vec<[f64; 3]>,
}

/// Derivatives of a face's normal with respect to `u'` and `v'`, each row by row.
pub type Derivative = [[Point; 3]; 2];

impl DependentNormals {
    /// Normals of this length at rest.
    pub fn new(cage: &Cage, length: f64) -> Self {
        let faces: Vec<[u32; 3]> = cage.faces().iter().map(|face| face.vertices).collect();
        let weights = faces.iter().map(|&face| {
            let [u, v] = edges(face, |i| cage.vertices()[i as usize]);
            let double_area = norm(cross(u, v));
            let scaled = |x: f64| 0.5 * (x / double_area) * (length / double_area) * length;
            [scaled(dot(v, v)), scaled(-2.0 * dot(u, v)), scaled(dot(u, u))]
        });
        Self { weights: weights.collect(), faces }
    }

    /// From [`Self::faces`] and [`Self::weights`]; `None` where they do not fit together.
    pub fn from_parts(faces: Vec<[u32; 3]>, weights: Vec<[f64; 3]>, vertices: usize) -> Option<Self> {
        let fits = faces.len() == weights.len()
            && faces.iter().flatten().all(|&v| (v as usize) < vertices)
            && weights.iter().flatten().all(|w| w.is_finite());
        fits.then_some(Self { faces, weights })
    }

    /// Corners of the faces, counter-clockwise.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Of each face, factors of `|u'|²`, `u'·v'` and `|v'|²` in the square of the normal's length.
    pub fn weights(&self) -> &[[f64; 3]] {
        &self.weights
    }

    /// The normal of each face, in the order of the faces, of the cage with these vertices.
    pub fn normals(&self, vertex: impl Fn(u32) -> Point) -> impl Iterator<Item = Point> {
        self.faces.iter().zip(&self.weights).map(move |(&face, weights)| {
            let [u, v] = edges(face, &vertex);
            let normal = cross(u, v);
            let scale = length2(weights, u, v).max(0.0).sqrt() / norm(normal);
            if scale.is_finite() { normal.map(|c| c * scale) } else { [0.0; 3] }
        })
    }

    /// Derivatives of each face's normal by the edges from its first corner to the other two.
    pub fn derivatives(&self, vertices: &[Point]) -> Vec<Derivative> {
        let of_face = |(&face, weights): (&[u32; 3], &[f64; 3])| {
            let [u, v] = edges(face, |i| vertices[i as usize]);
            let normal = cross(u, v);
            let (area, length) = (norm(normal), length2(weights, u, v).max(0.0).sqrt());
            let (turn, stretch) = (length / area, 0.5 / length);
            if !turn.is_finite() || !stretch.is_finite() {
                return [[[0.0; 3]; 3]; 2];
            }
            let unit = normal.map(|c| c / area);
            let [a, b, c] = *weights;
            let along = [[0, 1, 2].map(|k| 2.0 * a * u[k] + b * v[k]), [0, 1, 2].map(|k| 2.0 * c * v[k] + b * u[k])];
            // d(u × v) = du × v + u × dv; the component orthogonal to the normal rotates it.
            [0, 1].map(|side| {
                let mut rows = [[0.0; 3]; 3];
                for k in 0..3 {
                    let mut step = [0.0; 3];
                    step[k] = 1.0;
                    let change = if side == 0 { cross(step, v) } else { cross(u, step) };
                    let outwards = dot(unit, change);
                    for i in 0..3 {
                        rows[i][k] = turn * (change[i] - outwards * unit[i]) + stretch * along[side][k] * unit[i];
                    }
                }
                rows
            })
        };
        self.faces.iter().zip(&self.weights).map(of_face).collect()
    }
}

fn edges(face: [u32; 3], vertex: impl Fn(u32) -> Point) -> [Point; 2] {
    let [a, b, c] = face.map(vertex);
    [sub(b, a), sub(c, a)]
}

fn length2([a, b, c]: &[f64; 3], u: Point, v: Point) -> f64 {
    a * dot(u, u) + b * dot(u, v) + c * dot(v, v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::mesh::TriMesh;

    fn cage() -> Cage {
        let vertices = vec![[0.1, 0.2, 0.0], [3.1, 0.0, 0.3], [0.4, 1.9, -0.2], [0.7, 0.5, 2.2]];
        Cage::new(TriMesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] }).unwrap()
    }

    fn of(dependent: &DependentNormals, vertices: &[Point]) -> Vec<Point> {
        dependent.normals(|v| vertices[v as usize]).collect()
    }

    #[test]
    fn normals_turn_with_a_cage_and_grow_with_its_stretch() {
        let (cage, length) = (cage(), 0.7);
        let dependent = DependentNormals::new(&cage, length);
        let rest = of(&dependent, cage.vertices());
        assert!(rest.iter().all(|n| (norm(*n) - length).abs() < 1e-14));
        let turned: Vec<Point> = cage.vertices().iter().map(|p| [-3.0 * p[1], 3.0 * p[0], 3.0 * p[2] + 5.0]).collect();
        for (a, b) in rest.iter().zip(of(&dependent, &turned)) {
            let expected = [-3.0 * a[1], 3.0 * a[0], 3.0 * a[2]];
            assert!((0..3).all(|k| (expected[k] - b[k]).abs() < 1e-13), "{expected:?} {b:?}");
        }
    }

    #[test]
    fn collapsed_faces_have_no_normal() {
        let cage = cage();
        let dependent = DependentNormals::new(&cage, 1.0);
        let mut line = cage.vertices().to_vec();
        line[1] = line[0];
        for vertices in [vec![[0.5; 3]; 4], line, vec![[0.0; 3]; 4]] {
            let normals = of(&dependent, &vertices);
            assert!(normals.iter().flatten().all(|c| c.is_finite()));
            assert_eq!(normals[1], [0.0; 3]);
            assert!(dependent.derivatives(&vertices).iter().flatten().flatten().flatten().all(|c| c.is_finite()));
        }
    }

    #[test]
    fn derivatives_are_those_of_the_normals() {
        let cage = cage();
        let dependent = DependentNormals::new(&cage, 0.4);
        let deformed: Vec<Point> =
            cage.vertices().iter().map(|p| [p[0] + 0.2 * p[1] * p[2], 0.7 * p[1] - 0.1 * p[0] * p[0], p[2]]).collect();
        let derivatives = dependent.derivatives(&deformed);
        const STEP: f64 = 1e-6;
        for (f, face) in dependent.faces().iter().enumerate() {
            for (side, &corner) in face[1..].iter().enumerate() {
                for k in 0..3 {
                    let moved = |by: f64| {
                        let mut vertices = deformed.clone();
                        vertices[corner as usize][k] += by;
                        of(&dependent, &vertices)[f]
                    };
                    let (up, down) = (moved(STEP), moved(-STEP));
                    for i in 0..3 {
                        let expected = (up[i] - down[i]) / (2.0 * STEP);
                        assert!((derivatives[f][side][i][k] - expected).abs() < 1e-8, "face {f}");
                    }
                }
            }
        }
    }
}
