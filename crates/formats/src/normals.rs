//! Normals of points: those of the triangles around each, weighted by area.

use cager_geometry::vector::cross;

/// Unit normals of `x y z x y z …`, the y axis where a point has no area around it.
pub(crate) fn vertex_normals(positions: &[f32], triangles: &[[u32; 3]], out: &mut Vec<[f32; 3]>) {
    let points = positions.as_chunks::<3>().0;
    let mut sums = vec![[0.0_f64; 3]; points.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|corner| points[corner as usize].map(f64::from));
        let edge = |from: [f64; 3], to: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| to[k] - from[k]) };
        let area = cross(edge(a, b), edge(a, c));
        for &corner in triangle {
            sums[corner as usize].iter_mut().zip(area).for_each(|(sum, x)| *sum += x);
        }
    }
    out.clear();
    out.extend(sums.into_iter().map(unit));
}

/// Of length 1; the y axis where there is no length.
pub(crate) fn unit(vector: [f64; 3]) -> [f32; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() { vector.map(|x| (x / length) as f32) } else { [0.0, 1.0, 0.0] }
}
