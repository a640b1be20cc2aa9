//! Points as vectors and as matrices, and what they determine: normals, moments.

use cager_core::coordinates::DependentNormals;
use cager_geometry::linalg::{symmetric_eigen, tall_product};
pub use cager_geometry::mesh::welded;
use cager_geometry::mesh::{self, Point};
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3};

/// As vectors.
pub(crate) fn vectors(points: &[Point]) -> Vec<DVec3> {
    points.iter().map(|&p| p.into()).collect()
}

/// As plain points.
pub(crate) fn plain(points: &[DVec3]) -> Vec<Point> {
    points.iter().map(DVec3::to_array).collect()
}

/// Points as a matrix, n × 3.
pub(crate) fn matrix<P: Copy + Into<Point>>(points: &[P]) -> Mat<f64> {
    Mat::from_fn(points.len(), 3, |i, k| points[i].into()[k])
}

/// The rows of an n × 3 matrix as points.
pub(crate) fn row_points<P: From<Point>>(matrix: MatRef<'_, f64>) -> Vec<P> {
    (0..matrix.nrows()).map(|i| [0, 1, 2].map(|k| matrix[(i, k)]).into()).collect()
}

/// The points with these coordinates in a cage of these values.
pub(crate) fn points_in<P: From<Point>>(phi: MatRef<'_, f64>, values: MatRef<'_, f64>) -> Vec<P> {
    row_points(tall_product(phi, values).as_ref())
}

/// Values of a cage, one row a column of coordinates: its vertices, then the normals that follow.
pub(crate) fn cage_values(normals: Option<&DependentNormals>, vertices: &[Point]) -> Mat<f64> {
    let normals = normals.into_iter().flat_map(|normals| normals.normals(|v| vertices[v as usize]));
    matrix(&vertices.iter().copied().chain(normals).collect::<Vec<_>>())
}

/// The least and the greatest of some numbers.
pub(crate) fn range(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    numbers.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// The mean of points; NaN without any.
pub(crate) fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len() as f64
}

/// The outer product `a bᵀ`.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The sum of the diagonal.
pub(crate) fn trace(a: DMat3) -> f64 {
    a.x_axis.x + a.y_axis.y + a.z_axis.z
}

/// Twice the area of a triangle times its unit normal.
pub(crate) fn area_vector<P: Into<DVec3>>(corners: [P; 3]) -> DVec3 {
    let [a, b, c] = corners.map(Into::into);
    (b - a).cross(c - a)
}

/// Unit normals of vertices, by area; zero for vertices without triangles.
pub(crate) fn vertex_normals<P: Copy + Into<DVec3>>(vertices: &[P], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let normals = mesh::vertex_normals(vertices.len(), |v| vertices[v as usize], triangles);
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// [`vertex_normals`], the same one for vertices at the same place.
pub(crate) fn welded_normals(vertices: &[Point], triangles: &[[u32; 3]]) -> Vec<Point> {
    let place = welded(vertices);
    let normals = vertex_normals(vertices, &renamed(triangles, &place));
    place.iter().map(|&first| normals[first as usize].to_array()).collect()
}

/// Triangles whose corners have these other numbers.
pub(crate) fn renamed(triangles: &[[u32; 3]], names: &[u32]) -> Vec<[u32; 3]> {
    triangles.iter().map(|triangle| triangle.map(|v| names[v as usize])).collect()
}

/// Mean and covariance of points.
pub(crate) struct Moments {
    pub(crate) center: DVec3,
    /// Variances along the principal axes, the largest first.
    pub(crate) variances: [f64; 3],
    pub(crate) axes: [DVec3; 3],
}

impl Moments {
    pub(crate) fn new<P: Copy + Into<DVec3>>(points: &[P]) -> Self {
        let count = points.len().max(1) as f64;
        let center = points.iter().map(|&p| p.into()).sum::<DVec3>() / count;
        let covariance = points.iter().fold(DMat3::ZERO, |sum, &p| {
            let offset = p.into() - center;
            sum + outer(offset, offset)
        });
        let (variances, axes) = symmetric_eigen((covariance * (1.0 / count)).to_cols_array_2d());
        Self { center, variances, axes: axes.map(DVec3::from) }
    }
}
