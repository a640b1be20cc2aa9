//! The uniform cage Laplacian.

use crate::cage::Cage;
use faer::Mat;

/// `Δ = I − D⁻¹A` of the cage's vertex graph, v × v: each vertex minus the mean of its neighbours.
pub(crate) fn cage_laplacian(cage: &Cage) -> Mat<f64> {
    let v = cage.vertices().len();
    let mut degree = vec![0.0; v];
    for edge in cage.edges() {
        for end in edge.vertices {
            degree[end as usize] += 1.0;
        }
    }
    let mut delta = Mat::identity(v, v);
    for edge in cage.edges() {
        let [a, b] = edge.vertices.map(|e| e as usize);
        delta[(a, b)] = -1.0 / degree[a];
        delta[(b, a)] = -1.0 / degree[b];
    }
    delta
}
