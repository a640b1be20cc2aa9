//! People recovered from observed surfaces, against vertex-exact truth.

mod common;

use cager_recover::manifold::{Examples, Kind, Manifold};
use cager_recover::people::{FitOptions, PersonFit, PersonModel, track};
use cager_recover::rig::{PlacementOptions, place};
use common::observe::{errors, poses, seen};
use common::{capture, there};
use std::time::Instant;

#[test]
fn a_walk_is_recovered_from_the_poses_of_its_first_cycle() {
    if !there("makehuman-cmu-walk/rest.obj") {
        return;
    }
    let walk = capture("makehuman-cmu-walk", 1);
    let rig = place(&walk.rest, &PlacementOptions::default()).unwrap().rig;
    let learned = poses(&rig, "02_02", 5..155, 2);
    let manifold = Manifold::learn(&Examples::new(&rig, &learned).unwrap(), Kind::Pca, 10).unwrap();
    let options = FitOptions::default();
    let model = PersonModel::new(&walk.rest, &rig, options.system, options.samples).unwrap();
    let fit = PersonFit { model: &model, manifold: &manifold, options };
    let frames: Vec<usize> = (37..73).step_by(2).collect();
    let observations: Vec<_> = frames.iter().map(|&f| seen(&walk, f, 15_000, 0.0)).collect();
    let mut sums = [0.0; 3];
    let mut worst: f64 = 0.0;
    let mut start = Instant::now();
    let tracked = track(&fit, &observations, false, |number, frame| {
        let truth = &walk.frames[frames[number]];
        let of = |vertices| errors(&model.deformed(vertices), truth, walk.height)[0];
        let now = [of(&frame.fit.stages[0]), of(&frame.fit.stages[1]), of(&frame.fit.vertices)];
        eprintln!(
            "{}: {now:.2?} score {:.3} % {} {:.0} ms",
            frames[number],
            100.0 * frame.fit.score,
            if frame.lost { "lost" } else { "" },
            1e3 * start.elapsed().as_secs_f64()
        );
        (0..3).for_each(|k| sums[k] += now[k] / observations.len() as f64);
        worst = worst.max(now[2]);
        start = Instant::now();
    });
    eprintln!("mean {sums:.3?} worst frame {worst:.2}");
    assert!(tracked.iter().all(|frame| !frame.lost));
    assert!(sums[2] < 0.60, "{sums:?}");
}
