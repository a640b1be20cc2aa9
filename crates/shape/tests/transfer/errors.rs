//! What is said of input that cannot be used, and models that look bad but can.

use crate::common::{Caged, lumpy};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_geometry::vector::distance;
use cager_shape::interpolate::{CagedShapes, ShapeSpace};
use cager_shape::transfer::alignment::AlignBy;
use cager_shape::transfer::fitted::{CagedTarget, FittedTransfer};
use cager_shape::transfer::public::PublicTransfer;
use cager_shape::transfer::public_cage::PublicCage;
use cager_shape::transfer::{FittedOptions, Pose, needs_cage};
use cager_shape::{MeshError, Poisson, ShapeError, Similarity, TransferError};
use glam::{DMat3, DVec3};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

fn body() -> TriMesh {
    lumpy(10, [1.0, 0.8, 0.6], 0.3)
}

#[test]
fn frames_of_other_points_and_with_holes_in_their_numbers_are_named() {
    let source = Caged::new(body(), 40);
    let options = FittedOptions { pose: Pose::Relative, ..FittedOptions::default() };
    let transfer = FittedTransfer::new(&source.source(), &body(), &options).unwrap();
    let mut frame = source.rest.vertices.clone();
    frame[3][1] = f64::NAN;
    let error = transfer.pose(7, &frame).unwrap_err();
    assert!(matches!(error, TransferError::FrameNotFinite { frame: 7, point: 3 }), "{error}");
    let error = transfer.pose(2, &frame[1..]).unwrap_err();
    assert!(error.to_string().starts_with("the source's frame 2 has"), "{error}");
}

#[test]
fn a_target_that_the_source_cannot_be_laid_onto_is_refused() {
    let source = Caged::new(body(), 40);
    let far = Similarity { scale: 0.02, translation: DVec3::splat(9.0), ..Similarity::IDENTITY };
    let options = FittedOptions { align: AlignBy::Given(far), ..FittedOptions::default() };
    // A vertex far away that no triangle uses makes nothing nearer.
    let mut loose = body();
    loose.vertices.push([1e4, 0.0, 0.0]);
    for target in [body(), loose] {
        let error = FittedTransfer::new(&source.source(), &target, &options).map(|_| ()).unwrap_err();
        assert!(matches!(error, TransferError::OutOfReach { .. }), "{error}");
        assert!(error.to_string().contains("at least 5.00 %"), "{error}");
    }
    let lost = TransferError::OutOfReach { score: f64::NAN, limit: 0.9 };
    assert!(!lost.to_string().contains("NaN"), "{lost}");
    let nothing = TriMesh { triangles: Vec::new(), ..body() };
    let error = FittedTransfer::new(&source.source(), &nothing, &options).map(|_| ()).unwrap_err();
    assert!(matches!(error, TransferError::Target(MeshError::NoArea)), "{error}");
}

#[test]
fn a_transfer_stops_between_two_stages_wherever_it_is_told_to() {
    let source = Caged::new(body(), 40);
    let asked = AtomicUsize::new(0);
    let told_after = |most: usize, align: AlignBy| {
        asked.store(0, Relaxed);
        let stopped = || asked.fetch_add(1, Relaxed) >= most;
        let options = FittedOptions { align, stopped: &stopped, ..FittedOptions::default() };
        FittedTransfer::new(&source.source(), &body(), &options).map(|_| ())
    };
    for (most, align) in [(0, AlignBy::Surfaces), (3, AlignBy::AsTheyStand)] {
        let error = told_after(most, align).unwrap_err();
        assert!(matches!(error, TransferError::Stopped), "{error}");
        // What is stopped asks once more, and no stage follows.
        assert!(asked.load(Relaxed) <= most + 3, "asked {} times", asked.load(Relaxed));
    }
    told_after(usize::MAX, AlignBy::AsTheyStand).unwrap();
    assert!(asked.load(Relaxed) > 8);
}

#[test]
fn a_body_that_is_the_same_either_way_round_is_refused_as_ambiguous() {
    let source = Caged::new(lumpy(14, [1.0, 0.7, 0.5], 0.0), 40);
    let turn = DMat3::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), 1.0);
    let egg = lumpy(12, [1.0, 0.7, 0.5], 0.0);
    let target =
        TriMesh { vertices: egg.vertices.iter().map(|&p| (turn * DVec3::from(p)).to_array()).collect(), ..egg };
    let error = FittedTransfer::new(&source.source(), &target, &FittedOptions::default()).map(|_| ()).unwrap_err();
    assert!(matches!(error, TransferError::Ambiguous(false)), "{error}");
}

