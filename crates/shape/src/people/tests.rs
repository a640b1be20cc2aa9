//! Derivatives of every stage against central differences, on a person made of boxes.

use super::matching::Match;
use super::stages::{Free, LatentStage, QuadStage, Stage, VertexStage};
use super::{FitOptions, PersonFit, PersonModel};
use crate::Similarity;
use crate::people::COORDINATES;
use crate::people::manifold::{Examples, Kind, Manifold};
use crate::people::rig::{Quad, Rig};
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::vector::dot;
use glam::{DMat3, DVec3};

const SYSTEMS: [&dyn CoordinateSystem; 2] = [COORDINATES, &MeanValue];

/// A rig of boxes, left along x, up along y.
pub(crate) fn mannequin() -> Rig {
    let level = |y: f64, x: f64, z: f64| [[x, y, z], [-x, y, z], [-x, y, -z], [x, y, -z]];
    let trunk = [(0.9, 2.0, 1.4), (2.3, 1.7, 1.2), (3.9, 1.8, 1.3), (6.2, 1.1, 1.2), (8.7, 1.1, 1.3)];
    let mut quads: Vec<Quad> =
        trunk.iter().map(|&(y, x, z)| Quad { joint: [0.0, y - 0.2, 0.1], corners: level(y, x, z) }).collect();
    for s in [1.0, -1.0] {
        for x in [1.9, 3.8, 6.1, 8.2] {
            let corners = [[x * s, 4.5, 0.6], [x * s, 4.5, -0.6], [x * s, 5.7, -0.6], [x * s, 5.7, 0.6]];
            quads.push(Quad { joint: [(x - 0.2) * s, 5.1, 0.0], corners });
        }
        for (y, z) in [(-1.5, 1.2), (-3.8, 0.9), (-6.7, 0.8)] {
            let corners = [[1.8 * s, y, z], [0.1 * s, y, z], [0.1 * s, y, -z], [1.8 * s, y, -z]];
            quads.push(Quad { joint: [0.9 * s, y + 0.3, 0.0], corners });
        }
        let toe = [[1.6 * s, -7.3, 2.0], [0.2 * s, -7.3, 2.0], [0.2 * s, -8.4, 2.0], [1.6 * s, -8.4, 2.0]];
        quads.push(Quad { joint: [0.9 * s, -7.6, 1.2], corners: toe });
    }
    Rig { quads, crotch: [[0.0, -0.8, 1.2], [0.0, -0.8, -1.2]], up: [0.0, 1.0, 0.0], forward: [0.0, 0.0, 1.0] }
}

/// Its cage, drawn in towards the joints.
fn body(rig: &Rig) -> TriMesh {
    let cage = rig.cage();
    let inward = |(v, p): (usize, &Point)| {
        let joint = rig.quads[crate::people::rig::owner(v)].joint;
        [0, 1, 2].map(|k| joint[k] + 0.6 * (p[k] - joint[k]))
    };
    TriMesh { vertices: cage.vertices.iter().enumerate().map(inward).collect(), triangles: cage.triangles }
}

/// Poses that bend all quads.
pub(crate) fn poses(rig: &Rig, count: usize) -> Vec<Vec<f64>> {
    let rest = rig.rest_pose();
    let pose = |i: usize| {
        let number = |(j, y): (usize, &f64)| {
            let phase = 0.35 * i as f64 + 1.7 * j as f64;
            y + 0.3 * phase.sin() * (1.0 + 0.3 * (0.11 * (i * j) as f64).cos())
        };
        rest.iter().enumerate().map(number).collect()
    };
    (0..count).map(pose).collect()
}

/// Compares the derivatives of a stage with differences, by stepping a copy of it.
fn compare<S: Stage>(fit: &PersonFit<'_>, stage: impl Fn() -> S, what: &str) {
    let matches: Vec<Match> = (0..40)
        .map(|k| {
            let normal = DVec3::new(1.0, 0.3 * f64::from(k).sin(), f64::from(k).cos()).normalize();
            Match { sample: k as usize * 7, normal, residual: 0.0, distance: 0.0, weight: 1.0 }
        })
        .collect();
    let at = stage().linearized();
    let analytic = fit.derivatives(&at, &matches);
    let unknowns = analytic.nrows();
    let step = 1e-5;
    for i in 0..unknowns {
        let moved = |by: f64| {
            let mut stage = stage();
            let mut change = vec![0.0; unknowns];
            change[i] = by;
            stage.step(&change);
            let points = fit.model.sampled(&stage.linearized().vertices, 1).points;
            matches.iter().map(|m| dot(points[m.sample], m.normal.to_array())).collect::<Vec<f64>>()
        };
        for (k, (up, down)) in moved(step).iter().zip(moved(-step)).enumerate() {
            let difference = (up - down) / (2.0 * step);
            let found = analytic[(i, k)];
            assert!((difference - found).abs() < 1e-6 * found.abs().max(1.0), "{what} {i} {k}: {difference} {found}");
        }
    }
}

