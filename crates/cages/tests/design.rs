//! Cages designed from a motion.

mod common;

use cager_cages::{Components, Design, DesignError, DesignOptions, Goal, Parts, Rates, Style, design, enclose};
use cager_core::cage::Cage;
use cager_core::inversion::{BATCH, Handles, Rows, Solver, SolverOptions};
use cager_geometry::mesh::{Model, TriMesh};
use std::ops::ControlFlow;
use std::time::Duration;

struct Capture {
    rest: Model,
    frames: Vec<Vec<f64>>,
}

/// An arm that bends at two joints: a tube whose points follow the bones around them.
fn capture() -> Capture {
    capture_of(64, 20, 0.0)
}

/// The same of so many rings and points around each; every 53rd point sticks out by a fraction of the radius.
fn capture_of(rings: u32, around: u32, spikes: f64) -> Capture {
    const FRAMES: usize = 24;
    let mut rest = Model::default();
    for i in 0..=rings {
        for k in 0..around {
            let turn = std::f64::consts::TAU * f64::from(k) / f64::from(around);
            let along = f64::from(i) / f64::from(rings);
            let spike = if (i * around + k) % 53 == 7 { 1.0 + spikes } else { 1.0 };
            let radius = spike * (0.12 + 0.03 * (along * 25.6).sin());
            rest.points.push([radius * turn.cos(), radius * turn.sin(), -1.0 + 2.0 * along]);
        }
    }
    for i in 0..rings {
        for k in 0..around {
            let at = |i: u32, k: u32| i * around + k % around;
            rest.faces.push(&[at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)]);
        }
    }
    // Bent at z = ±0.35 about x and y, blended over a tenth.
    let bent = |p: [f64; 3], t: usize| {
        let phase = std::f64::consts::TAU * t as f64 / FRAMES as f64;
        let mut q = p;
        for (joint, axis, angle) in [(0.35, 1, 0.9 * phase.sin()), (-0.35, 0, 0.7 * (phase + 1.0).sin())] {
            let along: f64 = if joint > 0.0 { p[2] - joint } else { joint - p[2] };
            let weight = (0.5 + along / 0.1).clamp(0.0, 1.0);
            let (sin, cos) = (weight * angle * if joint > 0.0 { 1.0 } else { -1.0 }).sin_cos();
            let (u, v) = (q[axis], q[2] - joint);
            q[axis] = cos * u + sin * v;
            q[2] = joint - sin * u + cos * v;
        }
        q
    };
    let frames = (0..FRAMES).map(|t| rest.points.iter().flat_map(|&p| bent(p, t)).collect()).collect();
    Capture { rest, frames }
}

fn designed(capture: &Capture, start: Option<&TriMesh>, options: &DesignOptions) -> Result<Design, DesignError> {
    design(&capture.rest, &capture.frames, start, options, &mut |_| ControlFlow::Continue(()))
}

fn with_vertices(vertices: usize, style: Style) -> DesignOptions {
    DesignOptions { goal: Goal::Vertices(vertices), style, ..DesignOptions::default() }
}

/// Mean L2 error of the encoder with spread handles, as a fraction of the diagonal.
fn encoded(cage: &TriMesh, rest: &Model, frames: &[Vec<f64>]) -> f64 {
    let cage = Cage::new(cage.clone()).unwrap();
    let spectrum = 20.min(cage.vertices().len() / 16);
    let options = SolverOptions { handles: Handles::Spread { count: None }, spectrum, ..SolverOptions::default() };
    let solver = Solver::prepare(&cager_core::coordinates::MeanValue, &cage, &rest.points, options).unwrap();
    let frames: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
    let mut errors = Vec::new();
    for frames in frames.chunks(BATCH) {
        let inverted = solver.invert(Rows::All, None, frames);
        let cages: Vec<&[f32]> = inverted.iter().map(|inverted| inverted.cage.as_slice()).collect();
        errors.extend(solver.decoder().measure(&cages, frames));
    }
    errors.iter().map(|e| e.l2).sum::<f64>() / errors.len() as f64 / solver.diagonal()
}