/// Each triangle alone, drawn in a little towards its middle by `gap`.
fn apart(mesh: &TriMesh, gap: f64) -> TriMesh {
    let mut soup = TriMesh { vertices: Vec::new(), triangles: Vec::new() };
    for triangle in &mesh.triangles {
        let corners = triangle.map(|v| DVec3::from(mesh.vertices[v as usize]));
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let first = soup.vertices.len() as u32;
        soup.vertices.extend(corners.map(|p| (if gap > 0.0 { p.lerp(middle, gap) } else { p }).to_array()));
        soup.triangles.push([first, first + 1, first + 2]);
    }
    soup
}

#[test]
fn soups_and_clouds_need_a_cage_and_meshes_with_seams_do_not() {
    let mesh = body();
    assert!(!needs_cage(&mesh) && !needs_cage(&apart(&mesh, 0.0)));
    assert!(needs_cage(&apart(&mesh, 0.1)));
    assert!(needs_cage(&TriMesh { triangles: Vec::new(), ..mesh.clone() }));
    let mut with_crumbs = mesh.clone();
    let crumbs = apart(&TriMesh { vertices: mesh.vertices.iter().map(|p| p.map(|x| 0.2 * x)).collect(), ..mesh }, 0.1);
    let first = with_crumbs.vertices.len() as u32;
    with_crumbs.vertices.extend(crumbs.vertices);
    with_crumbs.triangles.extend(crumbs.triangles.iter().map(|t| t.map(|v| v + first)));
    assert!(!needs_cage(&with_crumbs));
}

#[test]
fn a_soup_follows_through_a_cage_as_the_mesh_does() {
    let source = Caged::new(lumpy(12, [1.0, 0.8, 0.6], 0.3), 60);
    let mesh = body();
    let mut soup = apart(&mesh, 0.02);
    // Points at one place, and an edge without a length.
    soup.vertices.extend(vec![soup.vertices[0]; 40]);
    soup.triangles.push([0, 0, 1]);
    let caged = Caged::within(soup.clone(), Caged::new(mesh.clone(), 60).cage.mesh().clone());
    let model = crate::common::model_of(&soup);
    let body = CagedTarget { model: &model, cage: &caged.cage, phi: caged.phi.as_ref() };
    let options = FittedOptions { pose: Pose::Relative, ..FittedOptions::default() };
    let through = FittedTransfer::through_cage(&source.source(), &body, &options).unwrap();
    let on_mesh = FittedTransfer::new(&source.source(), &mesh, &options).unwrap();
    let frame: Vec<Point> =
        source.rest.vertices.iter().map(|p| [p[0] + 0.3 * p[2] * p[2], p[1] + 0.2 * p[0], p[2]]).collect();
    let (found, wanted) = (through.pose(0, &frame).unwrap(), on_mesh.pose(0, &frame).unwrap());
    let corner = |(k, p): (usize, &Point)| distance(*p, wanted[mesh.triangles[k / 3][k % 3] as usize]);
    let corners = 3 * mesh.triangles.len();
    let mean = found[..corners].iter().enumerate().map(corner).sum::<f64>() / corners as f64;
    assert!(mean < 0.02 * diagonal(&mesh.vertices), "{mean}");
}

#[test]
fn a_public_cage_with_more_vertices_than_the_source_determines_is_refused() {
    let (target, few) = (body(), vec![[0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.1], [0.1, 0.1, 0.1]]);
    let cage = Cage::new(PublicCage::Box.around(&target, &target).unwrap()).unwrap();
    let of = |points: &[Point]| {
        let source = TriMesh { vertices: points.to_vec(), triangles: Vec::new() };
        PublicTransfer::new(&source, &target, Similarity::IDENTITY, &cage, &MeanValue, None).map(|_| ()).unwrap_err()
    };
    assert!(matches!(of(&few), TransferError::Rank { rank: 4, unknowns: 8 }));
    let line: Vec<Point> = (0..30).map(|k| [0.01 * f64::from(k), 0.0, 0.0]).collect();
    assert!(matches!(of(&line), TransferError::Rank { unknowns: 8, .. }));
}