#[test]
fn derivatives_of_every_stage_equal_central_differences() {
    let rig = mannequin();
    let body = body(&rig);
    let examples = Examples::new(&rig, &poses(&rig, 24)).unwrap();
    let placement = Similarity {
        rotation: DMat3::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 1.1),
        translation: DVec3::new(3.0, -2.0, 5.0),
        ..Similarity::IDENTITY
    };
    for system in SYSTEMS {
        let model = PersonModel::new(&body, &rig, system, 300).unwrap();
        for kind in [Kind::Pca, Kind::Gplvm] {
            let manifold = Manifold::learn(&examples, kind, 4).unwrap();
            let fit = PersonFit { model: &model, manifold: &manifold, options: FitOptions::default() };
            let latent: Vec<f64> = manifold.latent(5).iter().map(|x| x + 0.07).collect();
            let pose = manifold.pose(&latent);
            for free in [Free::Both, Free::Placement, Free::Latent] {
                let stage = || LatentStage {
                    rig: &rig,
                    manifold: &manifold,
                    placement,
                    latent: latent.clone(),
                    offset: (0..pose.len()).map(|k| 0.02 * (k as f64).sin()).collect(),
                    weight: 1.0,
                    free,
                };
                compare(&fit, stage, "latent");
            }
            let quads = || QuadStage::new(&rig, model.height(), &fit.options, placement, pose.clone());
            compare(&fit, quads, "quads");
            let vertices = quads().linearized().vertices;
            compare(&fit, || VertexStage::new(model.height(), &fit.options, vertices.clone()), "vertices");
        }
    }
}

#[test]
fn derivatives_of_manifolds_and_their_priors_equal_central_differences() {
    let rig = mannequin();
    let examples = Examples::new(&rig, &poses(&rig, 24)).unwrap();
    for kind in [Kind::Pca, Kind::Gplvm] {
        let learned = Manifold::learn(&examples, kind, 3).unwrap();
        let manifold = Manifold::from_json(learned.to_json().as_bytes()).unwrap();
        let x: Vec<f64> = manifold.latent(9).iter().map(|x| x + 0.11).collect();
        let pose = manifold.pose(&x);
        assert!(pose.iter().zip(learned.pose(&x)).all(|(a, b)| (a - b).abs() < 1e-9), "from its file");
        let (jacobian, prior) = (manifold.jacobian(&x), manifold.prior(&x));
        let step = 1e-5;
        for k in 0..x.len() {
            let moved = |by: f64| {
                let mut x = x.clone();
                x[k] += by;
                x
            };
            let (up, down) = (moved(step), moved(-step));
            let near = |found: f64, up: f64, down: f64| {
                let difference = (up - down) / (2.0 * step);
                assert!((difference - found).abs() < 1e-6 * found.abs().max(1.0), "{kind:?} {k}: {difference} {found}");
            };
            for (j, found) in jacobian[k].iter().enumerate() {
                near(*found, manifold.pose(&up)[j], manifold.pose(&down)[j]);
            }
            let (above, below) = (manifold.prior(&up).residuals, manifold.prior(&down).residuals);
            for (r, row) in prior.jacobian.iter().enumerate() {
                near(row[k], above[r], below[r]);
            }
        }
    }
}

#[path = "../../tests/recovery/common.rs"]
mod common;

/// What a rig can do at best: its quads and its vertices fitted to known correspondences.
#[test]
#[ignore = "needs the captures: make captures"]
fn a_walk_is_followed_closely_where_correspondences_are_known() {
    if !common::there("makehuman-cmu-walk/rest.obj") {
        return;
    }
    let walk = common::capture("makehuman-cmu-walk", 1);
    let rig = crate::people::rig::place(&walk.rest, &crate::people::rig::PlacementOptions::default()).unwrap().rig;
    let samples = crate::registration::sample_surface(&walk.rest.vertices, &walk.rest.triangles, 1500, 0);
    let examples = Examples::new(&rig, &poses(&rig, 24)).unwrap();
    let manifold = Manifold::learn(&examples, Kind::Pca, 4).unwrap();
    let mut means = [0.0; 2];
    let frames = [0, 12, 24, 36, 48, 60, 72];
    for (which, system) in SYSTEMS.into_iter().enumerate() {
        let model = PersonModel::new(&walk.rest, &rig, system, 1500).unwrap();
        let options = FitOptions { quads: 1e-4, bones: 1e-4, vertices: 1e-5, ..Default::default() };
        let fit = PersonFit { model: &model, manifold: &manifold, options };
        for frame in frames {
            let truth: Vec<Point> = samples.iter().map(|s| s.at(&walk.frames[frame], &walk.rest.triangles)).collect();
            let mut quads = QuadStage::new(&rig, model.height(), &options, Similarity::IDENTITY, rig.rest_pose());
            known(&fit, &mut quads, &truth, 25);
            let mut vertices = VertexStage::new(model.height(), &options, quads.linearized().vertices);
            if which == 1 {
                known(&fit, &mut vertices, &truth, 40);
            }
            let cage = if which == 1 { vertices.linearized().vertices } else { quads.linearized().vertices };
            let found = model.deformed(&cage);
            let sum: f64 =
                found.iter().zip(&walk.frames[frame]).map(|(a, b)| cager_geometry::vector::distance(*a, *b)).sum();
            means[which] += 100.0 * sum / found.len() as f64 / walk.height / frames.len() as f64;
        }
    }
    eprintln!(
        "floor with known correspondences: quads {:.3} %, free vertices {:.3} % of the height",
        means[0], means[1]
    );
    assert!(means[0] <= 0.38 && means[1] <= 0.43, "{means:?}");
}

fn known(fit: &PersonFit<'_>, stage: &mut dyn Stage, truth: &[Point], rounds: usize) {
    let weight = 1e6 / truth.len() as f64;
    for _ in 0..rounds {
        let at = stage.linearized();
        let sampled = fit.model.sampled(&at.vertices, 1);
        let mut matches = Vec::new();
        for (sample, (p, q)) in sampled.points.iter().zip(truth).enumerate() {
            for (k, normal) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
                matches.push(Match { sample, normal, residual: p[k] - q[k], distance: 0.0, weight });
            }
        }
        let derivatives = fit.derivatives(&at, &matches);
        let residuals: Vec<f64> = matches.iter().map(|m| m.residual * weight.sqrt()).collect();
        let mut equations = super::equations::NormalEquations::new(&derivatives, &residuals);
        stage.hold(&mut equations);
        stage.step(&equations.step().unwrap());
    }
}
