//! Cages broken on purpose are diagnosed and repaired.

mod common;

use cager_cages::diagnosis::{check, repair};
use cager_cages::{EncloseOptions, enclose};
use cager_geometry::mesh::{Model, Polygons, TriMesh};
use common::{append, model, sphere, verdict};

fn ball() -> Model {
    model(&sphere([0.0; 3], 1.0, 12))
}

fn cage() -> TriMesh {
    enclose(&ball(), &EncloseOptions { vertices: 60, ..EncloseOptions::default() }).unwrap()
}

fn quad_cube(half: f64) -> Model {
    let points = (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { -half } else { half })).collect();
    let mut faces = Polygons::new();
    for quad in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        faces.push(&quad);
    }
    Model { points, faces, ..Model::default() }
}

#[test]
fn a_sound_cage_has_nothing_to_report() {
    let findings = check(&cage(), &ball());
    assert!(findings.editable() && findings.messages().is_empty(), "{findings}");
    assert!(findings.condition_number.is_some_and(|c| c > 1.0 && c < 1e4));
    let repaired = repair(&model(&cage()), &ball());
    assert!(repaired.changes.is_empty());
    assert_eq!(TriMesh::from(&repaired.cage), cage());
}

#[test]
fn everything_wrong_is_reported_at_once() {
    let mut broken = cage();
    broken.triangles[3].swap(1, 2);
    broken.triangles.remove(10);
    broken.vertices.push([9.0; 3]);
    broken.triangles.push(broken.triangles[0]);
    let findings = check(&broken, &ball());
    assert!(!findings.usable() && !findings.editable());
    assert_eq!(findings.defects.open_edges.len(), 3);
    assert!(!findings.defects.inconsistent_edges.is_empty() && !findings.defects.non_manifold_edges.is_empty());
    assert_eq!(findings.defects.loose_vertices, [60]);
    assert_eq!(findings.defects.duplicate_faces, [[0, findings.faces as u32 - 1]]);
    assert!(findings.messages().len() >= 5, "{findings}");

    let repaired = repair(&model(&broken), &ball());
    assert!(repaired.remaining.editable(), "{:?}\n{}", repaired.changes, repaired.remaining);
    assert!(verdict(&TriMesh::from(&repaired.cage), &ball()).is_valid(1));
    assert_eq!(repaired.cage.points.len(), 60);
}

#[test]
fn seams_holes_and_orientation_are_repaired_and_quads_stay_quads() {
    let mut cube = quad_cube(1.2);
    let mut faces: Vec<Vec<u32>> = cube.faces.iter().map(<[u32]>::to_vec).collect();
    faces[5].iter_mut().for_each(|v| {
        cube.points.push(cube.points[*v as usize]);
        *v = cube.points.len() as u32 - 1;
    });
    faces.iter_mut().for_each(|f| f.reverse());
    faces[1].reverse();
    faces.remove(0);
    cube.faces = Polygons::new();
    faces.iter().for_each(|f| cube.faces.push(f));
    let repaired = repair(&cube, &ball());
    assert!(repaired.remaining.editable(), "{:?}\n{}", repaired.changes, repaired.remaining);
    assert_eq!(repaired.cage.faces.arities(), [4; 6]);
    assert_eq!(repaired.cage.points.len(), 8);
}

#[test]
fn a_cage_that_is_slightly_small_is_enlarged_and_a_much_smaller_one_is_not() {
    let small = |scale: f64| {
        let mut small = cage();
        small.vertices.iter_mut().flatten().for_each(|x| *x *= scale);
        small
    };
    let findings = check(&small(0.95), &ball());
    assert!(findings.usable() && !findings.editable() && findings.outside.is_some());
    let repaired = repair(&model(&small(0.95)), &ball());
    assert!(repaired.remaining.editable(), "{:?}\n{}", repaired.changes, repaired.remaining);
    let repaired = repair(&model(&small(0.6)), &ball());
    assert!(repaired.remaining.outside.is_some() && repaired.changes.is_empty());
}

#[test]
fn thousands_of_parts_in_one_place_are_counted_as_far_as_that_is_of_use() {
    let mut piled = Model::default();
    (0..10_000).for_each(|_| append(&mut piled, &TriMesh::from(&quad_cube(1.0))));
    let findings = check(&TriMesh::from(&piled), &Model::default());
    assert_eq!((findings.defects.components, findings.self_intersections.len()), (10_000, 1_000_000));
    assert!(findings.messages().iter().any(|s| s.starts_with("at least 1000000 pairs of faces")), "{findings}");
}

#[test]
fn units_and_axes_are_guessed() {
    let mut tall = ball();
    tall.points.iter_mut().for_each(|p| *p = [0.5 * p[0], 2.0 * p[1] + 2.0, 0.3 * p[2]]);
    let fitting = enclose(&tall, &EncloseOptions { vertices: 80, ..EncloseOptions::default() }).unwrap();
    let mut centimetres = fitting.clone();
    centimetres.vertices.iter_mut().flatten().for_each(|x| *x *= 100.0);
    // A cage a hundred times too large encloses, but one too small does not.
    let mut metres = fitting.clone();
    metres.vertices.iter_mut().flatten().for_each(|x| *x *= 0.01);
    let alignment = check(&metres, &tall).alignment.unwrap();
    assert_eq!((alignment.scale, alignment.axes), (100.0, None));
    let mut z_up = fitting;
    z_up.vertices.iter_mut().for_each(|p| *p = [p[0], -p[2], p[1]]);
    let alignment = check(&z_up, &tall).alignment.unwrap();
    assert_eq!((alignment.scale, alignment.axes), (1.0, Some("y and z")));
    assert!(alignment.to_string().contains("y and z"));
}

