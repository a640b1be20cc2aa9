//! Harmonic coordinates against what is known of harmonic functions: the maximum principle, polynomials, and random walks.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{
    CoordinateSystem, Coordinates, CoordinatesError, ElementPlan, Green, Harmonic, Refinement,
};
use cager_geometry::mesh::{Point, TriMesh, bounds, distance_to_surface, winding_number};
use cager_geometry::vector::{add, along, combination, dot, middle, norm, sub};
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
    Harmonic.coordinates(cage, points, None).expect("coordinates")
}

fn refined(found: &Coordinates) -> Refinement {
    found.refinement.expect("a numerical solution")
}

/// The nearest place on a mesh is what a walk ends at: its hat functions are the data of the coordinates.
fn hats_at(cage: &Cage, x: Point) -> ([u32; 3], [f64; 3]) {
    let triangles = &cage.mesh().triangles;
    let distance = |t: &[u32; 3]| distance_to_surface(cage.vertices(), std::slice::from_ref(t), x);
    let nearest = triangles.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("a face");
    let [a, b, c] = nearest.map(|v| cage.vertices()[v as usize]);
    let (e, f, r) = (sub(b, a), sub(c, a), sub(x, a));
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
                x = along(x, radius, direction);
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
                    let sum = add(p, q);
                    next.vertices.push(sum.map(|x| x / norm(sum)));
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
            let on: Point = combination(weights.map(|w| w / total), [0, 1, 2].map(corner));
            for share in [1e-7, 1e-5, 1e-3, 1e-1] {
                points.push(along(on, share, sub(centre, on)));
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

/// Largest difference that the two independent truths below allow.
const TRUTH: f64 = 1e-4;

/// Points inside that are at least so far from the cage.
fn points_well_inside(cage: &Cage, count: usize, seed: u64, apart: f64) -> Vec<Point> {
    let mut points = points_inside(cage, 20 * count, seed);
    points.retain(|&x| distance_to_surface(cage.vertices(), &cage.mesh().triangles, x) > apart);
    points.truncate(count);
    points
}

#[test]
fn coordinates_are_the_fourier_series_of_a_box() {
    // A vertex in the middle of the lid, which four triangles meet at: its hat function is Σ 8/(nπ)² sin(nπx/a) sin(nπy/b) over odd n.
    let [a, b, c] = [1.3, 0.9, 0.7];
    let mut vertices: Vec<Point> = Vec::new();
    for z in [0.0, c] {
        vertices.extend([[0.0, 0.0, z], [a, 0.0, z], [a, b, z], [0.0, b, z]]);
    }
    vertices.push([0.5 * a, 0.5 * b, c]);
    let mut triangles = vec![[0, 2, 1], [0, 3, 2]];
    for i in 0..4 {
        let j = (i + 1) % 4;
        triangles.extend([[i, j, j + 4], [i, j + 4, i + 4], [i + 4, j + 4, 8]]);
    }
    let cage = Cage::new(TriMesh { vertices, triangles }).expect("a cage");
    let points = points_well_inside(&cage, 300, 47, 0.1);
    let found = of(&cage, &points);
    let (half, ends) = quartered(cage.mesh());
    let finer = of(&Cage::new(half).expect("a cage"), &points);
    let pi = std::f64::consts::PI;
    let (mut worst, mut worst_finer) = (0.0f64, 0.0f64);
    for (i, &[x, y, z]) in points.iter().enumerate() {
        let term = |n: f64| {
            let decay = n * pi * (1.0 / (a * a) + 1.0 / (b * b)).sqrt();
            let height = ((decay * (z - c)).exp() - (-decay * (z + c)).exp()) / (1.0 - (-2.0 * decay * c).exp());
            8.0 / (n * pi).powi(2) * (n * pi * x / a).sin() * (n * pi * y / b).sin() * height
        };
        let exact: f64 = (0..100).map(|k| term(f64::from(2 * k + 1))).sum();
        worst = worst.max((found.phi[(i, 8)] - exact).abs());
        worst_finer = worst_finer.max((of_coarse_vertices(&finer, i, &ends)[8] - exact).abs());
    }
    assert!(worst < refined(&found).change, "off by {worst:.1e}, {:?}", refined(&found));
    assert!(worst_finer < TRUTH, "off by {worst_finer:.1e}, {:?}", refined(&finer));
}

/// A row of a cage from that of the cage with divided faces: a hat function is one half of what it is at either end in the middle of an
/// edge.
fn of_coarse_vertices(fine: &Coordinates, point: usize, ends: &[[u32; 2]]) -> Vec<f64> {
    let mut row: Vec<f64> = (0..fine.phi.ncols()).map(|v| fine.phi[(point, v)]).collect();
    for [a, b] in ends.iter().rev() {
        let half = 0.5 * row.pop().expect("a vertex");
        row[*a as usize] += half;
        row[*b as usize] += half;
    }
    row
}

/// The same faces, each cut into four; and for each new vertex the ends of the edge that it halves.
fn quartered(mesh: &TriMesh) -> (TriMesh, Vec<[u32; 2]>) {
    let (mut out, mut ends) = (TriMesh { vertices: mesh.vertices.clone(), triangles: Vec::new() }, Vec::new());
    let mut middles = std::collections::HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        let [d, e, f] = [[a, b], [b, c], [c, a]].map(|[a, b]| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let [p, q] = [a, b].map(|v| mesh.vertices[v as usize]);
                out.vertices.push(middle(p, q));
                ends.push([a, b]);
                out.vertices.len() as u32 - 1
            })
        });
        out.triangles.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
    }
    (out, ends)
}

