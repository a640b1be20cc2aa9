//! Queries against direct sums over all faces.

use cager_geometry::mesh::{Point, TriMesh, distance_to_surface, winding_number};
use cager_geometry::spatial::distance::{closest_on_segments, closest_on_triangle};
use cager_geometry::spatial::{GeneralizedWinding, Surface, outside, self_intersections, triangles_intersect};
use glam::DVec3;

/// A sphere as a grid of latitudes and longitudes.
fn sphere(center: Point, radius: f64, rows: u32) -> TriMesh {
    let columns = 2 * rows;
    let mut mesh = TriMesh { vertices: vec![[center[0], center[1], center[2] + radius]], triangles: Vec::new() };
    for i in 1..rows {
        for j in 0..columns {
            let (s, t) = (
                f64::from(i) * std::f64::consts::PI / f64::from(rows),
                f64::from(j) * std::f64::consts::TAU / f64::from(columns),
            );
            let direction = [s.sin() * t.cos(), s.sin() * t.sin(), s.cos()];
            mesh.vertices.push(std::array::from_fn(|k| center[k] + radius * direction[k]));
        }
    }
    mesh.vertices.push([center[0], center[1], center[2] - radius]);
    let last = mesh.vertices.len() as u32 - 1;
    let at = |i: u32, j: u32| 1 + (i - 1) * columns + j % columns;
    for j in 0..columns {
        mesh.triangles.push([0, at(1, j), at(1, j + 1)]);
        mesh.triangles.push([last, at(rows - 1, j + 1), at(rows - 1, j)]);
        for i in 1..rows - 1 {
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    mesh
}

fn random_points(n: usize, extent: f64) -> Vec<Point> {
    let mut rng = fastrand::Rng::with_seed(7);
    (0..n).map(|_| std::array::from_fn(|_| extent * (2.0 * rng.f64() - 1.0))).collect()
}

#[test]
fn distances_and_sides_agree_with_direct_sums() {
    let mesh = sphere([0.1, -0.2, 0.3], 1.0, 12);
    let surface = Surface::from(&mesh);
    let winding = GeneralizedWinding::new(&surface);
    let points = random_points(2000, 1.6);
    let found = outside(&mesh, &points);
    let mut expected = Vec::new();
    for (i, &p) in points.iter().enumerate() {
        let distance = distance_to_surface(&mesh.vertices, &mesh.triangles, p);
        let inside = winding_number(&mesh.vertices, &mesh.triangles, p);
        assert!((surface.nearest(p.into()).unwrap().distance - distance).abs() < 1e-12);
        assert!((winding.at(p.into()) - inside).abs() < 2e-2, "{} {inside}", winding.at(p.into()));
        if inside < 0.5 {
            expected.push(i as u32);
        }
    }
    assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), expected);
}

#[test]
fn rays_through_vertices_and_edges_count_once() {
    let mesh = sphere([0.0; 3], 1.0, 8);
    let surface = Surface::from(&mesh);
    for z in &mesh.vertices {
        let inside = DVec3::new(0.0, 0.9 * z[1], 0.9 * z[2]);
        assert!(surface.contains(0.9 * DVec3::from(*z)));
        assert!(surface.contains(inside) == (winding_number(&mesh.vertices, &mesh.triangles, inside.into()) > 0.5));
        assert!(!surface.contains(DVec3::new(-2.0, z[1], z[2])));
    }
}

#[test]
fn winding_of_an_open_hemisphere_is_half_in_its_opening() {
    let mut mesh = sphere([0.0; 3], 1.0, 32);
    let low = |t: &[u32; 3]| t.iter().any(|&v| mesh.vertices[v as usize][2] < -1e-9);
    mesh.triangles.retain(|t| !low(t));
    let surface = Surface::from(&mesh);
    let winding = GeneralizedWinding::new(&surface);
    assert!((winding.at(DVec3::ZERO) - 0.5).abs() < 2e-2);
    for p in random_points(500, 1.5) {
        let exact = winding_number(&mesh.vertices, &mesh.triangles, p);
        assert!((winding.at(p.into()) - exact).abs() < 2e-2);
    }
}

#[test]
fn meshes_that_cut_touch_or_fold_are_found() {
    let mut two = sphere([0.0; 3], 1.0, 10);
    assert!(self_intersections(&two).is_empty());
    let other = sphere([1.5, 0.1, 0.05], 1.0, 10);
    let (shift, first) = (two.vertices.len() as u32, two.triangles.len() as u32);
    two.vertices.extend(&other.vertices);
    two.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + shift)));
    let pairs = self_intersections(&two);
    assert!(!pairs.is_empty() && pairs.is_sorted());
    assert!(pairs.iter().all(|p| p[0] < first && p[1] >= first), "a sphere does not cut itself");
    let corners = |f: u32| two.triangles[f as usize].map(|v| DVec3::from(two.vertices[v as usize]));
    let faces = two.triangles.len() as u32;
    let every = (0..faces).flat_map(|f| (f + 1..faces).map(move |g| [f, g]));
    let wanted: Vec<[u32; 2]> =
        every.filter(|pair| triangles_intersect(pair.map(|f| two.triangles[f as usize]), pair.map(corners))).collect();
    assert_eq!(pairs, wanted);

    let flat = |corners: &[Point], triangles: &[[u32; 3]]| {
        self_intersections(&TriMesh { vertices: corners.to_vec(), triangles: triangles.to_vec() }).len()
    };
    let square = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.2, 0.1, 0.0],
        [0.3, 0.1, 1.0],
        [0.4, 0.2, 1.0],
    ];
    assert_eq!(flat(&square, &[[0, 1, 2], [0, 2, 3]]), 0);
    assert_eq!(flat(&square, &[[0, 1, 2], [1, 0, 2]]), 1, "a doubled face");
    assert_eq!(flat(&square, &[[0, 1, 2], [1, 0, 4]]), 1, "folded over an edge");
    assert_eq!(flat(&square, &[[0, 1, 2], [4, 5, 6]]), 1, "touched by a vertex");
    assert_eq!(flat(&square, &[[0, 1, 2], [3, 5, 6]]), 0);
    assert_eq!(flat(&square, &[[0, 1, 2], [0, 4, 5]]), 1, "an edge that lies in a face");
}

#[test]
fn nearest_points_of_segments_and_triangles_are_nearest() {
    let p = random_points(400, 1.0);
    for s in p.chunks_exact(4) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| DVec3::from(s[i]));
        let (u, v) = closest_on_segments([a, b], [c, d]);
        let least = a.lerp(b, u).distance_squared(c.lerp(d, v));
        let w = closest_on_triangle(d, [a, b, c]);
        let nearest = (w[0] * a + w[1] * b + w[2] * c).distance_squared(d);
        for i in 0..=20 {
            for j in 0..=20 {
                let (s, t) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                assert!((a + s * (b - a)).distance_squared(c + t * (d - c)) >= least - 1e-12);
                if s + t <= 1.0 {
                    assert!((a + s * (b - a) + t * (c - a)).distance_squared(d) >= nearest - 1e-12);
                }
            }
        }
        assert!((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v));
    }
}
