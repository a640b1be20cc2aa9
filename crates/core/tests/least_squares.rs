//! Least squares over all points with a term over the whole spectrum, by normal equations and by singular directions.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_core::inversion::{Handles, PrepareContext, Rows, Solver, SolverOptions};
use cager_core::regularize::Regularizer;
use cager_core::spectral::Analysis;
use cager_demo::{Capture, Options};
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::{Point, TriMesh};
use common::Cages;

const FRAMES: usize = 20;

fn capture() -> (Capture, Cage, Vec<Vec<f64>>) {
    let capture = Capture::new(&Options { points: 900, frames: FRAMES, cage_vertices: 60 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    let frames = (0..FRAMES).map(|t| frame(&capture, t)).collect();
    (capture, cage, frames)
}

fn frame(capture: &Capture, t: usize) -> Vec<f64> {
    let mut frame = Vec::new();
    capture.frame(t, &mut frame);
    frame
}

fn views(frames: &[Vec<f64>]) -> Vec<&[f64]> {
    frames.iter().map(Vec::as_slice).collect()
}

fn options(unknowns: usize) -> SolverOptions {
    SolverOptions { handles: Handles::All, spectrum: unknowns, lambda: 1e-3, ..SolverOptions::default() }
}

/// Largest difference over the diagonal.
fn apart(a: &[Vec<f32>], b: &[Vec<f32>], diagonal: f64) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max) / diagonal
}

/// By singular directions, which an analysis computes for any options.
fn by_directions(system: &dyn CoordinateSystem, cage: &Cage, points: &[Point], options: SolverOptions) -> Solver {
    Analysis::new(system, cage, points, &PrepareContext::default()).unwrap().solver(options).unwrap()
}

#[test]
fn normal_equations_give_the_cages_of_singular_directions() {
    let (capture, cage, frames) = capture();
    let points = &capture.rest.points;
    let systems: [&dyn CoordinateSystem; 2] = [&MeanValue, &Green::Free];
    for system in systems {
        let usual = options(system.values(&cage).unknowns());
        let terms = [Regularizer::Differential, Regularizer::Laplacian, Regularizer::Temporal, Regularizer::Global];
        for (regularizer, lambda) in terms.into_iter().flat_map(|r| [1e-3, 1.0].map(|lambda| (r, lambda))) {
            let options = SolverOptions { regularizer, lambda, ..usual };
            let solver = Solver::prepare(system, &cage, points, options).unwrap();
            let wanted = by_directions(system, &cage, points, options);
            assert!(solver.handles().is_empty() && solver.reads_all(), "no handles are chosen");
            let off = apart(&solver.cages(&views(&frames)), &wanted.cages(&views(&frames)), solver.diagonal());
            assert!(off < 1e-7, "{} {}: {off:e}", system.name(), regularizer.name());
            let (found, wanted) = (solver.preparation(), wanted.preparation());
            assert_eq!(found.rank, wanted.rank);
            let (a, b) = (found.condition_full, wanted.condition_full);
            assert!((a / b - 1.0).abs() < 1e-6, "{}: {a} {b}", system.name());
        }
    }
}

#[test]
fn a_matrix_of_the_users_own_is_followed() {
    let (capture, cage, frames) = capture();
    let m = cage.vertices().len();
    let rows = (0..m as u32).flat_map(|i| [(i, i, 1.0), (i, (i + 1) % m as u32, -1.0)]);
    let entries = rows.collect();
    let matrix = SparseMatrix::new(m, m, entries).unwrap();
    let options = SolverOptions { regularizer: Regularizer::Matrix, ..options(m) };
    let context = PrepareContext { matrix: Some(&matrix), ..PrepareContext::default() };
    let solver = Solver::prepare_with(&MeanValue, &cage, &capture.rest.points, options, &context).unwrap();
    let analysis = Analysis::new(&MeanValue, &cage, &capture.rest.points, &context).unwrap();
    let wanted = analysis.handle_system(Handles::All).unwrap().solver(options, Some(&matrix)).unwrap();
    let off = apart(&solver.cages(&views(&frames)), &wanted.cages(&views(&frames)), solver.diagonal());
    assert!(off < 1e-7, "{off:e}");
}

/// A cage with one part that no point determines, as the same points twice do not either.
#[test]
fn what_the_points_leave_open_is_placed_as_by_singular_directions() {
    let (capture, _, frames) = capture();
    let mut mesh: TriMesh = capture.cage.clone();
    // Vertices of their own around the centre of a face, again and again: the last ones move nothing.
    for _ in 0..14 {
        let [a, b, c] = mesh.triangles[0];
        let center = mesh.vertices.len() as u32;
        let middle = [a, b, c].map(|v| mesh.vertices[v as usize]);
        mesh.vertices.push([0, 1, 2].map(|k| middle.iter().map(|p| p[k]).sum::<f64>() / 3.0));
        mesh.triangles[0] = [a, b, center];
        mesh.triangles.extend([[b, c, center], [c, a, center]]);
    }
    let cage = Cage::new(mesh).unwrap();
    let options = options(cage.vertices().len());
    let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
    let wanted = by_directions(&MeanValue, &cage, &capture.rest.points, options);
    let off = apart(&solver.cages(&views(&frames)), &wanted.cages(&views(&frames)), solver.diagonal());
    assert!(off < 1e-6, "{off:e}");
    let (found, wanted) = (solver.preparation(), wanted.preparation());
    assert!(wanted.weak > 0 && found.weak.abs_diff(wanted.weak) <= 1, "{} {}", found.weak, wanted.weak);
    assert!(found.rank >= cage.vertices().len() - found.weak, "{}", found.rank);
}

