//! Meshes that are no cages are refused with the place that is wrong.

mod common;

use cager_core::cage::{Cage, CageError, Carrier};
use cager_core::coordinates::{CoordinateSystem as _, Harmonic, MeanValue};
use cager_core::decode::Decoder;
use cager_core::inversion::{Solver, SolverOptions};
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::Nesting;
use common::octahedron;
use std::cell::Cell;

fn refused(mesh: TriMesh) -> CageError {
    Cage::new(mesh).expect_err("no cage")
}

#[test]
fn an_open_cage_names_its_boundary_edges() {
    let mut mesh = octahedron();
    mesh.triangles.remove(0);
    let error = refused(mesh);
    assert!(matches!(&error, CageError::Open { edges } if edges.len() == 3));
    assert!(error.to_string().contains("3 edges") && error.to_string().contains("0–2"), "{error}");
}

#[test]
fn an_inward_cage_offers_to_be_flipped_and_can_be() {
    let error = refused(octahedron().flipped());
    assert!(matches!(error, CageError::Inward { .. }) && error.to_string().contains("flip them"), "{error}");
    assert!(Cage::new(octahedron().flipped().flipped()).is_ok());
}

#[test]
fn one_face_inside_out_is_named_with_its_neighbour() {
    let mut mesh = octahedron();
    mesh.triangles[3].swap(0, 1);
    assert!(matches!(refused(mesh), CageError::Inconsistent { faces, .. } if faces.contains(&3)));
}

#[test]
fn a_doubled_face_is_named() {
    let mut mesh = octahedron();
    mesh.triangles.push([4, 0, 2]);
    assert_eq!(refused(mesh), CageError::DuplicateFaces { first: 0, second: 8, vertices: [4, 0, 2] });
}

#[test]
fn an_edge_of_three_faces_is_named_with_them() {
    let mut mesh = octahedron();
    mesh.vertices.push([2.0, 2.0, 2.0]);
    mesh.triangles.push([0, 2, 6]);
    assert_eq!(refused(mesh), CageError::NonManifold { edge: [0, 2], faces: vec![0, 4, 8] });
}

#[test]
fn a_face_without_area_is_named() {
    let mut mesh = octahedron();
    mesh.vertices[4] = [0.5, 0.5, 0.0];
    assert!(matches!(refused(mesh), CageError::Degenerate { face: 0, .. }));
}

#[test]
fn a_vertex_that_is_not_finite_is_named() {
    let mut mesh = octahedron();
    mesh.vertices[5][1] = f64::NAN;
    assert_eq!(refused(mesh), CageError::NotFinite { vertex: 5 });
}

#[test]
fn a_loose_vertex_is_named() {
    let mut mesh = octahedron();
    mesh.vertices.push([3.0; 3]);
    assert_eq!(refused(mesh), CageError::LooseVertex { vertex: 6 });
}

#[test]
fn a_face_of_a_vertex_that_does_not_exist_is_named() {
    let mut mesh = octahedron();
    mesh.triangles[7] = [0, 3, 9];
    assert_eq!(refused(mesh), CageError::NoSuchVertex { face: 7, vertex: 9, vertices: 6 });
}

#[test]
fn a_few_triangles_are_no_cage() {
    let mesh = TriMesh { vertices: octahedron().vertices, triangles: vec![[0, 2, 4]] };
    assert_eq!(refused(mesh), CageError::TooSmall { vertices: 6, faces: 1 });
}

/// Octahedra of this radius.
fn octahedra(centres: impl IntoIterator<Item = Point>, scale: f64) -> TriMesh {
    let mut all = TriMesh::default();
    centres.into_iter().for_each(|centre| add(&mut all, &octahedron(), scale, centre));
    all
}

fn add(all: &mut TriMesh, part: &TriMesh, scale: f64, centre: Point) {
    let offset = all.vertices.len() as u32;
    all.vertices.extend(part.vertices.iter().map(|p| [0, 1, 2].map(|k| scale * p[k] + centre[k])));
    all.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + offset)));
}

/// Places of 8,000 parts: rows along each axis, a sheet, a block.
fn arrangements() -> Vec<Vec<Point>> {
    let sides = [[8_000, 1, 1], [1, 8_000, 1], [1, 1, 8_000], [1, 80, 100], [100, 1, 80], [20, 20, 20]];
    let places = |[x, y, z]: [u32; 3]| {
        (0..x * y * z).map(move |k| [k / (y * z), k / z % y, k % z].map(|i| 3.0 * f64::from(i))).collect()
    };
    sides.into_iter().map(places).collect()
}