#[test]
fn a_designed_cage_is_several_times_more_accurate_than_one_of_the_rest_pose_also_on_frames_it_did_not_see() {
    let capture = capture();
    let all: Vec<Vec<f64>> = capture.frames.clone();
    let seen = Capture { rest: capture.rest.clone(), frames: all.iter().step_by(2).cloned().collect() };
    let unseen: Vec<Vec<f64>> = all.into_iter().skip(1).step_by(2).collect();
    let found = designed(&seen, None, &with_vertices(80, Style::Free)).unwrap();
    assert!(found.cage.vertices.len() <= 80);
    let enclosing = enclose(&seen.rest, &cager_cages::EncloseOptions { vertices: 80, ..Default::default() }).unwrap();
    let (before, after) = (encoded(&enclosing, &seen.rest, &unseen), encoded(&found.cage, &seen.rest, &unseen));
    assert!(after < before / 2.0, "{before} {after}");
    // What is reported is what was reached, and it fell.
    let (first, last) = (&found.stages[0], found.stages.last().unwrap());
    assert!(last.validation_error < first.validation_error / 2.0 && last.training_error < first.training_error / 2.0);
    assert!(last.validation_error < 1.5 * last.training_error);
}

#[test]
fn what_is_told_in_the_end_is_measured_where_neither_the_design_nor_its_choice_saw_anything() {
    let mut capture = capture();
    let options = with_vertices(40, Style::Free);
    assert_eq!(designed(&capture, None, &options).unwrap().unseen, None, "too few frames");
    capture.frames = [capture.frames.clone(), capture.frames].concat();
    // A motion that is in the stretches that are held back, and nowhere else.
    let parts = Parts::of(capture.frames.len());
    for frame in parts.unseen.iter().cloned().flatten() {
        let positions = capture.frames[frame].as_chunks_mut::<3>().0;
        positions.iter_mut().zip(&capture.rest.points).for_each(|(p, q)| p[0] += 0.1 * (40.0 * q[2]).sin());
    }
    let found = designed(&capture, None, &options).unwrap();
    let (unseen, last) = (found.unseen.expect("stretches"), found.stages.last().unwrap());
    assert_eq!(unseen.stretches, parts.unseen);
    assert!(unseen.error > 3.0 * last.validation_error, "{unseen:?} {last:?}");
}

#[test]
fn a_cage_for_editing_is_valid_and_far_more_accurate_than_where_it_began() {
    let capture = capture();
    let found = designed(&capture, None, &with_vertices(80, Style::Editable)).unwrap();
    let verdict = common::verdict(&found.cage, &capture.rest);
    assert!(verdict.is_valid(1), "{verdict:?}");
    let (first, last) = (&found.stages[0], found.stages.last().unwrap());
    assert!(last.validation_error < first.validation_error / 1.8, "{first:?} {last:?}");
}

#[test]
fn the_same_seed_gives_the_same_bits_whatever_the_number_of_threads() {
    let capture = capture();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        // A few steps say as much as all.
        let mut calls = 0;
        let options = DesignOptions { seed: 7, ..with_vertices(40, Style::Editable) };
        pool.install(|| {
            design(&capture.rest, &capture.frames, None, &options, &mut |_| {
                calls += 1;
                if calls < 63 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            })
            .unwrap()
            .cage
        })
    };
    let one = with(1);
    assert_eq!(one, with(3));
    assert_ne!(
        one,
        enclose(&capture.rest, &cager_cages::EncloseOptions { vertices: 40, ..Default::default() }).unwrap()
    );
}

#[test]
fn an_error_asked_for_is_met_by_the_encoder_with_no_more_vertices_than_it_takes() {
    let capture = capture();
    let options = |error| DesignOptions { goal: Goal::MeanError(error), ..DesignOptions::default() };
    let (coarse, fine) =
        (designed(&capture, None, &options(0.004)).unwrap(), designed(&capture, None, &options(0.001)).unwrap());
    for (found, error) in [(&coarse, 0.004), (&fine, 0.001)] {
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
        let reached = encoded(&found.cage, &capture.rest, &capture.frames);
        assert!(reached <= 1.1 * error, "{reached} for {error}");
    }
    assert!(coarse.cage.vertices.len() < fine.cage.vertices.len());
    // Nothing reaches this one, and it is said.
    let none =
        designed(&capture, None, &DesignOptions { time_limit: Some(Duration::from_secs(3)), ..options(1e-9) }).unwrap();
    assert!(none.warnings.iter().any(|w| w.contains("was not reached")), "{:?}", none.warnings);
}

