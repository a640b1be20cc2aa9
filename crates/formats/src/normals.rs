//! Normals of points: those of the triangles around each, weighted by area.

use cager_geometry::mesh;

/// Unit normals of `x y z x y z …`, the y axis where a point has no area around it.
pub(crate) fn vertex_normals(positions: &[f32], triangles: &[[u32; 3]], out: &mut Vec<[f32; 3]>) {
    let points = positions.as_chunks::<3>().0;
    let sums = mesh::vertex_normals(points.len(), |v| points[v as usize].map(f64::from), triangles);
    out.clear();
    out.extend(sums.into_iter().map(|sum| unit(sum.to_array())));
}

/// Of length 1; the y axis where there is no length.
pub(crate) fn unit(vector: [f64; 3]) -> [f32; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() { vector.map(|x| (x / length) as f32) } else { [0.0, 1.0, 0.0] }
}
