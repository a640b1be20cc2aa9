//! Triangles of a polygon: a fan where it is convex, otherwise ears (Meisters 1975).

use super::Point;
use crate::vector::{cross, dot, norm, sub};

/// Triangles of less than this share of the polygon's area have none.
const NO_AREA: f64 = 1e-12;
/// Corners of a polygon whose ears are looked for, in quadratic time; larger ones are fans.
const MOST_CORNERS: usize = 8192;

/// Appends the triangles of a face: two fewer than it has corners, oriented as it is.
pub(super) fn triangulate(face: &[u32], points: &[Point], triangles: &mut Vec<[u32; 3]>) {
    let fan = |corners: &[u32], triangles: &mut Vec<[u32; 3]>| {
        triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
    };
    let place = |v: &u32| points.get(*v as usize).copied().filter(|p| p.iter().all(|x| x.is_finite()));
    let Some(at) =
        face.iter().map(place).collect::<Option<Vec<Point>>>().filter(|at| (4..=MOST_CORNERS).contains(&at.len()))
    else {
        return fan(face, triangles);
    };
    let Some((flat, area)) = flattened(&at) else { return fan(face, triangles) };
    let area_of = |[a, b, c]: [usize; 3]| doubled_area(flat[a], flat[b], flat[c]);
    let least = NO_AREA * area;
    if (2..face.len()).all(|k| area_of([0, k - 1, k]) > least) {
        return fan(face, triangles);
    }
    let mut left: Vec<usize> = (0..face.len()).collect();
    let mut from = 0;
    while left.len() > 3 {
        let n = left.len();
        let corners = |tip: usize| [left[(tip + n - 1) % n], left[tip % n], left[(tip + 1) % n]];
        let is_ear = |tip: &usize| {
            let ear = corners(*tip);
            area_of(ear) > least && left.iter().all(|&v| ear.contains(&v) || !covers(ear.map(|k| flat[k]), flat[v]))
        };
        let Some(tip) = (from..from + n).find(is_ear) else { break };
        triangles.push(corners(tip).map(|k| face[k]));
        left.remove(tip % n);
        // On from there, so that ears are not clipped about one corner alone.
        from = tip % n;
    }
    // Three corners, or what crosses itself.
    fan(&left.iter().map(|&k| face[k]).collect::<Vec<_>>(), triangles);
}

/// The corners in the polygon's plane, counter-clockwise, and twice its area; none without area.
fn flattened(at: &[Point]) -> Option<(Vec<[f64; 2]>, f64)> {
    let from_first = |k: usize| sub(at[k], at[0]);
    // Newell's normal.
    let normal = (2..at.len())
        .map(|k| cross(from_first(k - 1), from_first(k)))
        .fold([0.0; 3], |sum, c| [0, 1, 2].map(|k| sum[k] + c[k]));
    let area = norm(normal);
    let reach = (1..at.len()).map(|k| dot(from_first(k), from_first(k))).fold(0.0, f64::max);
    if !(area > NO_AREA * reach && area.is_finite()) {
        return None;
    }
    let normal = normal.map(|x| x / area);
    let least = (0..3).min_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs())).unwrap_or(0);
    let side = cross(normal, std::array::from_fn(|k| if k == least { 1.0 } else { 0.0 }));
    let side = side.map(|x| x / norm(side));
    let up = cross(normal, side);
    Some(((0..at.len()).map(|k| [dot(from_first(k), side), dot(from_first(k), up)]).collect(), area))
}

fn doubled_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether a point lies in a counter-clockwise triangle or on its border, other than in a corner.
fn covers([a, b, c]: [[f64; 2]; 3], p: [f64; 2]) -> bool {
    let is_corner = [a, b, c].contains(&p);
    !is_corner && [(a, b), (b, c), (c, a)].iter().all(|&(from, to)| doubled_area(from, to, p) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The triangles of a flat polygon that was turned about in space, and its corners.
    fn turned(corners: &[[f64; 2]], first: usize) -> (Vec<[u32; 3]>, Vec<Point>) {
        let (u, v) = ([0.36, 0.48, -0.8], [-0.8, 0.6, 0.0]);
        let points: Vec<Point> = corners.iter().map(|[x, y]| [0, 1, 2].map(|k| 5.0 + x * u[k] + y * v[k])).collect();
        let n = corners.len() as u32;
        let face: Vec<u32> = (0..n).map(|k| (k + first as u32) % n).collect();
        let mut triangles = Vec::new();
        triangulate(&face, &points, &mut triangles);
        (triangles, points)
    }

    #[test]
    fn concave_polygons_are_covered_once_whichever_corner_is_first() {
        let arrow = vec![[0.0, 0.0], [2.0, 2.0], [0.0, 1.0], [-2.0, 2.0]];
        let ell = vec![[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let star: Vec<[f64; 2]> = (0..10)
            .map(|k| {
                let (angle, radius) = (0.2 + std::f64::consts::PI * f64::from(k) / 5.0, [1.0, 0.3][k as usize % 2]);
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        let comb = vec![[0.0, 0.0], [5.0, 0.0], [5.0, 3.0], [4.0, 1.0], [3.0, 3.0], [2.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let corner_on_a_side = vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        for polygon in [arrow, ell, star, comb, corner_on_a_side] {
            let whole: f64 = (2..polygon.len()).map(|k| doubled_area(polygon[0], polygon[k - 1], polygon[k])).sum();
            for first in 0..polygon.len() {
                let (triangles, _) = turned(&polygon, first);
                let areas: Vec<f64> = triangles
                    .iter()
                    .map(|t| {
                        let [a, b, c] = t.map(|v| polygon[v as usize]);
                        doubled_area(a, b, c)
                    })
                    .collect();
                assert_eq!(triangles.len(), polygon.len() - 2);
                assert!(areas.iter().all(|&area| area > 1e-9), "{polygon:?} from {first}: {areas:?}");
                assert!((areas.iter().sum::<f64>() / whole - 1.0).abs() < 1e-12, "{polygon:?} from {first}: {areas:?}");
            }
        }
    }

    #[test]
    fn convex_polygons_stay_fans_and_those_without_area_have_as_many_triangles() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(turned(&square, 1).0, [[1, 2, 3], [1, 3, 0]]);
        for (face, points) in [
            (vec![0, 1, 2, 3], vec![[0.0; 3]; 4]),
            (vec![0, 1, 2, 9], vec![[0.0, 1.0, 2.0]; 4]),
            (vec![0, 1, 2, 3], vec![[0.0, f64::NAN, 0.0]; 4]),
            // A bow tie, which crosses itself.
            (vec![0, 1, 2, 3], vec![[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            (vec![0, 1], vec![[0.0; 3]; 2]),
        ] {
            let mut triangles = Vec::new();
            triangulate(&face, &points, &mut triangles);
            assert_eq!(triangles.len(), face.len() - 2, "{face:?}");
        }
    }
}
