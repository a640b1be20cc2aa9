//! People recovered from observed surfaces, against vertex-exact truth; figures in percent of the height.

use crate::common::{Capture, capture, there};
use crate::observe::{errors, followed, poses, seen};
use crate::true_joints::{LIMBS, TrueJoints};
use cager_core::cage::Cage;
use cager_geometry::mesh::Point;
use cager_geometry::vector::distance;
use cager_shape::people::joints::{CagedJoints, MarkedJoints};
use cager_shape::people::manifold::{Examples, Kind, Manifold};
use cager_shape::people::rig::{PlacementOptions, Rig, place};
use cager_shape::people::{COORDINATES, FitOptions, Method, PersonFit, PersonModel, SAMPLES};
use std::time::Instant;

fn rig_of(capture: &Capture, up: Point) -> Rig {
    place(&capture.rest, &PlacementOptions { up, ..Default::default() }).unwrap().rig
}

fn learned(rig: &Rig, poses: &[Vec<f64>], kind: Kind, dims: usize) -> Manifold {
    Manifold::learn(&Examples::new(rig, poses).unwrap(), kind, dims).unwrap()
}

/// Mean error of vertices, of the worst frame, and the cages.
fn recovered(
    what: &str,
    fit: &PersonFit<'_>,
    truth: &Capture,
    frames: &[usize],
    noise: f64,
) -> (f64, f64, Vec<Vec<Point>>) {
    let seen: Vec<_> = frames.iter().map(|&f| seen(truth, f, 15_000, noise)).collect();
    let start = Instant::now();
    let tracked = followed(fit, &seen);
    let each = start.elapsed().as_millis() / frames.len() as u128;
    let all: Vec<f64> = tracked
        .iter()
        .zip(frames)
        .map(|(frame, &f)| errors(&fit.model.deformed(&frame.fit.vertices), &truth.frames[f], truth.height)[0])
        .collect();
    let (sum, worst) = all.iter().fold((0.0, 0.0_f64), |(sum, worst), &e| (sum + e, worst.max(e)));
    let mean = sum / all.len() as f64;
    let lost = tracked.iter().filter(|frame| frame.lost).count();
    eprintln!("{what}: vertices {mean:.3} %, worst frame {worst:.2} %, {lost} lost, {each} ms a frame, start included");
    (mean, worst, tracked.into_iter().map(|frame| frame.fit.vertices).collect())
}

#[test]
#[ignore = "needs the captures: make captures"]
fn a_walk_is_recovered_by_the_poses_of_its_first_cycle_and_not_by_the_printed_recipe() {
    if !there("makehuman-cmu-walk/rest.obj") {
        return;
    }
    let walk = capture("makehuman-cmu-walk", 1);
    let rig = rig_of(&walk, [0.0, 1.0, 0.0]);
    let own = poses(&rig, "02_02", 5..155, 2);
    let options = FitOptions::default();
    let model = PersonModel::new(&walk.rest, &rig, COORDINATES, SAMPLES).unwrap();
    let frames: Vec<usize> = (37..73).step_by(3).collect();
    let manifold = learned(&rig, &own, Kind::Pca, 10);
    let fit = PersonFit { model: &model, manifold: &manifold, options };
    let (robust, ..) = recovered("robust, PCA 10, own first cycle", &fit, &walk, &frames, 0.0);
    assert!(robust < 0.65, "{robust}");
    let start = Instant::now();
    let manifold = learned(&rig, &own, Kind::Gplvm, 10);
    eprintln!("GPLVM of {} poses learned in {:.2} s", own.len(), start.elapsed().as_secs_f64());
    let fit = PersonFit { model: &model, manifold: &manifold, options };
    let (robust, ..) = recovered("robust, GPLVM 10, own first cycle", &fit, &walk, &frames, 0.0);
    assert!(robust < 0.75, "{robust}");
    let fit = PersonFit { options: FitOptions { method: Method::Paper, ..options }, ..fit };
    let (paper, ..) = recovered("paper, GPLVM 10, own first cycle", &fit, &walk, &frames, 0.0);
    assert!(paper > 1.5 * robust, "{paper}");
}

