//! Triangles turned to face outwards.

use crate::points::{renamed, welded};
use cager_geometry::topology::orientations;
use cager_geometry::vector::{Point, cross, dot, mean, sub};
use rayon::prelude::*;

/// Triangles that face outwards, as far as that can be told.
pub(crate) struct Oriented {
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Faces that ran against their neighbours.
    pub(crate) turned_faces: usize,
    /// Whether all were turned.
    pub(crate) turned: bool,
}

/// Turns faces that run against their neighbours, part by part, then all where they enclose a
/// negative volume. Vertices at one place are one.
pub(crate) fn oriented(vertices: &[Point], triangles: &[[u32; 3]]) -> Oriented {
    let links = links(&renamed(triangles, &welded(vertices)));
    let mut triangles = triangles.to_vec();
    let against = links.iter().any(|link| link.against);
    let turned_faces = if against { turn_parts(vertices, &mut triangles, &links) } else { 0 };
    let turned = volume6(vertices, &triangles, mean(vertices)) < 0.0;
    if turned {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    Oriented { triangles, turned_faces, turned }
}

/// Triangles turned outwards: those against their neighbours, then all if their volume is negative.
pub fn outward(vertices: &[Point], triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    oriented(vertices, triangles).triangles
}

/// Two faces that meet at an edge of no other face.
struct Link {
    faces: [u32; 2],
    /// Whether they run along it in the same direction, one of them wrongly.
    against: bool,
}

fn links(triangles: &[[u32; 3]]) -> Vec<Link> {
    let mut sides: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * triangles.len());
    for (face, &[a, b, c]) in triangles.iter().enumerate() {
        let real = [[a, b], [b, c], [c, a]].into_iter().filter(|[u, v]| u != v);
        sides.extend(real.map(|[u, v]| ([u.min(v), u.max(v)], face as u32, u < v)));
    }
    sides.par_sort_unstable();
    sides
        .chunk_by(|a, b| a.0 == b.0)
        .filter_map(|at| match at {
            [(_, f, forth), (_, g, back)] => Some(Link { faces: [*f, *g], against: forth == back }),
            _ => None,
        })
        .collect()
}

/// Makes linked faces agree where they can, and each part's volume positive. How many were turned.
fn turn_parts(vertices: &[Point], triangles: &mut [[u32; 3]], links: &[Link]) -> usize {
    let mut of_face: Vec<Vec<(u32, bool)>> = vec![Vec::new(); triangles.len()];
    for &Link { faces: [f, g], against } in links {
        of_face[f as usize].push((g, against));
        of_face[g as usize].push((f, against));
    }
    let mut turned = 0;
    for part in orientations(&of_face) {
        let faces: Vec<[u32; 3]> = part
            .iter()
            .map(|&(face, turn)| {
                let [a, b, c] = triangles[face as usize];
                if turn { [a, c, b] } else { [a, b, c] }
            })
            .collect();
        let corners: Vec<Point> = faces.iter().flatten().map(|&v| vertices[v as usize]).collect();
        let inside_out = volume6(vertices, &faces, mean(&corners)) < 0.0;
        for (face, turn) in part {
            if turn != inside_out {
                triangles[face as usize].swap(1, 2);
                turned += 1;
            }
        }
    }
    turned
}

/// Six times the volume that triangles enclose with cones from `center` over their borders.
fn volume6(vertices: &[Point], triangles: &[[u32; 3]], center: Point) -> f64 {
    let from = |v: u32| sub(vertices[v as usize], center);
    triangles.iter().map(|&[a, b, c]| dot(from(a), cross(from(b), from(c)))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of side 2, each face of which has vertices of its own.
    fn cube() -> (Vec<Point>, Vec<[u32; 3]>) {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let first = vertices.len() as u32;
                for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, side * v);
                    vertices.push(p);
                }
                triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        (vertices, triangles)
    }

    #[test]
    fn a_cube_with_doubled_vertices_comes_out_outward_however_its_faces_run() {
        let (vertices, triangles) = cube();
        let right = oriented(&vertices, &triangles);
        assert_eq!((right.turned_faces, right.turned), (0, false));
        let inward: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let found = oriented(&vertices, &inward);
        assert_eq!((found.turned_faces, found.turned, found.triangles), (0, true, triangles.clone()));
        let mixed: Vec<[u32; 3]> = triangles
            .iter()
            .enumerate()
            .map(|(k, &[a, b, c])| if k % 5 == 0 { [a, c, b] } else { [a, b, c] })
            .collect();
        let found = oriented(&vertices, &mixed);
        assert_eq!((found.turned_faces, found.turned), (3, false));
        assert!((volume6(&vertices, &found.triangles, [9.0, 0.0, 0.0]) - 48.0).abs() < 1e-12);
    }
}