#[test]
fn an_artists_cage_keeps_its_faces_and_its_symmetry() {
    let capture = capture();
    // A box with a vertex in the middle of each edge and face, symmetric across x.
    let start = symmetric_box(&capture.rest);
    let options = DesignOptions {
        keep_connectivity: true,
        symmetry: Some(0),
        style: Style::Editable,
        time_limit: Some(Duration::from_secs(10)),
        ..DesignOptions::default()
    };
    let found = designed(&capture, Some(&start), &options).unwrap();
    assert_eq!(found.cage.triangles, start.triangles);
    assert_ne!(found.cage.vertices, start.vertices);
    assert!(found.stages.last().unwrap().validation_error < found.stages[0].validation_error);
    let middle = start.vertices.iter().map(|v| v[0]).sum::<f64>() / start.vertices.len() as f64;
    for v in &found.cage.vertices {
        let image = [2.0 * middle - v[0], v[1], v[2]];
        let nearest = found.cage.vertices.iter().map(|w| (0..3).map(|k| (w[k] - image[k]).powi(2)).sum::<f64>());
        assert!(nearest.fold(f64::INFINITY, f64::min).sqrt() < 1e-9, "{v:?}");
    }
    let mut skewed = start.clone();
    skewed.vertices[0][0] -= 0.3;
    let error = designed(&capture, Some(&skewed), &options).unwrap_err();
    assert!(matches!(error, DesignError::NotSymmetric { axis: 0, .. }), "{error}");
}

/// The bounding box of a model, twice subdivided.
fn symmetric_box(model: &Model) -> TriMesh {
    let (low, high) = cager_geometry::mesh::bounds(&model.points);
    let at = |c: [usize; 3]| -> [f64; 3] {
        std::array::from_fn(|k| low[k] + (high[k] - low[k]) * (c[k] as f64 / 2.0 * 1.2 - 0.1))
    };
    let mut mesh = TriMesh::default();
    let mut index = std::collections::BTreeMap::new();
    let mut vertex = |c: [usize; 3], mesh: &mut TriMesh| {
        *index.entry(c).or_insert_with(|| {
            mesh.vertices.push(at(c));
            mesh.vertices.len() as u32 - 1
        })
    };
    for axis in 0..3 {
        for side in [0, 2] {
            for i in 0..2 {
                for j in 0..2 {
                    let corner = |a: usize, b: usize| {
                        let mut c = [0; 3];
                        c[axis] = side;
                        c[(axis + 1) % 3] = i + a;
                        c[(axis + 2) % 3] = j + b;
                        c
                    };
                    let mut q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].map(|c| vertex(c, &mut mesh));
                    if side == 0 {
                        q.reverse();
                    }
                    mesh.triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
                }
            }
        }
    }
    mesh
}