#[test]
fn units_are_guessed_of_flat_models_across_any_axis() {
    for axis in 0..3 {
        let mut flat = ball();
        flat.points.iter_mut().for_each(|p| p[axis] = 0.0);
        let mut metres = enclose(&flat, &EncloseOptions { vertices: 80, ..EncloseOptions::default() }).unwrap();
        metres.vertices.iter_mut().flatten().for_each(|x| *x *= 0.01);
        let alignment = check(&metres, &flat).alignment.expect("an alignment");
        assert_eq!((alignment.scale, alignment.axes), (100.0, None), "across axis {axis}");
    }
}

#[test]
fn a_cage_is_not_fit_to_be_edited_before_it_is_known_to_enclose_its_model() {
    let mut broken = ball();
    broken.points[3][1] = f64::NAN;
    for model in [Model::default(), broken] {
        let findings = check(&cage(), &model);
        assert!(findings.usable() && !findings.enclosure_examined && !findings.editable(), "{findings}");
        assert!(findings.messages().iter().any(|s| s.contains("is unknown")), "{findings}");
    }
    assert!(check(&cage(), &ball()).enclosure_examined);
}

#[test]
fn no_input_is_too_broken() {
    let nan = TriMesh { vertices: vec![[f64::NAN; 3]; 3], triangles: vec![[0, 1, 2], [0, 1, 9]] };
    for mesh in [TriMesh::default(), nan] {
        let findings = check(&mesh, &Model::default());
        assert!(!findings.usable());
        let broken = Model::from(mesh.clone());
        let _ = check(&mesh, &ball());
        let remaining = repair(&broken, &ball()).remaining;
        assert!(!remaining.usable() && !remaining.messages().is_empty());
    }
    let mut two = ball();
    append(&mut two, &sphere([0.5, 0.0, 0.0], 1.0, 12));
    assert!(!check(&TriMesh::from(&two), &ball()).self_intersections.is_empty());
}

#[test]
fn thousands_of_parts_are_diagnosed_and_turned_around() {
    let mut parts = Model::default();
    let mut hollow = TriMesh::from(&quad_cube(1.0));
    for k in 0..10_000 {
        let shift = 3.0 * f64::from(k);
        let mut part = TriMesh::from(&quad_cube(1.0));
        part.vertices.iter_mut().for_each(|p| p[0] += shift);
        // Every tenth is turned inwards.
        append(&mut parts, &if k % 10 == 0 { part.clone().flipped() } else { part.clone() });
        part.vertices.iter_mut().flatten().for_each(|x| *x *= 1e-5);
        let first = hollow.vertices.len() as u32;
        hollow.vertices.extend(&part.vertices);
        hollow.triangles.extend(part.flipped().triangles.iter().map(|t| t.map(|v| v + first)));
    }
    let findings = check(&TriMesh::from(&parts), &Model::default());
    assert_eq!(
        (findings.defects.components, findings.defects.cavities, findings.defects.inward_parts.len()),
        (10_000, 0, 1_000)
    );
    let repaired = repair(&parts, &Model::default());
    assert_eq!(repaired.changes, ["turned 1000 parts to point outwards"]);
    assert!(repaired.remaining.usable() && repaired.remaining.defects.inward_parts.is_empty());
    let findings = check(&hollow, &Model::default());
    assert_eq!(
        (findings.defects.components, findings.defects.cavities, findings.defects.inward_parts.len()),
        (10_001, 10_000, 0)
    );
}

#[test]
#[ignore = "needs the captures: make captures"]
fn cages_of_the_data_are_judged_and_repaired() {
    let data = common::data();
    for (folder, cage, mesh, usable) in [
        ("invalid/pgc_elephant", "cage.obj", "mesh.obj", false),
        ("invalid/deepcage_tpose", "cage.obj", "mesh.obj", true),
        ("pairs/qmvc_beast", "cage_poly.obj", "mesh.obj", true),
        ("pairs/qmvc_ogre", "cage_poly.obj", "mesh.obj", true),
        ("makehuman-cmu-walk", "cage.obj", "rest.obj", true),
    ] {
        let [cage, model] = [cage, mesh].map(|file| common::read_obj(&data.join(folder).join(file)));
        let findings = check(&TriMesh::from(&cage), &model);
        eprintln!("\n{folder}: {findings}");
        assert_eq!(findings.usable(), usable, "{folder}");
        assert!(!findings.messages().is_empty());
        let repaired = repair(&cage, &model);
        eprintln!("-> {:?}\n-> {}", repaired.changes, repaired.remaining);
        assert!(repaired.remaining.usable(), "{folder}");
    }
}