#[test]
fn a_cavity_is_welcome_but_a_part_turned_inwards_is_not() {
    let mut hollow = octahedron();
    add(&mut hollow, &octahedron().flipped(), 0.3, [0.0; 3]);
    assert!(Cage::new(hollow).is_ok());
    let mut apart = octahedron();
    add(&mut apart, &octahedron().flipped(), 1.0, [5.0, 0.0, 0.0]);
    assert_eq!(refused(apart), CageError::InwardPart { vertex: 6 });
    // Within a cavity there is nothing to be hollow.
    let mut twice = octahedron();
    add(&mut twice, &octahedron().flipped(), 0.6, [0.0; 3]);
    add(&mut twice, &octahedron().flipped(), 0.3, [0.0; 3]);
    assert_eq!(refused(twice.clone()), CageError::InwardPart { vertex: 12 });
    twice.triangles[16..].iter_mut().for_each(|t| t.swap(1, 2));
    assert!(Cage::new(twice).is_ok());
}

#[test]
fn a_cavity_may_touch_the_part_around_it() {
    let mut thin = octahedron().flipped();
    thin.vertices.iter_mut().for_each(|p| *p = [p[0], 0.5 * p[1], 0.5 * p[2]]);
    let mut touching = octahedron();
    add(&mut touching, &thin, 0.5, [0.5, 0.0, 0.0]);
    // One of them by a vertex that both have.
    let mut joined = touching.clone();
    joined.triangles.iter_mut().flatten().filter(|v| **v == 6).for_each(|v| *v = 0);
    joined.triangles.iter_mut().flatten().filter(|v| **v > 6).for_each(|v| *v -= 1);
    joined.vertices.remove(6);
    assert_eq!(touching.vertices[0], touching.vertices[6]);
    assert!(Cage::new(touching).is_ok() && Cage::new(joined).is_ok());
}

#[test]
fn thousands_of_parts_are_told_apart() {
    for centres in arrangements() {
        let far = centres.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
        let mut mesh = octahedra([[0.0; 3]], 4.0 * far);
        centres.iter().for_each(|&centre| add(&mut mesh, &octahedron().flipped(), 1.0, centre));
        assert!(Cage::new(mesh.clone()).is_ok());
        add(&mut mesh, &octahedron().flipped(), 1.0, [5.0 * far, 0.0, 0.0]);
        let vertex = mesh.vertices.len() as u32 - 6;
        assert_eq!(refused(mesh), CageError::InwardPart { vertex });
    }
}

#[test]
fn what_encloses_a_part_is_found_among_a_few_faces_of_thousands_of_parts() {
    for centres in arrangements() {
        let mesh = octahedra(centres, 1.0);
        let part_of: Vec<u32> = (0..mesh.triangles.len() as u32).map(|face| face / 8).collect();
        let nesting = Nesting::new(&mesh.vertices, &mesh.triangles, &part_of);
        let looked_at = Cell::new(0);
        let count = |_| {
            looked_at.set(looked_at.get() + 1);
            1
        };
        assert!(!(0..8_000).any(|part| nesting.is_enclosed(part, count)));
        // All others' faces would be 63,992 for each.
        assert!(looked_at.get() < 8_000 * 1_000, "{}", looked_at.get());
    }
}

#[test]
fn coordinates_whose_products_overflow_are_refused() {
    // Slanted, so that its volume is a difference of infinities.
    let of_size = |size: f64| {
        let mut mesh = octahedra([[0.0; 3]], size);
        mesh.vertices.iter_mut().for_each(|[x, y, z]| [*x, *y, *z] = [*x + *y, *y + *z, *z + *x]);
        Cage::new(mesh)
    };
    assert!(of_size(1.0).is_ok() && of_size(1e110).is_err());
}

/// Two octahedra, one moved along x by so much, of which the first carries points 0 to 3 and 6, the second the others.
fn two_components(apart: f64) -> (TriMesh, Vec<Carrier>) {
    let mut mesh = octahedron();
    let count = mesh.vertices.len() as u32;
    mesh.vertices.extend(octahedron().vertices.iter().map(|p| [p[0] + apart, p[1], p[2]]));
    mesh.triangles.extend(octahedron().triangles.iter().map(|t| t.map(|v| v + count)));
    let carrier = |points, second: bool| Carrier { points, vertices: if second { count..2 * count } else { 0..count } };
    (mesh, vec![carrier(0..3, false), carrier(3..6, true), carrier(6..7, false)])
}

#[test]
fn points_have_the_coordinates_of_the_component_that_carries_them_alone() {
    // The components cut each other.
    let (mesh, carriers) = two_components(0.3);
    let cage = Cage::new(mesh).unwrap().with_carriers(carriers).unwrap();
    let single = Cage::new(octahedron()).unwrap();
    let points: Vec<Point> = (0..7).map(|k| [0.05 * f64::from(k), 0.02, 0.1 - 0.03 * f64::from(k)]).collect();
    let phi = MeanValue.coordinates(&cage, &points, None).unwrap().phi;
    let half = single.vertices().len();
    for (point, p) in points.iter().enumerate() {
        let (first, shift) = if (3..6).contains(&point) { (half, 0.3) } else { (0, 0.0) };
        let own = MeanValue.coordinates(&single, &[[p[0] - shift, p[1], p[2]]], None).unwrap().phi;
        for j in 0..half {
            assert!((phi[(point, first + j)] - own[(0, j)]).abs() < 1e-12, "{point}");
            assert_eq!(phi[(point, half - first + j)], 0.0, "{point}");
        }
    }
    // Rows that are computed when they are wanted are the same.
    let pointwise = MeanValue.pointwise().unwrap();
    let frame: Vec<f32> = cage.vertices().as_flattened().iter().map(|&x| x as f32).collect();
    let decoded = |decoder: Decoder| {
        let mut out = vec![Vec::new()];
        decoder.decode(&[&frame], &mut out);
        out
    };
    let kept = Decoder::with_stored_coordinates(pointwise, &cage, &points, 2 * half);
    let again = Decoder::with_recomputed_coordinates(pointwise, &cage, &points, 2 * half);
    assert_eq!(decoded(kept.of_points(&[5, 0, 6, 3])), decoded(again.of_points(&[5, 0, 6, 3])));
    let (kept, again) = (decoded(kept), decoded(again));
    assert_eq!(kept, again);
    let off = kept[0].iter().zip(points.as_flattened()).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off}");
}