#[test]
fn weights_and_poses_that_do_not_fit_are_named() {
    let mesh = body();
    let poses = [mesh.vertices.clone(), mesh.vertices.clone()];
    let space = ShapeSpace::new(&mesh.triangles, &poses).unwrap();
    assert_eq!(space.shape(&[0.5, 0.6]), Err(ShapeError::Sum(1.1)));
    assert_eq!(space.shape(&[f64::NAN, 1.0]), Err(ShapeError::Weight(0)));
    assert_eq!(space.shape(&[1.0, f64::INFINITY]), Err(ShapeError::Weight(1)));
    let one = space.shape(&[1.0]).unwrap_err();
    assert_eq!(one.to_string(), "there is 1 weight for 2 poses; give one for each");
    let three = space.shape(&[0.2, 0.3, 0.5]).unwrap_err();
    assert_eq!(three.to_string(), "there are 3 weights for 2 poses; give one for each");
    let of = |poses: &[Vec<Point>]| ShapeSpace::new(&mesh.triangles, poses).map(|_| ()).unwrap_err();
    assert_eq!(of(&poses[..1]).to_string(), "there is only one pose; shapes between poses need two or more");
    assert_eq!(of(&[]).to_string(), "there are no poses; shapes between poses need two or more");
    assert!(matches!(of(&[poses[0].clone(), vec![[0.0; 3]]]), ShapeError::OtherPoints { pose: 1, points: 1, .. }));
    let caged = Caged::new(mesh.clone(), 40);
    let on_cage = |columns: usize, rows: usize| {
        let phi = caged.phi.get(..rows, ..columns).to_owned();
        let poses = poses.each_ref().map(|pose| pose[..rows].to_vec());
        CagedShapes::new(&caged.cage, phi, &poses).map(|_| ()).unwrap_err()
    };
    let vertices = caged.cage.vertices().len();
    assert_eq!(on_cage(vertices - 1, 100), ShapeError::Columns { columns: vertices - 1, vertices });
    assert_eq!(on_cage(vertices, 9), ShapeError::Rank { rank: 9, unknowns: vertices });
}

#[test]
fn meshes_with_double_points_loose_parts_and_thin_triangles_follow_similarity_motions() {
    let mut mesh = body();
    let (count, faces) = (mesh.vertices.len() as u32, mesh.triangles.len());
    // A smaller copy inside, all its triangles apart; a double triangle, one without an area, a point without any.
    for t in 0..faces {
        let corners = mesh.triangles[t].map(|v| mesh.vertices[v as usize].map(|x| 0.3 * x));
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(corners);
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh.triangles.extend([mesh.triangles[0], [0, 1, 1], [5, 5, 5]]);
    mesh.vertices.extend([mesh.vertices[0], [0.9, 0.9, 0.9]]);
    let poisson = Poisson::new(&mesh).unwrap();
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 1.0) * 1.2;
    let still = poisson.solve(&vec![DMat3::IDENTITY; mesh.triangles.len()]);
    let moved = poisson.solve(&vec![turn; mesh.triangles.len()]);
    let size = diagonal(&mesh.vertices);
    let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    let (from, to) = (mean(poisson.rest()), mean(&moved));
    for (v, p) in poisson.rest().iter().enumerate() {
        assert!(still[v].distance(*p) < 1e-12 * size);
        let wanted = turn * (*p - from) + to;
        assert!(distance(wanted.to_array(), moved[v].to_array()) < 1e-9 * size, "{v} of {count}");
    }
}

#[test]
fn a_shape_between_two_turns_of_a_body_is_turned_half_as_far() {
    let mesh = body();
    let turned = |angle: f64| -> Vec<Point> {
        let turn = DMat3::from_axis_angle(DVec3::Z, angle);
        mesh.vertices.iter().map(|&p| (turn * DVec3::from(p)).to_array()).collect()
    };
    let space = ShapeSpace::new(&mesh.triangles, &[turned(0.0), turned(2.0)]).unwrap();
    for t in [-0.5, 0.5, 1.5] {
        let (found, wanted) = (space.shape(&[1.0 - t, t]).unwrap(), turned(2.0 * t));
        let mean = |of: &[Point]| cager_geometry::vector::mean(of);
        let by = cager_geometry::vector::sub(mean(&found), mean(&wanted));
        for (p, q) in found.iter().zip(&wanted) {
            assert!(distance(*p, cager_geometry::vector::add(*q, by)) < 1e-6, "{t}");
        }
    }
}