#[test]
fn points_that_coincide_count_as_often_as_they_are_there() {
    let (capture, cage, frames) = capture();
    let twice = |flat: &[f64]| [flat, flat].concat();
    let points: Vec<Point> = capture.rest.points.repeat(2);
    let options = options(cage.vertices().len());
    let once = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
    let both = Solver::prepare(&MeanValue, &cage, &points, options).unwrap();
    let doubled: Vec<Vec<f64>> = frames.iter().map(|frame| twice(frame)).collect();
    let off = apart(&once.cages(&views(&frames)), &both.cages(&views(&doubled)), once.diagonal());
    assert!(off < 1e-7, "{off:e}");
}

#[test]
fn no_weight_is_no_term() {
    let (capture, cage, frames) = capture();
    let m = cage.vertices().len();
    let with = |options| {
        let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
        (solver.cages(&views(&frames)), solver.diagonal())
    };
    let (none, diagonal) = with(SolverOptions { lambda: 0.0, ..options(m) });
    let (plain, _) = with(SolverOptions { regularizer: Regularizer::None, ..options(m) });
    assert_eq!(none, plain);
    // And as little weight as can be is next to none.
    let (least, _) = with(SolverOptions { lambda: 1e-12, ..options(m) });
    assert!(apart(&least, &plain, diagonal) < 1e-5);
}

#[test]
fn cages_follow_translations_exactly_far_from_the_origin_too() {
    let (capture, cage, frames) = capture();
    let options = options(cage.vertices().len());
    let far = |p: [f64; 3]| p.map(|x| x + 4096.0);
    let moved = TriMesh { vertices: cage.vertices().iter().map(|&p| far(p)).collect(), ..cage.mesh().clone() };
    let moved_cage = Cage::new(moved).unwrap();
    let points: Vec<Point> = capture.rest.points.iter().map(|&p| far(p)).collect();
    let near = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
    let there = Solver::prepare(&MeanValue, &moved_cage, &points, options).unwrap();
    let shifted: Vec<Vec<f64>> = frames.iter().map(|frame| frame.iter().map(|x| x + 4096.0).collect()).collect();
    for solver in [&near, &there] {
        let [here, far] = [&frames, &shifted].map(|frames| solver.cages(&views(frames)));
        let back: Vec<Vec<f32>> = far.iter().map(|cage| cage.iter().map(|x| x - 4096.0).collect()).collect();
        let off = apart(&here, &back, near.diagonal());
        // The resolution of single precision there.
        assert!(off * near.diagonal() < 5e-4, "{off:e}");
    }
}

#[test]
fn the_threads_make_no_difference_and_any_number_of_frames_is_taken() {
    let (capture, cage, frames) = capture();
    let options = options(cage.vertices().len());
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap())
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.operator(), three.operator());
    assert_eq!(one.preparation().condition_full.to_bits(), three.preparation().condition_full.to_bits());
    let together = one.cages(&views(&frames));
    let single: Vec<Vec<f32>> = frames.iter().flat_map(|frame| one.cages(&[frame.as_slice()])).collect();
    assert_eq!(together, single);
    let cages: Vec<&[f32]> = together.iter().map(Vec::as_slice).collect();
    let mut decoded = vec![Vec::new(); FRAMES];
    one.decoder().decode(&cages, &mut decoded);
    let errors = one.decoder().measure(&cages, &views(&frames));
    for (f, cage) in cages.iter().enumerate() {
        let mut alone = [Vec::new()];
        one.decoder().decode(&[cage], &mut alone);
        assert_eq!(alone[0], decoded[f]);
        assert_eq!(one.decoder().measure(&[cage], &[frames[f].as_slice()])[0], errors[f]);
    }
}

#[test]
fn previous_cages_are_followed_across_batches() {
    let (capture, cage, frames) = capture();
    let options = SolverOptions { regularizer: Regularizer::Temporal, lambda: 0.1, ..options(cage.vertices().len()) };
    let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
    let together = solver.cages(&views(&frames));
    let mut previous: Option<Vec<f32>> = None;
    for (frame, cage) in frames.iter().zip(&together) {
        let found = solver.invert(Rows::All, previous.as_deref(), &[frame.as_slice()]).remove(0).cage;
        assert_eq!(&found, cage);
        previous = Some(found);
    }
}

#[test]
fn a_sample_of_a_very_large_model_stands_for_all_its_points() {
    let (capture, cage, frames) = capture();
    let options = options(cage.vertices().len());
    let context = PrepareContext { analysed_entries: 1, ..PrepareContext::default() };
    let solver = Solver::prepare_with(&MeanValue, &cage, &capture.rest.points, options, &context).unwrap();
    assert!(!solver.reads_all() && solver.handles().len() < capture.rest.points.len());
    let all = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
    let off = apart(&solver.cages(&views(&frames)), &all.cages(&views(&frames)), all.diagonal());
    assert!(off < 2e-2, "{off:e}");
    let read: Vec<f64> = solver.handles().iter().flat_map(|&i| frames[3][3 * i as usize..][..3].to_vec()).collect();
    assert_eq!(solver.cages_of_handles(None, &[&read]), solver.cages(&[&frames[3]]));
}
