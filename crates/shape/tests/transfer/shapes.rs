//! Shapes between poses: what they are at the poses, on the way, with loose parts, seams, whole turns and in any unit.

use std::f64::consts::{PI, TAU};

use crate::common::{Caged, lumpy};
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_geometry::vector::{add, distance, mean, sub};
use cager_shape::Poisson;
use cager_shape::deformation::Detail;
use cager_shape::interpolate::{CagedShapes, ShapePath, ShapeSpace};
use glam::{DMat3, DVec3};

fn body() -> TriMesh {
    lumpy(10, [1.0, 0.8, 0.6], 0.3)
}

fn moved(points: &[Point], by: impl Fn(DVec3) -> DVec3) -> Vec<Point> {
    points.iter().map(|&p| by(p.into()).to_array()).collect()
}

fn turned(points: &[Point], angle: f64) -> Vec<Point> {
    let turn = DMat3::from_axis_angle(DVec3::new(0.2, -0.3, 1.0).normalize(), angle);
    moved(points, |p| turn * p)
}

fn twisted(points: &[Point], by: f64) -> Vec<Point> {
    moved(points, |p| DMat3::from_rotation_z(by * p.z) * p)
}

/// The largest distance in shares of the diagonal, the means laid onto each other.
fn farthest(found: &[Point], wanted: &[Point]) -> f64 {
    assert_eq!(found.len(), wanted.len());
    let by = sub(mean(wanted), mean(found));
    let far = found.iter().zip(wanted).map(|(p, q)| distance(add(*p, by), *q));
    far.fold(0.0, f64::max) / diagonal(wanted)
}

/// Another mesh beside the first one.
fn with(mut mesh: TriMesh, other: &TriMesh, by: impl Fn(DVec3) -> DVec3) -> TriMesh {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(moved(&other.vertices, by));
    mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    mesh
}

#[test]
fn all_weight_on_a_pose_gives_that_pose_with_parts_that_move_on_their_own() {
    let body = body();
    let count = body.vertices.len();
    let small = lumpy(4, [0.1, 0.1, 0.1], 0.0);
    let mut mesh = with(body, &small, |p| p + DVec3::new(0.9, 0.3, 0.2));
    mesh = with(mesh, &small, |p| p + DVec3::new(1.4, 0.3, 0.2));
    let last = mesh.vertices.len() as u32;
    // A single triangle, a point without any, a triangle without an area, and a thin one.
    mesh.vertices.extend([[0.0, 1.5, 0.0], [0.1, 1.5, 0.0], [0.0, 1.5, 0.1], [0.3, 1.6, 0.0], [0.0, 0.0, 1.5]]);
    mesh.triangles.extend([[last, last + 1, last + 2], [3, 4, 4], [last, last + 1, last + 4]]);
    let apart = |turn: f64, by: DVec3, bend: f64| -> Vec<Point> {
        let own = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), turn);
        let bent = |p: DVec3| p + bend * DVec3::new(p.z * p.z, p.x, -p.x * p.y);
        let each = mesh.vertices.iter().enumerate().map(|(v, &p)| match DVec3::from(p) {
            p if v < count => bent(p),
            p => bent(own * p + by),
        });
        each.map(|p| p.to_array()).collect()
    };
    let poses = [mesh.vertices.clone(), apart(0.4, DVec3::new(0.2, 0.1, 0.0), 0.3), apart(2.9, DVec3::Y, -0.2)];
    let space = ShapeSpace::new(&mesh.triangles, &poses).unwrap();
    for (k, pose) in poses.iter().enumerate() {
        let weights = [0, 1, 2].map(|j| f64::from(u8::from(j == k)));
        let shape = space.shape(&weights).unwrap();
        let error = shape.iter().zip(pose).map(|(p, q)| distance(*p, *q)).fold(0.0, f64::max) / diagonal(pose);
        assert!(error < 1e-10, "pose {k}: {error:e}");
    }
}

#[test]
fn turns_go_on_from_pose_to_pose_also_beyond_half_a_turn() {
    let mesh = body();
    let poses = [0.0, 2.5, 5.0].map(|angle| turned(&mesh.vertices, angle));
    let space = ShapeSpace::new(&mesh.triangles, &poses).unwrap();
    for (weights, angle) in [([0.0, 0.5, 0.5], 3.75), ([0.5, 0.0, 0.5], 2.5), ([0.2, 0.4, 0.4], 3.0)] {
        let error = farthest(&space.shape(&weights).unwrap(), &turned(&mesh.vertices, angle));
        assert!(error < 1e-6, "{weights:?}: {error:e}");
    }
}

