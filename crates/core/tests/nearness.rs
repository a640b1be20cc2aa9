//! Cages stay near their frames, also where the points hardly determine them.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_core::inversion::{BATCH, Handles, Rows, Solver, SolverOptions};
use cager_core::regularize::Regularizer;
use cager_demo::{Capture, Options};
use cager_geometry::mesh::{Point, TriMesh, bounds, diagonal};
use cager_geometry::vector::{centroid, distance};
use common::Cages;

const FRAMES: usize = 8;

fn capture() -> Capture {
    Capture::new(&Options { points: 600, frames: FRAMES, cage_vertices: 60 })
}

/// The capture's cage with one face divided again and again around its centre: vertices of their own that hardly move the model.
fn weak_cage(capture: &Capture) -> Cage {
    let mut mesh: TriMesh = capture.cage.clone();
    for _ in 0..12 {
        let [a, b, c] = mesh.triangles[0];
        let center = mesh.vertices.len() as u32;
        mesh.vertices.push(centroid([a, b, c].map(|v| mesh.vertices[v as usize])));
        mesh.triangles[0] = [a, b, center];
        mesh.triangles.extend([[b, c, center], [c, a, center]]);
    }
    Cage::new(mesh).unwrap()
}

/// Frames that no cage can follow: the points tremble by a twentieth of the diagonal.
fn trembling(capture: &Capture) -> Vec<Vec<f64>> {
    let size = 0.05 * diagonal(&capture.rest.points);
    let mut state = 7_u64;
    let mut tremble = |x: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        x + size * ((state >> 33) as f64 / (1_u64 << 30) as f64 - 1.0)
    };
    let mut frame = Vec::new();
    (0..FRAMES)
        .map(|t| {
            capture.frame(t, &mut frame);
            frame.iter().map(|&x| tremble(x)).collect()
        })
        .collect()
}

/// Without what keeps its cages near.
fn let_go(solver: &Solver) -> Solver {
    solver.clone().without_nearness()
}

/// How many diagonals a frame's cage is away from it, at the most, beyond what the rest cage is.
fn away(solver: &Solver, capture: &Capture, cage: &Cage, frames: &[Vec<f64>]) -> f64 {
    let points = |flat: &[f64]| -> Vec<Point> { flat.as_chunks().0.to_vec() };
    let beyond = |vertices: &[Point], points: &[Point]| {
        let (low, high) = bounds(points);
        let outside = |p: &Point| distance(*p, [0, 1, 2].map(|k| p[k].clamp(low[k], high[k])));
        vertices.iter().map(outside).fold(0.0, f64::max)
    };
    let margin = beyond(cage.vertices(), &capture.rest.points);
    let mut worst = 0.0_f64;
    let mut previous: Option<Vec<f32>> = None;
    for batch in frames.chunks(BATCH) {
        let views: Vec<&[f64]> = batch.iter().map(Vec::as_slice).collect();
        let cages = solver.cages_after(previous.as_deref(), &views);
        for (found, frame) in cages.iter().zip(batch) {
            let vertices: Vec<Point> =
                found.as_chunks::<3>().0[..cage.vertices().len()].iter().map(|v| v.map(f64::from)).collect();
            let unit = diagonal(&capture.rest.points).max(diagonal(&points(frame)));
            worst = worst.max((beyond(&vertices, &points(frame)) - margin) / unit);
        }
        previous = cages.last().cloned();
    }
    worst
}

#[test]
fn no_cage_runs_away_from_its_frame() {
    let capture = capture();
    let (cage, frames) = (weak_cage(&capture), trembling(&capture));
    let systems: [&dyn CoordinateSystem; 3] = [&MeanValue, &Green::Free, &Green::Consistent];
    for system in systems {
        for handles in [Handles::default(), Handles::MaxVol, Handles::All] {
            for regularizer in [Regularizer::Differential, Regularizer::Laplacian, Regularizer::Temporal] {
                let usual = SolverOptions::for_unknowns(system.values(&cage).unknowns());
                let options = SolverOptions { handles, regularizer, ..usual };
                let solver = Solver::prepare(system, &cage, &capture.rest.points, options).unwrap();
                let far = away(&let_go(&solver), &capture, &cage, &frames);
                let near = away(&solver, &capture, &cage, &frames);
                let what = format!("{} {} {}: {far} {near}", system.name(), handles.name(), regularizer.name());
                assert!(far > 10.0, "nothing to hold: {what}");
                assert!(near <= 1.25 + 1e-6, "{what}");
            }
        }
    }
}

#[test]
fn cages_that_stay_near_anyway_keep_their_bits() {
    let capture = capture();
    let cage = Cage::new(capture.cage.clone()).unwrap();
    let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, SolverOptions::for_unknowns(60)).unwrap();
    let mut frame = Vec::new();
    for t in 0..FRAMES {
        capture.frame(t, &mut frame);
        assert_eq!(solver.cages(&[&frame]), let_go(&solver).cages(&[&frame]));
    }
}

#[test]
fn a_held_cage_follows_its_frame_and_is_the_same_however_it_is_solved_for() {
    let capture = capture();
    let (cage, frames) = (weak_cage(&capture), trembling(&capture));
    let options = SolverOptions::for_unknowns(cage.vertices().len());
    let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
    let views: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
    let solved = solver.invert(Rows::All, None, &views);
    assert!(solved.iter().any(|frame| frame.held));
    let together: Vec<Vec<f32>> = solved.into_iter().map(|frame| frame.cage).collect();
    let read = |frame: &[f64]| -> Vec<f64> {
        solver.handles().iter().flat_map(|&i| frame[3 * i as usize..][..3].to_vec()).collect()
    };
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        // A solver of its own, whose first frame this is.
        let again = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
        for (frame, cage) in frames.iter().zip(&together) {
            pool.install(|| {
                assert_eq!(again.cages(&[frame]), [cage.as_slice()]);
                assert_eq!(again.cages_of_handles(None, &[&read(frame)]), [cage.as_slice()]);
            });
        }
    }
    let moved: Vec<f64> = frames[3].iter().map(|x| x + 64.0).collect();
    let there = solver.cages(&[&moved]).concat();
    let shifted = together[3].iter().zip(there).map(|(a, b)| (a + 64.0 - b).abs()).fold(0.0, f32::max);
    assert!(shifted < 1e-3 * solver.diagonal() as f32, "{shifted}");
    // About as accurate as the cage that ran away.
    let error = |solver: &Solver| {
        let cages = solver.cages(&views);
        let cages: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        solver.decoder().measure(&cages, &views).iter().map(|error| error.l2).sum::<f64>()
    };
    assert!(error(&solver) < 1.1 * error(&let_go(&solver)), "{} {}", error(&solver), error(&let_go(&solver)));
}