#[test]
fn points_that_a_component_has_none_of_have_their_coordinates() {
    let (mesh, mut carriers) = two_components(0.3);
    // In one chunk all points of one component, and in another all of the other.
    let half = octahedron().vertices.len() as u32;
    let count = (96 << 20) / (12 * 2 * half) + 1_000;
    for (first_vertices, second_vertices) in [(0..half, half..2 * half), (half..2 * half, 0..half)] {
        carriers.clear();
        carriers.push(Carrier { points: 0..count, vertices: first_vertices });
        carriers.push(Carrier { points: count..count + 3, vertices: second_vertices });
        let cage = Cage::new(mesh.clone()).unwrap().with_carriers(carriers.clone()).unwrap();
        let points: Vec<Point> = (0..count + 3).map(|k| [0.1 + 1e-7 * f64::from(k), 0.02, 0.1]).collect();
        let phi = MeanValue.coordinates(&cage, &points, None).unwrap().phi;
        for sample in [vec![0, 1], vec![count, count + 2], Vec::new()] {
            let some: Vec<Point> = sample.iter().map(|&i| points[i as usize]).collect();
            let found = MeanValue.coordinates(&cage.of_points(sample.iter().copied()), &some, None).unwrap().phi;
            for (row, &i) in sample.iter().enumerate() {
                assert_eq!(found.row(row), phi.row(i as usize));
            }
        }
        let columns = 2 * half as usize;
        let decoder = Decoder::with_recomputed_coordinates(MeanValue.pointwise().unwrap(), &cage, &points, columns);
        let frame: Vec<f32> = cage.vertices().as_flattened().iter().map(|&x| x as f32).collect();
        let mut out = vec![Vec::new()];
        decoder.decode(&[&frame], &mut out);
        assert!(out[0].iter().zip(points.as_flattened()).all(|(&a, b)| (f64::from(a) - b).abs() < 1e-6));
        decoder.of_points(&[count, count + 2]).decode(&[&frame], &mut out);
        assert!(
            (0..6).all(|k| (f64::from(out[0][k]) - points[(count + 2 * (k as u32 / 3)) as usize][k % 3]).abs() < 1e-6)
        );
    }
}

#[test]
fn components_that_do_not_fit_cage_model_or_coordinates_are_refused() {
    let (mesh, carriers) = two_components(5.0);
    let refused = |change: &dyn Fn(&mut Vec<Carrier>)| {
        let mut carriers = carriers.clone();
        change(&mut carriers);
        Cage::new(mesh.clone()).unwrap().with_carriers(carriers).expect_err("no components").to_string()
    };
    assert!(refused(&|c| c[1].points = 4..6).contains("point 3 is next"));
    assert!(refused(&|c| c[1].points = 3..3).contains("3..3"));
    assert!(refused(&|c| c[1].vertices = 6..11).contains("vertex 11 is in no component"));
    assert!(
        refused(&|c| c[1].vertices = 5..12).contains("vertices 0..6")
            || refused(&|c| c[1].vertices = 5..12).contains("5..12")
    );
    assert!(refused(&|c| c[1].vertices = 6..u32::MAX).contains("vertex 6 is next"));
    assert!(refused(&|c| c.truncate(1)).contains("vertex 6 is in no component"));
    let shifted = |c: &mut Vec<Carrier>| {
        for carrier in c {
            carrier.vertices = if carrier.vertices.start == 0 { 0..5 } else { 5..12 };
        }
    };
    assert!(refused(&shifted).contains("corners in two components"));
    let cage = Cage::new(mesh.clone()).unwrap().with_carriers(carriers).unwrap();
    let points: Vec<Point> = (0..40).map(|k| [0.01 * f64::from(k), 0.1 * f64::from(k % 3), 0.02]).collect();
    let options = SolverOptions { spectrum: 0, ..SolverOptions::default() };
    let check = |system| Solver::check(system, &cage, &points, options, u64::MAX).unwrap_err().to_string();
    assert!(check(&MeanValue).contains("carry 7 points, the model has 40"), "{}", check(&MeanValue));
    assert!(check(&Harmonic).contains("use mean value coordinates"), "{}", check(&Harmonic));
}
