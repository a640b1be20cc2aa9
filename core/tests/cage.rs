//! Meshes that are no cages are refused with the place that is wrong.

mod common;

use cager_core::cage::{Cage, CageError};
use cager_core::mesh::TriMesh;
use common::octahedron;

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
    assert!(matches!(error, CageError::Inward { .. }) && error.to_string().contains("--flip-cage"), "{error}");
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

#[test]
fn a_cavity_is_welcome_but_a_part_turned_inwards_is_not() {
    let part = |scale: f64, shift: f64| {
        let mesh = octahedron();
        let vertices = mesh.vertices.iter().map(|p| [scale * p[0] + shift, scale * p[1], scale * p[2]]).collect();
        TriMesh { vertices, triangles: mesh.triangles }
    };
    let both = |a: TriMesh, b: TriMesh| {
        let offset = a.vertices.len() as u32;
        let triangles = a.triangles.iter().copied().chain(b.triangles.iter().map(|t| t.map(|v| v + offset))).collect();
        TriMesh { vertices: a.vertices.into_iter().chain(b.vertices).collect(), triangles }
    };
    assert!(Cage::new(both(part(1.0, 0.0), part(0.3, 0.0).flipped())).is_ok());
    assert!(matches!(refused(both(part(1.0, 0.0), part(1.0, 5.0).flipped())), CageError::InwardPart { vertex: 6 }));
}
