//! Vertices of a cage without effect on a model, and the condition number of the coordinates.

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_geometry::linalg::{multiply, svd::svd};
use cager_geometry::mesh::{Model, Point, TriMesh};
use faer::{Mat, MatRef};

/// A vertex moves no point when none of its coordinates is larger.
const IDLE: f64 = 1e-4;

/// Maximum number of coordinates evaluated; points are subsampled accordingly.
const MAX_ENTRIES: usize = 20_000_000;

/// Cages with more vertices are not analysed: it would take minutes.
const MAX_ANALYSED_VERTICES: usize = 2_000;

/// Vertices that move no point, and the condition number; not of thousands of vertices.
pub(super) fn influence(mesh: &TriMesh, model: &Model) -> (Vec<u32>, Option<f64>) {
    let Ok(cage) = Cage::new(mesh.clone()) else { return (Vec::new(), None) };
    if mesh.vertices.len() > MAX_ANALYSED_VERTICES {
        return (Vec::new(), None);
    }
    let stride = (model.points.len() * mesh.vertices.len()).div_ceil(MAX_ENTRIES).max(1);
    let points: Vec<Point> = model.points.iter().step_by(stride).copied().collect();
    let Ok(coordinates) = MeanValue.coordinates(&cage, &points, None) else { return (Vec::new(), None) };
    let phi = &coordinates.phi;
    let most = |v: usize| (0..phi.nrows()).map(|i| phi[(i, v)].abs()).fold(0.0, f64::max);
    let idle = (0..phi.ncols()).filter(|&v| most(v) < IDLE).map(|v| v as u32).collect();
    let condition = (phi.nrows() >= phi.ncols()).then(|| condition_number(phi.as_ref())).flatten();
    (idle, condition)
}

/// From the eigenvalues of the Gram matrix: above 10⁷ only its order is known.
fn condition_number(phi: MatRef<'_, f64>) -> Option<f64> {
    let mut gram = Mat::zeros(phi.ncols(), phi.ncols());
    multiply(gram.as_mut(), phi.transpose(), phi);
    let squares = svd(gram.as_ref())?.sigma;
    Some((squares.first()? / squares.last()?).sqrt())
}
