//! Bounding shapes as cages: a box, a sphere or a convex hull around one model or several together.

mod hull;

use crate::EncloseError;
use crate::enclose::{check_finite, extent};
use cager_geometry::mesh::{Model, Point, TriMesh};
use glam::DVec3;
use std::collections::HashMap;

/// The shape of a cage that is not made to a model's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundingShape {
    /// The bounding box, its sides divided evenly.
    Box,
    /// A geodesic sphere.
    Sphere,
    /// The convex hull, simplified and enlarged.
    Hull,
}

/// Least distance of a point from the cage, as a fraction of the diagonal of all models.
const MARGIN: f64 = 0.01;

/// A closed, outward-oriented cage of this shape, of at most `vertices` vertices around all points.
///
/// # Errors
/// Models without points or extent, or with coordinates that are not finite, and fewer vertices
/// than the shape needs: 8 for a box, 12 for a sphere, 4 for a hull.
pub fn bounding_shape(models: &[&Model], shape: BoundingShape, vertices: usize) -> Result<TriMesh, EncloseError> {
    for model in models {
        check_finite(&model.points)?;
    }
    let points: Vec<Point> = models.iter().flat_map(|m| &m.points).copied().collect();
    let (low, high, extent) = extent(&points)?;
    let least = match shape {
        BoundingShape::Box => 8,
        BoundingShape::Sphere => 12,
        BoundingShape::Hull => 4,
    };
    if vertices < least {
        return Err(EncloseError::TooFewVertices { vertices, least });
    }
    let margin = MARGIN * extent;
    let center = 0.5 * low + 0.5 * high;
    Ok(match shape {
        BoundingShape::Box => placed(divided_cube(vertices), center, 0.5 * (high - low) + margin),
        BoundingShape::Sphere => {
            let sphere = geodesic_sphere(vertices);
            let reach = points.iter().map(|&p| center.distance(p.into())).fold(0.0, f64::max);
            let radius = (reach + margin) / inradius(&sphere);
            placed(sphere, center, DVec3::splat(radius))
        }
        BoundingShape::Hull => hull::enlarged_hull(&points, vertices, margin),
    })
}

/// A mesh of the origin's surroundings stretched and moved.
fn placed((vertices, triangles): (Vec<DVec3>, Vec<[u32; 3]>), center: DVec3, scale: DVec3) -> TriMesh {
    TriMesh { vertices: vertices.iter().map(|&v| (center + scale * v).to_array()).collect(), triangles }
}

/// The cube of half width one with k × k squares on every side, 6k² + 2 vertices.
fn divided_cube(vertices: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let k = (((vertices - 2) / 6) as f64).sqrt().floor() as i64;
    let mut numbered = Numbered::default();
    for axis in 0..3 {
        for side in [0, k] {
            for (i, j) in (0..k).flat_map(|i| (0..k).map(move |j| (i, j))) {
                let corner = |di: i64, dj: i64| {
                    let mut at = [0; 3];
                    at[axis] = side;
                    at[(axis + 1) % 3] = i + di;
                    at[(axis + 2) % 3] = j + dj;
                    at
                };
                let [a, b, c, d] =
                    [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].map(|at| numbered.index(at));
                if side == k {
                    numbered.triangles.extend([[a, b, c], [a, c, d]]);
                } else {
                    numbered.triangles.extend([[a, c, b], [a, d, c]]);
                }
            }
        }
    }
    let place = |at: &[i64; 3]| DVec3::from_array(at.map(|x| 2.0 * x as f64 / k as f64 - 1.0));
    (numbered.places.iter().map(place).collect(), numbered.triangles)
}

/// The icosahedron with every face divided into f² and put on the unit sphere, 10f² + 2 vertices.
fn geodesic_sphere(vertices: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let f = (((vertices - 2) / 10) as f64).sqrt().floor() as i64;
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let corners: Vec<DVec3> = (0..3)
        .flat_map(|axis| {
            [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(s, t)| {
                let mut p = [0.0; 3];
                p[(axis + 1) % 3] = s;
                p[(axis + 2) % 3] = t * golden;
                DVec3::from_array(p)
            })
        })
        .collect();
    let near = |i: usize, j: usize| (corners[i].distance(corners[j]) - 2.0).abs() < 1e-6;
    let mut numbered: Numbered<[(usize, i64); 3]> = Numbered::default();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if !(near(a, b) && near(b, c) && near(a, c)) {
                    continue;
                }
                let outward = (corners[b] - corners[a]).cross(corners[c] - corners[a]).dot(corners[a]) > 0.0;
                let [a, b, c] = if outward { [a, b, c] } else { [a, c, b] };
                let at = |i: i64, j: i64| {
                    // Weights of the icosahedron's vertices name a point from any face.
                    let mut place =
                        [(a, f - i - j), (b, i), (c, j)].map(|(v, w)| if w == 0 { (12, 0) } else { (v, w) });
                    place.sort_unstable();
                    place
                };
                for (i, j) in (0..f).flat_map(|i| (0..f - i).map(move |j| (i, j))) {
                    let [p, q, r] = [at(i, j), at(i + 1, j), at(i, j + 1)].map(|x| numbered.index(x));
                    numbered.triangles.push([p, q, r]);
                    if i + j + 1 < f {
                        let s = numbered.index(at(i + 1, j + 1));
                        numbered.triangles.push([q, s, r]);
                    }
                }
            }
        }
    }
    let direction = |place: &[(usize, i64); 3]| {
        let weighted = place.iter().filter(|(v, _)| *v < 12).map(|&(v, w)| corners[v] * w as f64);
        weighted.sum::<DVec3>().normalize()
    };
    (numbered.places.iter().map(direction).collect(), numbered.triangles)
}

/// Least distance of a face's plane from the origin.
fn inradius((vertices, triangles): &(Vec<DVec3>, Vec<[u32; 3]>)) -> f64 {
    let height = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        (b - a).cross(c - a).normalize().dot(a)
    };
    triangles.iter().map(height).fold(f64::INFINITY, f64::min)
}

/// Vertices numbered in the order in which they are first named.
#[derive(Default)]
struct Numbered<K> {
    numbers: HashMap<K, u32>,
    places: Vec<K>,
    triangles: Vec<[u32; 3]>,
}

impl<K: Copy + Eq + std::hash::Hash> Numbered<K> {
    fn index(&mut self, place: K) -> u32 {
        *self.numbers.entry(place).or_insert_with(|| {
            self.places.push(place);
            self.places.len() as u32 - 1
        })
    }
}
