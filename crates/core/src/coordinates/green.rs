//! Green coordinates of a closed triangle mesh (Lipman, Levin and Cohen-Or 2008).
//!
//! `x = Σ φ_v v + Σ ψ_f n_f` by Green's third identity, with the closed forms of `layer.rs`. The φ
//! sum to one inside and to zero outside. The deficit `t = 1 − Σ φ` goes to the nearest face, with
//! corners `v_i` and unit normal `n`, by the point's affine coordinates `x = Σ α_i v_i + β n`: `t
//! α_i` to the φ of the corners and `t β` to the ψ of the face. On the cage the result is the limit
//! from inside; outside it is the analytic continuation through that face (§5), which jumps where
//! another face becomes the nearest.
//!
//! Normals have the length ℓ, the square root of the mean area of the faces: `Φ` has no unit.

use super::layer::{self, FaceBasis, Layers, Scratch};
use super::{CageValues, CoordinateSystem, Coordinates, DependentNormals, PointwiseCoordinates, pointwise_coordinates};
use crate::cage::Cage;
use crate::simd::{LANES, Lanes, store};
use cager_geometry::mesh::{self, Point};
use cager_geometry::vector;
use faer::MatMut;

/// Green coordinates: cage vertices and face normals, defined inside and outside the cage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Green {
    /// Normals are functions of the vertices, see [`DependentNormals`]: the inversion is nonlinear.
    #[default]
    Consistent,
    /// Normals are independent unknowns: the least stable case of Thiery et al. 2012.
    Free,
}

/// Rows that sum to one within this are not completed by affine coordinates.
const COMPLETE: f64 = 1e-13;
/// Faces whose distances differ by less than this fraction are equally near.
const EQUALLY_NEAR: f64 = 1e-9;
/// Points closer to the cage than this fraction of its size lie on it.
const ON_CAGE: f64 = 1e-13;

impl CoordinateSystem for Green {
    fn name(&self) -> &'static str {
        match self {
            Self::Consistent => "green",
            Self::Free => "green-free",
        }
    }

    fn values(&self, cage: &Cage) -> CageValues {
        let layers = Layers::new(cage);
        let length = normal_length(&layers) / layers.scale();
        let normals = layers.faces().iter().map(|f| f.normal().map(|c| c * length));
        CageValues {
            rest: cage.vertices().iter().copied().chain(normals).collect(),
            dependent_normals: (*self == Self::Consistent).then(|| DependentNormals::new(cage, length)),
        }
    }

    fn pointwise(&self) -> Option<PointwiseCoordinates> {
        Some(coordinates)
    }
}

fn coordinates(cage: &Cage, points: &[Point]) -> Coordinates {
    let layers = Layers::new(cage);
    let length = normal_length(&layers);
    pointwise_coordinates(
        points.len(),
        cage.vertices().len() + cage.faces().len(),
        || layers.scratch(),
        |first, rows, scratch| rows_of(&layers, length, points, first, rows, scratch),
    )
}

/// Length of the normals, in the unit of the layers.
fn normal_length(layers: &Layers) -> f64 {
    layers.mean_area().sqrt()
}

/// Fills the rows of the points from `first` on; returns the points that lie outside.
fn rows_of(
    layers: &Layers,
    length: f64,
    points: &[Point],
    first: usize,
    mut rows: MatMut<'_, f64>,
    scratch: &mut Scratch,
) -> Vec<u32> {
    let mut outside = Vec::new();
    let (count, vertices) = (rows.nrows(), layers.vertices().len());
    for start in (0..count).step_by(LANES) {
        let x = layers.group(points, first + start);
        layer::group_potentials(layers, &x, scratch);
        let (mut phi, mut psi) = rows.as_mut().split_at_col_mut(vertices);
        store(phi.as_mut(), start, scratch.double.iter().map(|&w| (w * layer::INVERSE_4PI).0));
        store(psi.as_mut(), start, scratch.single.iter().map(|&w| (w * (layer::INVERSE_4PI / length)).0));
        let total = scratch.double.iter().fold(Lanes::ZERO, |sum, &w| sum + w) * layer::INVERSE_4PI;
        for l in 0..LANES.min(count - start) {
            let missing = 1.0 - total.0[l];
            if missing.abs() <= COMPLETE {
                continue;
            }
            for (f, share) in nearest_faces(layers, x.map(|c| c.0[l]), missing) {
                let face = &layers.faces()[f];
                let (weights, height) = face.affine_coordinates(from_corner(layers, face, x.map(|c| c.0[l])));
                for (v, weight) in face.vertices.into_iter().zip(weights) {
                    phi[(start + l, v as usize)] += missing * share * weight;
                }
                psi[(start + l, f)] += missing * share * height / length;
            }
            if total.0[l] < 0.5 {
                outside.push((first + start + l) as u32);
            }
        }
    }
    outside
}

/// The point relative to a face's first corner.
fn from_corner(layers: &Layers, face: &FaceBasis, x: Point) -> Point {
    let corner = layers.vertices()[face.vertices[0] as usize];
    vector::sub(x, corner)
}

/// The nearest faces and their weights, which fall with the angle between normal and direction to
/// the point, so that they vary continuously across edges.
fn nearest_faces(layers: &Layers, x: Point, missing: f64) -> Vec<(usize, f64)> {
    let distance2 =
        |face: &FaceBasis| mesh::distance2_to_triangle(face.vertices.map(|v| layers.vertices()[v as usize]), x);
    let distances: Vec<f64> = layers.faces().iter().map(distance2).collect();
    let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let bound = least * (1.0 + EQUALLY_NEAR) + ON_CAGE * ON_CAGE;
    let distance = least.sqrt();
    let share = |face: &FaceBasis| {
        if distance <= ON_CAGE {
            return 1.0;
        }
        let height = vector::dot(from_corner(layers, face, x), face.normal()) * missing.signum();
        1.0 / ((1.0 - height / distance).max(0.0) + EQUALLY_NEAR)
    };
    let mut found: Vec<(usize, f64)> = layers
        .faces()
        .iter()
        .enumerate()
        .filter(|&(f, _)| distances[f] <= bound)
        .map(|(f, face)| (f, share(face)))
        .collect();
    let total: f64 = found.iter().map(|&(_, share)| share).sum();
    found.iter_mut().for_each(|(_, share)| *share /= total);
    found
}
