//! Harmonic coordinates against what is known of harmonic functions: the maximum principle, polynomials, and random walks.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Coordinates, CoordinatesError, Harmonic, Refinement};
use cager_core::mesh::{Point, TriMesh, bounds, distance_to_surface, winding_number};
use common::{Random, cages, octahedron};

fn named(wanted: &str) -> Cage {
    cages().into_iter().find(|(name, _)| *name == wanted).expect("a cage of this name").1
}

fn inside(cage: &Cage, x: Point) -> bool {
    winding_number(cage.vertices(), &cage.mesh().triangles, x) > 0.5
}

fn points_inside(cage: &Cage, count: usize, seed: u64) -> Vec<Point> {
    let mut random = Random::new(seed);
    let (low, high) = bounds(cage.vertices());
    let any = std::iter::repeat_with(|| [0, 1, 2].map(|k| low[k] + random.uniform() * (high[k] - low[k])));
    any.filter(|&x| inside(cage, x)).take(count).collect()
}

fn of(cage: &Cage, points: &[Point]) -> Coordinates {
    Harmonic.coordinates(cage, points).expect("coordinates")
}

fn refined(found: &Coordinates) -> Refinement {
    found.refinement.expect("a numerical solution")
}

/// The nearest place on a mesh is what a walk ends at: its hat functions are the data of the coordinates.
fn hats_at(cage: &Cage, x: Point) -> ([u32; 3], [f64; 3]) {
    let minus = |a: Point, b: Point| [0, 1, 2].map(|k| a[k] - b[k]);
    let dot = |a: Point, b: Point| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let triangles = &cage.mesh().triangles;
    let distance = |t: &[u32; 3]| distance_to_surface(cage.vertices(), std::slice::from_ref(t), x);
    let nearest = triangles.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("a face");
    let [a, b, c] = nearest.map(|v| cage.vertices()[v as usize]);
    let (e, f, r) = (minus(b, a), minus(c, a), minus(x, a));
    let (ee, ef, ff, re, rf) = (dot(e, e), dot(e, f), dot(f, f), dot(r, e), dot(r, f));
    let area = ee * ff - ef * ef;
    let (s, t) = ((ff * re - ef * rf) / area, (ee * rf - ef * re) / area);
    (*nearest, [1.0 - s - t, s, t])
}

#[test]
fn coordinates_are_what_random_walks_end_at() {
    const WALKS: u32 = 6000;
    let cage = named("L-shaped prism");
    // One of them beside the edge that points inwards.
    let points = [[-0.7, 0.3, 0.2], [-0.5, -0.5, -0.4], [0.6, -0.8, 0.7]];
    let found = of(&cage, &points);
    let mut random = Random::new(29);
    for (i, &start) in points.iter().enumerate() {
        let mut sums = vec![[0.0; 2]; cage.vertices().len()];
        for _ in 0..WALKS {
            // On the largest sphere around it a walk leaves everywhere alike.
            let mut x = start;
            loop {
                let radius = distance_to_surface(cage.vertices(), &cage.mesh().triangles, x);
                if radius < 1e-4 {
                    break;
                }
                let direction = random.direction();
                x = [0, 1, 2].map(|k| x[k] + radius * direction[k]);
            }
            let (face, weights) = hats_at(&cage, x);
            for (v, weight) in face.into_iter().zip(weights) {
                let [sum, squares] = &mut sums[v as usize];
                (*sum, *squares) = (*sum + weight, *squares + weight * weight);
            }
        }
        for (v, [sum, squares]) in sums.into_iter().enumerate() {
            let count = f64::from(WALKS);
            let mean = sum / count;
            let deviation = ((squares / count - mean * mean) / count).sqrt();
            let error = (found.phi[(i, v)] - mean).abs();
            assert!(
                error < 4.0 * deviation + 1.5e-3,
                "{start:?}, vertex {v}: {} for {mean} ± {deviation}",
                found.phi[(i, v)]
            );
        }
    }
}

/// An octahedron whose faces are divided so often, on the unit sphere.
fn ball(divisions: usize) -> Cage {
    let mut mesh = octahedron();
    for _ in 0..divisions {
        let mut next = TriMesh { vertices: mesh.vertices.clone(), triangles: Vec::new() };
        let mut middles = std::collections::HashMap::new();
        for &[a, b, c] in &mesh.triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let [p, q] = [a, b].map(|v| mesh.vertices[v as usize]);
                    let sum = [0, 1, 2].map(|k| p[k] + q[k]);
                    let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                    next.vertices.push(sum.map(|x| x / length));
                    next.vertices.len() as u32 - 1
                })
            };
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            next.triangles.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        mesh = next;
    }
    Cage::new(mesh).expect("a cage")
}