#[test]
fn a_path_goes_the_shorter_way_between_its_poses_and_visits_each_once() {
    let mesh = body();
    let caged = Caged::new(mesh.clone(), 60);
    let poses = [0.0, 3.0, 6.0, 4.0].map(|angle| turned(&mesh.vertices, angle));
    let angles = [0.0, 1.5, 3.0, 4.5, 6.0, 5.0, 4.0];
    let on_mesh = ShapePath::on_mesh(&mesh.triangles, poses.to_vec(), 3).unwrap();
    let on_cage = ShapePath::on_cage(&caged.cage, caged.phi.clone(), &poses, 3).unwrap();
    for (path, limit) in [(on_mesh, 1e-6), (on_cage, 1e-4)] {
        assert_eq!(path.len(), angles.len());
        for (shape, angle) in path.zip(angles) {
            let error = farthest(&shape.unwrap(), &turned(&mesh.vertices, angle));
            assert!(error < limit, "{angle}: {error:e}");
        }
    }
}

#[test]
fn a_twist_of_more_than_a_turn_is_half_a_twist_in_between_with_what_is_fixed_to_its_end() {
    let tall = lumpy(24, [0.4, 0.4, 2.0], 0.0);
    let band = lumpy(4, [0.1, 0.1, 0.1], 0.0);
    let mut mesh = with(tall, &band, |p| p + DVec3::new(0.2, 0.0, 1.9));
    // Triangles without an area along some edges.
    mesh.triangles.extend(
        (0..40)
            .map(|k| [mesh.triangles[17 * k][0], mesh.triangles[17 * k][1], mesh.triangles[17 * k][1]])
            .collect::<Vec<_>>(),
    );
    let twist = 0.6 * TAU;
    let poses = [mesh.vertices.clone(), twisted(&mesh.vertices, twist / 2.0)];
    let space = ShapeSpace::new(&mesh.triangles, &poses).unwrap();
    let half = space.shape(&[0.5, 0.5]).unwrap();
    let error = farthest(&half, &twisted(&mesh.vertices, twist / 4.0));
    assert!(error < 0.02, "{error}");
}

/// The same body with the vertices of one meridian and of one circle doubled, as texture seams do.
fn with_seams(mesh: &TriMesh) -> (TriMesh, Vec<u32>) {
    let center = mean(&mesh.vertices);
    let mut of: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    let mut seamed = mesh.clone();
    let mut double = std::collections::HashMap::new();
    for t in &mut seamed.triangles {
        let middle = t.iter().map(|&v| mesh.vertices[v as usize]).fold([0.0; 3], add);
        let side = u8::from(middle[0] > 3.0 * center[0]) + 2 * u8::from(middle[2] > 3.0 * center[2]);
        for v in t.iter_mut().filter(|_| side > 0) {
            *v = *double.entry((*v, side)).or_insert_with(|| {
                seamed.vertices.push(mesh.vertices[*v as usize]);
                of.push(*v);
                seamed.vertices.len() as u32 - 1
            });
        }
    }
    (seamed, of)
}

#[test]
fn seams_stay_closed_and_change_nothing() {
    let mesh = body();
    let (seamed, of) = with_seams(&mesh);
    let bent = moved(&mesh.vertices, |p| p + 0.4 * DVec3::new(p.z * p.z, p.x, -p.x * p.y));
    let doubled = |points: &[Point]| -> Vec<Point> { of.iter().map(|&v| points[v as usize]).collect() };
    // As of a file of single precision, not all copies of which were rounded alike.
    let mut rounded = doubled(&bent);
    rounded.iter_mut().step_by(3).for_each(|p| p[0] += 1e-8);
    let whole = ShapeSpace::new(&mesh.triangles, &[mesh.vertices.clone(), bent.clone()]).unwrap();
    let wanted = doubled(&whole.shape(&[0.4, 0.6]).unwrap());
    for (pose, limit) in [(doubled(&bent), 1e-8), (rounded, 1e-6)] {
        let space = ShapeSpace::new(&seamed.triangles, &[seamed.vertices.clone(), pose]).unwrap();
        let error = farthest(&space.shape(&[0.4, 0.6]).unwrap(), &wanted);
        assert!(error < limit, "{error:e}");
    }
    let fine = doubled(&Detail::new(&mesh).unwrap().add(&bent));
    let error = farthest(&Detail::new(&seamed).unwrap().add(&doubled(&bent)), &fine);
    assert!(error < 1e-8, "{error:e}");
}

