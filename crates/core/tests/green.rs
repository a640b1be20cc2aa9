//! Green coordinates through solver and decoder: with normals that follow from the cage's vertices, and with free ones.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_core::decode::Decoder;
use cager_core::inversion::{BATCH, DependentParts, Handles, Outcome, Rows, Solver, SolverOptions, SolverParts};
use cager_core::regularize::Regularizer;
use cager_demo::{Capture, Options};
use cager_geometry::mesh::Point;
use common::Cages;

const HANDLES: [Handles; 4] =
    [Handles::MaxVol, Handles::Rectangular { count: None }, Handles::Spread { count: None }, Handles::All];

fn capture() -> (Capture, Cage) {
    let capture = Capture::new(&Options { points: 2_000, frames: 40, cage_vertices: 100 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    (capture, cage)
}

fn prepare(capture: &Capture, cage: &Cage, options: SolverOptions) -> Solver {
    Solver::prepare(&Green::Consistent, cage, &capture.rest.points, options).unwrap()
}

fn frame(capture: &Capture, t: usize) -> Vec<f64> {
    let mut out = Vec::new();
    capture.frame(t, &mut out);
    out
}

fn single(points: &[Point]) -> Vec<f32> {
    points.iter().flatten().map(|&x| x as f32).collect()
}

fn farthest(cage: &[f32], truth: &[Point]) -> f64 {
    let apart = |(a, b): (&[f32], &Point)| (0..3).map(|k| (f64::from(a[k]) - b[k]).powi(2)).sum::<f64>().sqrt();
    cage.chunks_exact(3).zip(truth).map(apart).fold(0.0, f64::max)
}

#[test]
fn a_cage_has_one_row_per_vertex_and_the_coordinates_one_column_more_per_face() {
    let (capture, cage) = capture();
    let solver = prepare(&capture, &cage, SolverOptions::PAPER);
    let (v, f) = (cage.vertices().len(), cage.faces().len());
    assert_eq!((solver.decoder().unknowns(), solver.decoder().columns()), (v, v + f));
    assert_eq!(solver.handles().len(), v);
    let free = Solver::prepare(&Green::Free, &cage, &capture.rest.points, SolverOptions::PAPER).unwrap();
    assert_eq!((free.decoder().unknowns(), free.decoder().columns()), (v + f, v + f));
}

#[test]
fn similar_poses_of_the_rest_cage_pose_the_model_alike_and_come_back() {
    let (capture, cage) = capture();
    let motion = |p: Point| {
        let (s, c) = 0.7f64.sin_cos();
        [2.0 * (c * p[0] - s * p[1]) + 30.0, 2.0 * (s * p[0] + c * p[1]) - 5.0, 2.0 * p[2]]
    };
    let positions: Vec<f64> = capture.rest.points.iter().flat_map(|&p| motion(p)).collect();
    let truth: Vec<Point> = cage.vertices().iter().map(|&p| motion(p)).collect();
    for handles in HANDLES {
        let solver = prepare(&capture, &cage, SolverOptions { handles, spectrum: 0, ..SolverOptions::PAPER });
        let posed = solver.decoder().measure(&[&single(&truth)], &[&positions])[0];
        assert!(posed.linf < 1e-5 * solver.diagonal(), "{handles:?}: {}", posed.linf);
        let found = solver.invert(Rows::All, None, &[&positions]).remove(0);
        assert!(farthest(&found.cage, &truth) < 1e-4 * solver.diagonal(), "{handles:?}");
        assert_eq!(found.convergence.unwrap().outcome, Outcome::Converged);
    }
}

#[test]
fn models_posed_by_a_cage_are_explained_by_one() {
    let (capture, cage) = capture();
    for handles in [Handles::MaxVol, Handles::All] {
        let options = SolverOptions { handles, lambda: 1e-6, spectrum: 0, ..SolverOptions::PAPER };
        let solver = prepare(&capture, &cage, options);
        for t in [0, 13, 39] {
            let mut posed = vec![Vec::new()];
            solver.decoder().decode(&[&single(&capture.deformed_cage(t))], &mut posed);
            let found = solver.invert(Rows::All, None, &[&posed[0]]).remove(0);
            let convergence = found.convergence.unwrap();
            let error = solver.decoder().measure(&[&found.cage], &[&posed[0]])[0].l2 / solver.diagonal();
            assert!(error < 1e-3, "{handles:?}, frame {t}: {error:e} {convergence:?}");
            assert!(convergence.residual < 0.15 * convergence.start, "{handles:?}, frame {t}: {convergence:?}");
        }
    }
}

#[test]
fn the_points_read_are_never_worse_than_where_the_iteration_starts() {
    let (capture, cage) = capture();
    for handles in HANDLES {
        for regularizer in [Regularizer::Laplacian, Regularizer::Temporal, Regularizer::None, Regularizer::Tikhonov] {
            let options = SolverOptions { handles, regularizer, ..SolverOptions::PAPER };
            let solver = prepare(&capture, &cage, options);
            let frames: Vec<Vec<f64>> = [5, 20, 35].map(|t| frame(&capture, t)).to_vec();
            let views: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
            for found in solver.invert(Rows::All, None, &views) {
                let convergence = found.convergence.unwrap();
                assert!(convergence.residual <= convergence.start, "{handles:?} {regularizer:?}: {convergence:?}");
                assert!(convergence.steps > 0 || convergence.outcome != Outcome::StepLimit);
            }
        }
    }
}

#[test]
fn the_iteration_lowers_the_error_of_the_linear_start() {
    let (capture, cage) = capture();
    let start = Solver::prepare(&MeanValue, &cage, &capture.rest.points, SolverOptions::PAPER).unwrap();
    let solver = prepare(&capture, &cage, SolverOptions::PAPER);
    for t in [7, 21, 33] {
        let positions = frame(&capture, t);
        let error = |cage: &[f32]| solver.decoder().measure(&[cage], &[&positions])[0].l2;
        let (before, after) = (error(&start.cages(&[&positions])[0]), error(&solver.cages(&[&positions])[0]));
        assert!(after < 0.9 * before, "frame {t}: {after} {before}");
    }
}

#[test]
fn bits_depend_on_the_frame_alone() {
    let (capture, cage) = capture();
    for handles in [Handles::MaxVol, Handles::All] {
        let solver = prepare(&capture, &cage, SolverOptions { handles, ..SolverOptions::PAPER });
        let frames: Vec<Vec<f64>> = (0..BATCH).map(|t| frame(&capture, 2 * t)).collect();
        let views: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let together = solver.cages(&views);
        for count in [1, 3, 5, 9] {
            assert_eq!(solver.cages(&views[..count]), together[..count], "{handles:?}: {count} frames");
        }
        let mut turned = views.clone();
        turned.reverse();
        let mut back = solver.cages(&turned);
        back.reverse();
        assert_eq!(back, together, "{handles:?}: in another order");
        if handles == Handles::MaxVol {
            let rows = |frame: &&[f64]| -> Vec<f64> {
                solver.handles().iter().flat_map(|&h| frame[3 * h as usize..][..3].to_vec()).collect()
            };
            let read: Vec<Vec<f64>> = views.iter().map(rows).collect();
            let read: Vec<&[f64]> = read.iter().map(Vec::as_slice).collect();
            assert_eq!(solver.cages_of_handles(None, &read), together);
        }
        let threads = |count| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
            pool.install(|| prepare(&capture, &cage, SolverOptions { handles, ..SolverOptions::PAPER }).cages(&views))
        };
        assert_eq!(threads(1), together);
        assert_eq!(threads(3), together);
    }
}

#[test]
fn a_solver_put_together_again_gives_the_same_bits() {
    let (capture, cage) = capture();
    for handles in [Handles::MaxVol, Handles::All] {
        let solver = prepare(&capture, &cage, SolverOptions { handles, ..SolverOptions::PAPER });
        let (normals, gram, weight) = solver.dependent().unwrap();
        let parts = SolverParts {
            handles: solver.handles().to_vec(),
            reads_all: solver.reads_all(),
            operator: solver.operator().to_owned(),
            target: solver.regularization_target().clone(),
            phi: solver.decoder().coordinates().unwrap().to_owned(),
            positions: solver.decoder().positions(),
            dependent: Some(DependentParts { normals: normals.clone(), gram: gram.to_owned(), weight }),
            nearness: solver.nearness().cloned(),
            diagonal: solver.diagonal(),
            preparation: solver.preparation().clone(),
        };
        let mut without = parts.clone();
        without.dependent = None;
        assert!(Solver::from_parts(without).is_none(), "rows of vertices alone are not those of free normals");
        let again = Solver::from_parts(parts).unwrap();
        let positions = frame(&capture, 11);
        assert_eq!(again.cages(&[&positions]), solver.cages(&[&positions]));
        assert_eq!(again.size_bytes(), solver.size_bytes());
    }
}

#[test]
fn collapsed_cages_have_finite_positions() {
    let (capture, cage) = capture();
    let phi = Green::Consistent.coordinates(&cage, &capture.rest.points, None).unwrap().phi;
    let v = cage.vertices().len();
    let decoder =
        Decoder::new(phi.as_ref(), v).with_dependent_normals(Green::Consistent.values(&cage).dependent_normals);
    let point = vec![2.5f32; 3 * v];
    let flat: Vec<f32> = cage.vertices().iter().flat_map(|p| [p[0] as f32, p[1] as f32, 0.0]).collect();
    let line: Vec<f32> = cage.vertices().iter().flat_map(|p| [p[0] as f32, 0.0, 0.0]).collect();
    let mut out = vec![Vec::new(); 3];
    decoder.decode(&[&point, &flat, &line], &mut out);
    assert!(out.iter().flatten().all(|x| x.is_finite()));
    assert!(out[0].iter().all(|&x| x == 2.5), "a cage that is a point makes the model one");
}

#[test]
fn free_normals_follow_translations_and_explain_what_a_consistent_cage_poses() {
    let (capture, cage) = capture();
    let consistent = prepare(&capture, &cage, SolverOptions::PAPER);
    let v = cage.vertices().len();
    for handles in HANDLES {
        let options = SolverOptions { handles, spectrum: 0, ..SolverOptions::PAPER };
        let solver = Solver::prepare(&Green::Free, &cage, &capture.rest.points, options).unwrap();
        let mut posed = vec![Vec::new()];
        consistent.decoder().decode(&[&single(&capture.deformed_cage(17))], &mut posed);
        let found = solver.invert(Rows::All, None, &[&posed[0]]).remove(0);
        assert_eq!(found.convergence, None, "it is linear");
        let error = solver.decoder().measure(&[&found.cage], &[&posed[0]])[0].linf / solver.diagonal();
        assert!(error < 1e-3, "{handles:?}: {error}");
        let moved: Vec<f32> = posed[0].iter().map(|x| x + 64.0).collect();
        let there = solver.cages(&[&moved]).remove(0);
        for (j, (a, b)) in found.cage.iter().zip(&there).enumerate() {
            let shift = if j < 3 * v { 64.0 } else { 0.0 };
            assert!((a + shift - b).abs() < 0.05, "{handles:?}: row {} is off by {}", j / 3, a + shift - b);
        }
    }
}