#[test]
fn coordinates_are_those_of_far_more_elements() {
    for name in ["octahedron", "box with split sides", "L-shaped prism"] {
        let cage = named(name);
        let points = points_well_inside(&cage, 150, 53, 0.15);
        let (half, first_ends) = quartered(cage.mesh());
        let (quarter, second_ends) = quartered(&half);
        let [found, finer, finest] =
            [cage.mesh().clone(), half, quarter].map(|mesh| of(&Cage::new(mesh).expect("a cage"), &points));
        let all_ends = [first_ends.clone(), second_ends].concat();
        let (mut worst, mut worst_finer) = (0.0f64, 0.0f64);
        for i in 0..points.len() {
            let finer = of_coarse_vertices(&finer, i, &first_ends);
            for (v, exact) in of_coarse_vertices(&finest, i, &all_ends).into_iter().enumerate() {
                worst = worst.max((found.phi[(i, v)] - exact).abs());
                worst_finer = worst_finer.max((finer[v] - exact).abs());
            }
        }
        // What is reported holds everywhere. Near an edge that points inwards densities grow without bound, so that it takes many elements.
        assert!(worst < refined(&found).change, "{name}: off by {worst:.1e}, {:?}", refined(&found));
        let most = if name == "L-shaped prism" { 3.0 * TRUTH } else { TRUTH };
        assert!(worst_finer < most, "{name}: off by {worst_finer:.1e}, {:?}", refined(&finer));
    }
}

#[test]
fn a_plan_gives_the_same_bits_again_and_coordinates_of_other_points() {
    for name in ["L-shaped prism", "octahedron"] {
        let cage = named(name);
        let points = points_inside(&cage, 150, 59);
        let found = of(&cage, &points);
        let plan = found.plan.expect("a plan");
        let again = Harmonic.coordinates(&cage, &points, Some(&plan)).expect("coordinates");
        let same = |v: usize| (0..points.len()).all(|i| found.phi[(i, v)].to_bits() == again.phi[(i, v)].to_bits());
        assert!((0..found.phi.ncols()).all(same), "{name}: other bits");
        let few = Harmonic.coordinates(&cage, &points[7..9], Some(&plan)).expect("coordinates");
        for v in 0..found.phi.ncols() {
            for i in 0..2 {
                // Products of other sizes round otherwise, in single precision.
                let error = (few.phi[(i, v)] - found.phi[(i + 7, v)]).abs();
                assert!(error < 1e-6, "{name}: point {i}, vertex {v} is off by {error:e}");
            }
        }
    }
}

#[test]
fn plans_of_other_cages_and_of_any_bytes_are_refused_in_one_sentence() {
    let (cage, other) = (named("octahedron"), named("L-shaped prism"));
    let points = points_inside(&cage, 40, 61);
    let plan = of(&cage, &points).plan.expect("a plan");
    let refused = |cage: &Cage, points: &[Point], bytes: &[u8]| {
        let plan = ElementPlan::from_bytes(bytes.to_vec());
        let error = Harmonic.coordinates(cage, points, Some(&plan)).expect_err("a wrong plan");
        let text = error.to_string();
        assert!(text.starts_with("the boundary elements of harmonic coordinates do not fit the cage: "), "{text}");
    };
    refused(&other, &points_inside(&other, 10, 67), plan.as_bytes());
    for length in [0, 3, 9, plan.as_bytes().len() - 1] {
        refused(&cage, &points, &plan.as_bytes()[..length]);
    }
    refused(&cage, &points, &[&plan.as_bytes()[..3], &[0; 1 << 20]].concat());
    refused(&cage, &points, &[255; 1 << 20]);
    // Elements without any extent: an error or finite numbers, and no panic.
    let mut deep = plan.as_bytes()[..3].to_vec();
    deep.extend([0; 1100]);
    deep.extend(vec![3; 1100 + cage.faces().len()]);
    let elements = 1100 + cage.faces().len();
    deep.extend(vec![0; cage.vertices().len() + (elements * cage.vertices().len()).div_ceil(8)]);
    let found = Harmonic.coordinates(&cage, &points, Some(&ElementPlan::from_bytes(deep)));
    assert!(found.is_err(), "elements without area");
    let wrong = Green::Free.coordinates(&cage, &points, Some(&plan)).expect_err("no such system");
    assert!(wrong.to_string().contains("green-free"), "{wrong}");
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
    assert_eq!(Harmonic.coordinates(&cage, &points, None).expect_err("points outside"), error);
    let text = error.to_string();
    assert!(text.starts_with("12 points lie outside the cage (2, 3, 4, 5, 6, 7, 8, 9, …), by up to"), "{text}");
    assert!(text.ends_with("enlarge the cage or use mean value coordinates (mvc)"), "{text}");
    let one = Harmonic.check(&cage, &points[1..3]).expect_err("a point outside");
    assert!(one.to_string().starts_with("1 point lies outside the cage (1), by up to 28.87 %"), "{one}");
    assert!(Harmonic.check(&cage, &points[..2]).is_ok());
    let bad = Harmonic.coordinates(&cage, &[[f64::NAN; 3]], None);
    assert!(matches!(bad, Err(CoordinatesError::NotComputed { .. } | CoordinatesError::Outside { .. })), "{bad:?}");
}