#[test]
fn vertices_that_touch_at_rest_alone_come_apart() {
    let mesh = body();
    let top = mesh.vertices[0];
    let other = with(mesh.clone(), &mesh, |p| DVec3::new(p.x, p.y, 2.0 * top[2] - p.z));
    let half = mesh.vertices.len();
    let apart: Vec<Point> =
        other.vertices.iter().enumerate().map(|(v, p)| if v < half { *p } else { [p[0], p[1], p[2] + 1.0] }).collect();
    let space = ShapeSpace::new(&other.triangles, &[other.vertices.clone(), apart]).unwrap();
    let shape = space.shape(&[0.5, 0.5]).unwrap();
    assert!((shape[half][2] - shape[0][2] - 0.5).abs() < 1e-6, "{:?} {:?}", shape[0], shape[half]);
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let mesh = with(body(), &lumpy(4, [0.1, 0.1, 0.1], 0.0), |p| p + DVec3::new(0.9, 0.3, 0.2));
    let bent = moved(&mesh.vertices, |p| p + 0.4 * DVec3::new(p.z * p.z, p.x, -p.x * p.y));
    let caged = Caged::new(body(), 60);
    let of = |unit: f64| -> [Vec<Point>; 4] {
        let scaled = |points: &[Point]| moved(points, |p| unit * p);
        let rest = TriMesh { vertices: scaled(&mesh.vertices), ..mesh.clone() };
        let space = ShapeSpace::new(&mesh.triangles, &[rest.vertices.clone(), scaled(&bent)]).unwrap();
        let detail = Detail::new(&rest).unwrap();
        let turn = DMat3::from_axis_angle(DVec3::X, 1.0) * 1.2;
        let poisson = Poisson::new(&rest).unwrap().solve(&vec![turn; mesh.triangles.len()]);
        let cage = TriMesh { vertices: scaled(caged.cage.vertices()), ..caged.cage.mesh().clone() };
        let count = caged.rest.vertices.len();
        let poses = [scaled(&mesh.vertices[..count]), scaled(&bent[..count])];
        let cage = cager_core::cage::Cage::new(cage).unwrap();
        let on_cage = CagedShapes::new(&cage, caged.phi.clone(), &poses).unwrap();
        [
            space.shape(&[0.3, 0.7]).unwrap(),
            detail.add(&scaled(&bent)),
            poisson.iter().map(DVec3::to_array).collect(),
            on_cage.shape(&[0.3, 0.7]).unwrap(),
        ]
    };
    let usual = of(1.0);
    for unit in [1e-9, 1e9] {
        for (k, (found, wanted)) in of(unit).iter().zip(&usual).enumerate() {
            let error = farthest(&moved(found, |p| p / unit), wanted);
            assert!(error < 1e-7, "{k} in {unit:e}: {error:e}");
        }
    }
}

#[test]
fn shapes_on_a_cage_that_the_points_hardly_determine_stay_near_their_way() {
    // More than half as many cage vertices as points.
    let mesh = lumpy(8, [1.0, 0.8, 0.6], 0.3);
    let caged = Caged::new(mesh.clone(), 60);
    let poses = [0.0, 2.0].map(|angle| turned(&mesh.vertices, angle));
    let space = CagedShapes::new(&caged.cage, caged.phi.clone(), &poses).unwrap();
    for t in [-0.5, 0.0, 0.5, 1.0] {
        let error = farthest(&space.shape(&[1.0 - t, t]).unwrap(), &turned(&mesh.vertices, 2.0 * t));
        assert!(error < 1e-6, "{t}: {error:e}");
    }
    let bent = moved(&mesh.vertices, |p| DMat3::from_rotation_y(0.4 * PI * p.z) * p);
    let half = moved(&mesh.vertices, |p| DMat3::from_rotation_y(0.2 * PI * p.z) * p);
    let space = CagedShapes::new(&caged.cage, caged.phi, &[mesh.vertices, bent]).unwrap();
    let error = farthest(&space.shape(&[0.5, 0.5]).unwrap(), &half);
    assert!(error < 0.05, "{error}");
}