#[test]
fn the_watcher_hears_of_the_first_cage_and_may_stop_and_the_time_limit_holds() {
    let capture = capture();
    let mut first = None;
    let found = design(&capture.rest, &capture.frames, None, &with_vertices(60, Style::Free), &mut |now| {
        first = first.take().or_else(|| now.better.cloned());
        if first.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(Some(found.unwrap().cage), first);
    let stopped =
        design(&capture.rest, &capture.frames, None, &with_vertices(60, Style::Free), &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(DesignError::Stopped));
    let limit = DesignOptions { time_limit: Some(Duration::from_millis(1)), ..with_vertices(60, Style::Free) };
    // It hears of every step; a whole design takes 190.
    let mut steps = 0;
    let cut = design(&capture.rest, &capture.frames, None, &limit, &mut |now| {
        steps += usize::from(now.stage == "moving the vertices");
        ControlFlow::Continue(())
    });
    assert!(cut.unwrap().timed_out && steps < 5, "{steps}");
}

#[test]
fn what_no_cage_can_be_designed_from_is_said() {
    let Capture { rest, frames } = capture();
    let message = |rest: &Model, frames: &[Vec<f64>], goal: Goal| {
        let options = DesignOptions { goal, ..DesignOptions::default() };
        design(rest, frames, None, &options, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
    };
    let usual = Goal::Vertices(50);
    assert!(message(&rest, &[], usual).contains("no frames"));
    let mut short = frames[..2].to_vec();
    short[1].truncate(30);
    assert!(message(&rest, &short, usual).contains("frame 1 has 10 points where the rest pose has"));
    let mut broken = frames[..2].to_vec();
    broken[0][32] = f64::NAN;
    assert!(message(&rest, &broken, usual).contains("frame 0: point 10"));
    assert!(message(&rest, &frames, Goal::MeanError(0.0)).contains("above 0"));
    assert!(message(&rest, &frames, Goal::MeanError(f64::NAN)).contains("above 0"));
    let empty = Model::default();
    assert!(message(&empty, &[Vec::new()], usual).contains("no points"));
    let open = TriMesh { vertices: rest.points[..4].to_vec(), triangles: vec![[0, 1, 2]; 4] };
    let error = design(&rest, &frames, Some(&open), &DesignOptions::default(), &mut |_| ControlFlow::Continue(()));
    assert!(matches!(error, Err(DesignError::Start(_))));
}

#[test]
fn motion_that_tears_the_model_apart_and_a_model_that_does_not_move_still_give_a_cage() {
    let Capture { rest, frames } = capture();
    let torn: Vec<Vec<f64>> = frames
        .iter()
        .enumerate()
        .map(|(t, frame)| {
            frame.iter().enumerate().map(|(i, x)| x + 10.0 * (((i * 7919 + t * 31) % 13) as f64)).collect()
        })
        .collect();
    let still: Vec<Vec<f64>> = vec![rest.points.iter().flatten().copied().collect(); 3];
    for (frames, warned) in [(torn, true), (still, false)] {
        let limit = DesignOptions { time_limit: Some(Duration::from_secs(2)), ..with_vertices(60, Style::Editable) };
        let found = designed(&Capture { rest: rest.clone(), frames }, None, &limit).unwrap();
        let verdict = common::verdict(&found.cage, &rest);
        assert!(verdict.is_valid(1), "{verdict:?}");
        assert_eq!(found.warnings.iter().any(|w| w.contains("tear the model apart")), warned, "{:?}", found.warnings);
    }
}

#[test]
fn a_stop_is_heard_while_the_rest_pose_is_enclosed() {
    let capture = capture();
    let mut asked = 0;
    let stopped = design(&capture.rest, &capture.frames, None, &DesignOptions::default(), &mut |progress| {
        assert_eq!(progress.stage, "enclosing the rest pose");
        asked += 1;
        if asked > 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(DesignError::Stopped)), "{stopped:?}");
}

#[test]
fn of_a_large_model_all_points_stay_inside_a_cage_for_editing_spikes_among_them() {
    let capture = capture_of(420, 90, 0.04);
    assert!(capture.rest.points.len() > 35_000);
    let enclosing =
        enclose(&capture.rest, &cager_cages::EncloseOptions { vertices: 80, ..Default::default() }).unwrap();
    assert!(common::verdict(&enclosing, &capture.rest).is_valid(1));
    let found = designed(&capture, None, &with_vertices(80, Style::Editable)).unwrap();
    let verdict = common::verdict(&found.cage, &capture.rest);
    assert!(verdict.is_valid(1), "{verdict:?}");
    let (first, last) = (&found.stages[0], found.stages.last().unwrap());
    assert!(last.validation_error < first.validation_error / 1.6, "{first:?} {last:?}");
}

/// The arm, and a copy of it beside it that moves away along x.
fn two_arms() -> (Capture, [std::ops::Range<usize>; 2]) {
    let mut both = capture_of(16, 10, 0.0);
    let count = both.rest.points.len();
    let aside = |p: [f64; 3], x: f64| [p[0] + 0.4 + x, p[1], p[2]];
    let second: Vec<[f64; 3]> = both.rest.points.iter().map(|&p| aside(p, 0.0)).collect();
    both.rest.points.extend(second);
    let faces: Vec<Vec<u32>> =
        both.rest.faces.iter().map(|face| face.iter().map(|v| v + count as u32).collect()).collect();
    faces.iter().for_each(|face| both.rest.faces.push(face));
    for (t, frame) in both.frames.iter_mut().enumerate() {
        let moved: Vec<[f64; 3]> = frame.as_chunks().0.iter().map(|&p| aside(p, 0.2 * t as f64)).collect();
        frame.extend(moved.as_flattened());
    }
    (both, [0..count, count..2 * count])
}

#[test]
fn parts_that_move_apart_get_components_that_follow_them_better() {
    let (Capture { rest, frames }, parts) = two_arms();
    let components = Components::by_motion(&rest, &frames, &parts, 60).expect("components");
    assert_eq!(components.len(), 2);
    let options = DesignOptions { goal: Goal::Vertices(60), ..DesignOptions::default() };
    let go_on = &mut |_: cager_cages::Progress<'_>| ControlFlow::Continue(());
    let found = components.design(&rest, &frames, &options, go_on).unwrap();
    let one = design(&rest, &frames, None, &options, go_on).unwrap();
    let error = |design: &Design| design.stages.last().unwrap().validation_error;
    assert!(error(&found) < 0.5 * error(&one), "{} {}", error(&found), error(&one));
    let cage = found.into_cage().unwrap();
    assert!(cage.vertices().len() <= 60 && cage.carries(rest.points.len()));
    let carried: Vec<_> = cage.carriers().iter().map(|carrier| carrier.points.clone()).collect();
    let half = parts[1].start as u32;
    assert_eq!(carried, [0..half, half..2 * half]);
    // The same again, whatever the threads.
    let again = components.design(&rest, &frames, &options, go_on).unwrap().into_cage().unwrap();
    assert_eq!(again.mesh(), cage.mesh());
}

#[test]
fn parts_that_move_together_share_one_cage_unless_each_is_to_have_its_own() {
    let Capture { rest, frames } = capture_of(16, 10, 0.0);
    let count = rest.points.len();
    let halves = [0..count / 2, count / 2..count];
    assert!(Components::by_motion(&rest, &frames, &halves, 60).is_none());
    assert!(Components::by_motion(&rest, &frames, &halves[..1], 60).is_none());
    assert!(Components::by_motion(&rest, &[], &halves, 60).is_none());
    let (Capture { rest, frames }, parts) = two_arms();
    let each = Components::of_each(&rest, &frames, &parts);
    assert_eq!((each.len(), each.least_vertices()), (2, 16));
    let go_on = &mut |_: cager_cages::Progress<'_>| ControlFlow::Continue(());
    let error = each.design(&rest, &frames, &with_vertices(15, Style::Free), go_on).expect_err("too few").to_string();
    assert!(error.contains("ask for at least 16"), "{error}");
}

#[test]
fn smaller_errors_and_larger_files_suit_cages_of_more_vertices_whatever_the_threads() {
    let Capture { rest, frames } = capture_of(40, 30, 0.0);
    let total = 10 * frames.len();
    let rates = || Rates::new(&rest, &frames, total).unwrap();
    let vertices = |error: f64| rates().suited(error).vertices;
    let [coarse, fine] = [0.05, 1e-4].map(vertices);
    assert!((80..500).contains(&coarse) && coarse < fine && fine <= 500, "{coarse} {fine}");
    let [small, large] = [1e2, 1e6].map(|bytes| rates().suited_to_bytes(bytes).vertices);
    assert!(small <= large, "{small} {large}");
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(single.install(|| rates().suited(1e-3)), rates().suited(1e-3));
    // What does not move needs no more than the fewest.
    let still = vec![rest.points.as_flattened().to_vec(); 8];
    assert_eq!(Rates::new(&rest, &still, 8).unwrap().suited(1e-4).vertices, 80);
}

#[test]
fn cages_with_components_suit_what_all_their_parts_take() {
    let (Capture { rest, frames }, parts) = two_arms();
    let each = Components::of_each(&rest, &frames, &parts);
    let of_both = each.rates(&frames, frames.len()).unwrap().suited(1e-3);
    let one = Rates::new(&rest, &frames, frames.len()).unwrap().suited(1e-3);
    // One cage for both leaves more, since one moves away from the other.
    assert!(0.0 < of_both.residual && of_both.residual < one.residual, "{of_both:?} {one:?}");
}

#[test]
fn parts_in_one_place_share_the_component_of_the_nearest_part() {
    let (Capture { mut rest, mut frames }, [first, second]) = two_arms();
    let (count, place) = (rest.points.len(), rest.points[second.start]);
    rest.points.extend([place; 3]);
    for frame in &mut frames {
        let at: Vec<f64> = frame[3 * second.start..3 * second.start + 3].to_vec();
        frame.extend(at.repeat(3));
    }
    let parts = [first, second, count..count + 3];
    let each = Components::of_each(&rest, &frames, &parts);
    assert_eq!((each.len(), each.least_vertices()), (2, 16));
    let go_on = &mut |_: cager_cages::Progress<'_>| ControlFlow::Continue(());
    let options = with_vertices(40, Style::Free);
    let cage = each.design(&rest, &frames, &options, go_on).unwrap().into_cage().unwrap();
    let [arm, other, locator] = cage.carriers() else { panic!("{:?}", cage.carriers()) };
    assert!(cage.carries(count + 3) && arm.vertices != other.vertices && locator.vertices == other.vertices);
    assert_eq!(Components::by_motion(&rest, &frames, &parts, 60).expect("components").len(), 2);
    // Nothing is left to join.
    let flat = Components::of_each(&rest, &frames, &parts[2..]);
    assert!(flat.rates(&frames, frames.len()).is_err_and(|error| error == cager_cages::EncloseError::NoExtent));
}
