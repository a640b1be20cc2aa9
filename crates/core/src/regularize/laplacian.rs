//! The uniform cage Laplacian: Δ of every term but a custom one.

use crate::cage::Cage;
use faer::Mat;

/// `Δ = I − D⁻¹A` of the graph of vertices, v × v; with unknown normals, a second block of the
/// graph of faces. Both have the unit of the vertices and need no scaling.
pub(crate) fn cage_laplacian(cage: &Cage, unknowns: usize) -> Mat<f64> {
    let v = cage.vertices().len();
    let mut degree = vec![0.0; v];
    for edge in cage.edges() {
        for end in edge.vertices {
            degree[end as usize] += 1.0;
        }
    }
    let mut delta = Mat::zeros(unknowns, unknowns);
    for i in 0..v {
        delta[(i, i)] = 1.0;
    }
    for edge in cage.edges() {
        let [a, b] = edge.vertices.map(|e| e as usize);
        delta[(a, b)] = -1.0 / degree[a];
        delta[(b, a)] = -1.0 / degree[b];
    }
    if unknowns == v + cage.faces().len() {
        (v..unknowns).for_each(|i| delta[(i, i)] = 1.0);
        for edge in cage.edges() {
            let [f, g] = edge.faces.map(|face| v + face as usize);
            delta[(f, g)] -= 1.0 / 3.0;
            delta[(g, f)] -= 1.0 / 3.0;
        }
    }
    delta
}