#[test]
#[ignore = "needs the captures: make captures"]
fn a_man_is_recovered_with_joints_by_the_poses_of_another_person() {
    if !there("anny-man-02_02/rest.obj") {
        return;
    }
    let man = capture("anny-man-02_02", 2);
    let rig = rig_of(&man, [0.0, 0.0, 1.0]);
    let other = poses(&rig, "131_01", 0..994, 8);
    let manifold = learned(&rig, &other, Kind::Pca, 20);
    let options = FitOptions::default();
    let model = PersonModel::new(&man.rest, &rig, COORDINATES, SAMPLES).unwrap();
    let frames: Vec<usize> = (0..60).step_by(3).collect();
    let fit = PersonFit { model: &model, manifold: &manifold, options };
    let (mean, _, cages) =
        recovered("anny man, PCA 20 of another person's dance, noise 0.5 %", &fit, &man, &frames, 0.005);
    let (truth, marked) = (TrueJoints::of("anny-man-02_02"), LIMBS);
    let positions: Vec<Point> = marked.iter().map(|&j| truth.at_rest(&man, &frames, j)).collect();
    let parents = (0..marked.len()).map(|k| (k > 0).then_some(0)).collect();
    let names = marked.iter().map(|j| format!("joint {j}")).collect();
    let joints =
        CagedJoints::new(MarkedJoints { names, parents, positions }, &Cage::new(rig.cage()).unwrap(), COORDINATES)
            .unwrap();
    let mut sum = 0.0;
    // Heights of the ankles, and what they should be.
    let mut heights = [(); 2].map(|()| (Vec::new(), Vec::new()));
    for (cage, &f) in cages.iter().zip(&frames) {
        let found = joints.positions(cage);
        for ((found_heights, true_heights), k) in heights.iter_mut().zip([2, 5]) {
            found_heights.push(found[k][2]);
            true_heights.push(truth.at(f, marked[k])[2]);
        }
        sum += marked.iter().zip(&found).map(|(&j, p)| distance(*p, truth.at(f, j))).sum::<f64>();
    }
    let joint_error = 100.0 * sum / (frames.len() * marked.len()) as f64 / man.height;
    let gait = heights.map(|(found, truth)| correlation(&found, &truth));
    eprintln!("joints {joint_error:.3} %, correlation of ankle heights {gait:.4?}");
    assert!(mean < 1.3 && joint_error < 1.2, "{mean} {joint_error}");
    assert!(gait.iter().all(|&r| r >= 0.995), "{gait:?}");
}

#[test]
#[ignore = "needs the captures: make captures"]
fn a_woman_is_recovered_with_the_template_of_a_man() {
    if !there("anny-heavywoman-02_02/rest.obj") {
        return;
    }
    let (man, woman) = (capture("anny-man-02_02", 2), capture("anny-heavywoman-02_02", 2));
    let rig = rig_of(&man, [0.0, 0.0, 1.0]);
    let manifold = learned(&rig, &poses(&rig, "02_02", 8..244, 3), Kind::Pca, 10);
    let options = FitOptions::default();
    let model = PersonModel::new(&man.rest, &rig, COORDINATES, SAMPLES).unwrap();
    let frames: Vec<usize> = (0..60).step_by(5).collect();
    let fit = PersonFit { model: &model, manifold: &manifold, options };
    let (mean, ..) = recovered("heavy woman by the man's template, PCA 10 of the clip", &fit, &woman, &frames, 0.0);
    assert!(mean < 2.5, "{mean}");
}

/// Pearson's.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let centered = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        x.iter().map(|x| x - mean).collect::<Vec<f64>>()
    };
    let (a, b) = (centered(a), centered(b));
    let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    inner(&a, &b) / (inner(&a, &a) * inner(&b, &b)).sqrt()
}

#[test]
#[ignore = "needs the captures: make captures"]
fn people_are_found_in_single_frames_whatever_their_heading() {
    if !there("anny-man-02_02/rest.obj") {
        return;
    }
    let man = capture("anny-man-02_02", 2);
    let rig = rig_of(&man, [0.0, 0.0, 1.0]);
    let manifold = learned(&rig, &poses(&rig, "131_01", 0..994, 8), Kind::Pca, 20);
    let options = FitOptions::default();
    let model = PersonModel::new(&man.rest, &rig, COORDINATES, SAMPLES).unwrap();
    let fit = PersonFit { model: &model, manifold: &manifold, options };
    let mut all = Vec::new();
    for f in (0..60).step_by(3) {
        // Headings between those that the search tries, each another one.
        let (sine, cosine) = (2.4 * f as f64).sin_cos();
        let turned = |p: &Point| [cosine * p[0] - sine * p[1], sine * p[0] + cosine * p[1], p[2]];
        let mut seen = seen(&man, f, 15_000, 0.005);
        seen.points.iter_mut().chain(&mut seen.normals).for_each(|p| *p = turned(p));
        let truth: Vec<Point> = man.frames[f].iter().map(turned).collect();
        let found = fit.fit(&seen, None);
        all.push(errors(&fit.model.deformed(&found.vertices), &truth, man.height)[0]);
    }
    let good = all.iter().filter(|&&error| error < 1.5).count();
    eprintln!("{good} of {} single frames below 1.5 %: {all:.2?}", all.len());
    assert!(20 * good >= 19 * all.len(), "{all:?}");
}