#[test]
fn harmonic_polynomials_are_met_up_to_what_hat_functions_miss_of_them() {
    let cage = ball(2);
    let points = points_inside(&cage, 300, 31);
    let found = of(&cage, &points);
    assert!(refined(&found).reached());
    let polynomials: [fn(Point) -> f64; 4] = [
        |[x, y, _]| x * y,
        |[x, y, z]| 2.0 * z * z - x * x - y * y,
        |[x, y, z]| x * y * z,
        |[x, y, _]| x * x * x - 3.0 * x * y * y,
    ];
    for (k, u) in polynomials.into_iter().enumerate() {
        let values: Vec<f64> = cage.vertices().iter().map(|&v| u(v)).collect();
        // The interpolant's error is harmonic, and so nowhere larger than on the faces.
        let mut bound = 0.0f64;
        for t in &cage.mesh().triangles {
            for (i, j) in (0..=10).flat_map(|i| (0..=10 - i).map(move |j| (i, j))) {
                let weights = [f64::from(i) / 10.0, f64::from(j) / 10.0, f64::from(10 - i - j) / 10.0];
                let at = |c: usize| -> f64 { (0..3).map(|n| weights[n] * cage.vertices()[t[n] as usize][c]).sum() };
                let linear: f64 = (0..3).map(|n| weights[n] * values[t[n] as usize]).sum();
                bound = bound.max((linear - u([at(0), at(1), at(2)])).abs());
            }
        }
        for (i, &x) in points.iter().enumerate() {
            let sum: f64 = values.iter().enumerate().map(|(v, value)| found.phi[(i, v)] * value).sum();
            let error = (sum - u(x)).abs();
            assert!(error <= 1.02 * bound + 1e-3, "polynomial {k} at {x:?}: {error:e}, bound {bound:e}");
        }
    }
}

#[test]
fn values_stay_between_zero_and_one_everywhere_and_meet_the_faces() {
    for name in ["box with split sides", "L-shaped prism", "octahedron"] {
        let cage = named(name);
        let mut points = points_inside(&cage, 300, 37);
        let anywhere = points.len();
        // Towards places on faces, edges and vertices.
        let mut random = Random::new(41);
        let centre = points[0];
        for (k, t) in cage.mesh().triangles.iter().cycle().take(90).enumerate() {
            let mut weights = [random.uniform(), random.uniform(), random.uniform()];
            weights.iter_mut().take(k % 3).for_each(|w| *w = 0.0);
            let total: f64 = weights.iter().sum();
            let corner = |i: usize| cage.vertices()[t[i] as usize];
            let on: Point = [0, 1, 2].map(|c| (0..3).map(|i| weights[i] / total * corner(i)[c]).sum());
            for share in [1e-7, 1e-5, 1e-3, 1e-1] {
                points.push([0, 1, 2].map(|c| on[c] + share * (centre[c] - on[c])));
            }
        }
        let mut n = 0;
        points.retain(|&x| {
            n += 1;
            n <= anywhere || inside(&cage, x)
        });
        let found = of(&cage, &points);
        let refined = refined(&found);
        assert!(refined.reached() && refined.change > 0.0, "{name}: {refined:?}");
        for (i, &x) in points.iter().enumerate() {
            let row: Vec<f64> = (0..found.phi.ncols()).map(|v| found.phi[(i, v)]).collect();
            let (low, high) = row.iter().fold((0.0f64, 0.0f64), |(low, high), &w| (low.min(w), high.max(w)));
            assert!(low > -1.5e-3 && high < 1.0 + 1.5e-3, "{name} at {x:?}: from {low} to {high}");
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{name} at {x:?}");
            if distance_to_surface(cage.vertices(), &cage.mesh().triangles, x) < 1e-6 * cage.diagonal() {
                let (face, weights) = hats_at(&cage, x);
                for (v, weight) in face.into_iter().zip(weights) {
                    let error = (row[v as usize] - weight).abs();
                    assert!(error < 2e-3, "{name} at {x:?}: {} for {weight}", row[v as usize]);
                }
            }
        }
    }
}

#[test]
fn bits_do_not_depend_on_threads() {
    let cage = named("L-shaped prism");
    let points = points_inside(&cage, 200, 43);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| of(&cage, &points))
    };
    let one = on(1);
    for threads in [2, 5] {
        let other = on(threads);
        assert_eq!(one.refinement, other.refinement);
        let same = |v: usize| (0..points.len()).all(|i| one.phi[(i, v)].to_bits() == other.phi[(i, v)].to_bits());
        assert!((0..one.phi.ncols()).all(same), "other bits on {threads} threads");
    }
}

#[test]
fn points_outside_are_counted_and_listed_before_anything_is_computed() {
    let cage = named("box with split sides");
    let far = |k: u32| [2.0 + f64::from(k), 0.0, 0.0];
    let mut points = vec![[0.0; 3], [0.1, 0.2, 0.3]];
    points.extend((0..12).map(far));
    let error = Harmonic.check(&cage, &points).expect_err("points outside");
    assert_eq!(Harmonic.coordinates(&cage, &points).expect_err("points outside"), error);
    let text = error.to_string();
    assert!(text.starts_with("12 points lie outside the cage (2, 3, 4, 5, 6, 7, 8, 9, …), by up to"), "{text}");
    assert!(text.ends_with("enlarge the cage or use mean value coordinates (mvc)"), "{text}");
    let one = Harmonic.check(&cage, &points[1..3]).expect_err("a point outside");
    assert!(one.to_string().starts_with("1 point lies outside the cage (1), by up to 28.87 %"), "{one}");
    assert!(Harmonic.check(&cage, &points[..2]).is_ok());
    let bad = Harmonic.coordinates(&cage, &[[f64::NAN; 3]]);
    assert!(matches!(bad, Err(CoordinatesError::NotComputed { .. } | CoordinatesError::Outside { .. })), "{bad:?}");
}
