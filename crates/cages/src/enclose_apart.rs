//! A cage whose parts move apart as those of its model do.

use crate::enclose::{EncloseError, EncloseOptions, enclose};
use cager_geometry::mesh::{Model, TriMesh};

/// How many times the vertices asked for a cage may have, where fewer leave limbs joined.
const MORE_VERTICES: [f64; 2] = [1.3, 1.7];

/// [`enclose`] by about so many vertices, for a model whose limbs move apart. Few vertices enclose
/// limbs close together in one surface, with handles; more are tried then, and the cage with the
/// fewest handles is taken.
///
/// # Errors
/// See [`EncloseError`].
pub fn enclose_apart(model: &Model, vertices: usize) -> Result<TriMesh, EncloseError> {
    let around = |vertices: usize| enclose(model, &EncloseOptions { vertices, ..Default::default() });
    let mut cage = around(vertices)?;
    for more in MORE_VERTICES {
        let vertices = (more * vertices as f64) as usize;
        if joints(&cage) <= NO_HANDLES || vertices > model.points.len() / 2 {
            break;
        }
        if let Ok(made) = around(vertices)
            && joints(&made) < joints(&cage)
        {
            cage = made;
        }
    }
    Ok(cage)
}

/// [`joints`] of one closed surface without handles; of two, less.
const NO_HANDLES: i64 = -2;

/// Twice the number of handles less that of surfaces, by Euler's formula.
fn joints(cage: &TriMesh) -> i64 {
    cage.triangles.len() as i64 / 2 - cage.vertices.len() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::mesh::{Point, Polygons};

    /// Boxes, finely divided, which are joined at their low ends along y by nothing but being in
    /// one model.
    fn boxes(centers: &[Point], half: Point) -> Model {
        const ALONG: usize = 24;
        let (mut points, mut faces) = (Vec::new(), Polygons::new());
        for center in centers {
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for side in [-1.0, 1.0] {
                    let first = points.len() as u32;
                    for (i, j) in (0..=ALONG).flat_map(|i| (0..=ALONG).map(move |j| (i, j))) {
                        let mut p = *center;
                        p[axis] += side * half[axis];
                        p[u] += half[u] * (2.0 * i as f64 / ALONG as f64 - 1.0);
                        p[v] += half[v] * (2.0 * j as f64 / ALONG as f64 - 1.0);
                        points.push(p);
                    }
                    let at = |i: usize, j: usize| first + (i * (ALONG + 1) + j) as u32;
                    for (i, j) in (0..ALONG).flat_map(|i| (0..ALONG).map(move |j| (i, j))) {
                        let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                        let turned = [quad[3], quad[2], quad[1], quad[0]];
                        faces.push(if side > 0.0 { &quad } else { &turned });
                    }
                }
            }
        }
        Model { points, faces, ..Model::default() }
    }

    #[test]
    fn a_plain_shape_has_no_handle_and_keeps_the_vertices_asked_for() {
        let cage = enclose_apart(&boxes(&[[0.0; 3]], [0.1, 1.0, 0.1]), 60).unwrap();
        assert!(cage.vertices.len() <= 60);
        assert_eq!(joints(&cage), NO_HANDLES);
    }

    #[test]
    fn a_frame_keeps_its_hole_whose_handle_no_vertices_remove() {
        let frame = [([-0.5, 0.0, 0.0], [0.1, 0.6, 0.1]), ([0.5, 0.0, 0.0], [0.1, 0.6, 0.1])];
        let bars = [([0.0, 0.5, 0.0], [0.6, 0.1, 0.1]), ([0.0, -0.5, 0.0], [0.6, 0.1, 0.1])];
        let mut model = Model::default();
        for (center, half) in frame.into_iter().chain(bars) {
            let one = boxes(&[center], half);
            let first = model.points.len() as u32;
            model.points.extend(&one.points);
            one.faces.iter().for_each(|face| {
                model.faces.push(&face.iter().map(|v| v + first).collect::<Vec<_>>());
            });
        }
        let cage = enclose_apart(&model, 100).unwrap();
        assert!(cage.vertices.len() <= 100, "{}", cage.vertices.len());
        assert_eq!(joints(&cage), 0);
    }
}
