//! One analysis gives the solvers that preparing each by itself gives.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_core::decode::FrameError;
use cager_core::inversion::{Handles, PrepareContext, PrepareError, Solver, SolverOptions};
use cager_core::regularize::Regularizer;
use cager_core::spectral::Analysis;
use cager_core::spectral::maxvol::{TOLERANCE, maxvol, maxvol_from};
use cager_demo::{Capture, Options};
use cager_geometry::mesh::Point;
use common::{Cages, Random};
use faer::Mat;

fn capture() -> (Capture, Cage) {
    let capture = Capture::new(&Options { points: 700, frames: 9, cage_vertices: 60 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    (capture, cage)
}

#[test]
fn solvers_of_an_analysis_have_the_bits_of_those_prepared_alone() {
    let (capture, cage) = capture();
    let points: &[Point] = &capture.rest.points;
    let analysis = Analysis::new(&MeanValue, &cage, points, &PrepareContext::default()).unwrap();
    let mut frame = Vec::new();
    capture.frame(4, &mut frame);
    let some = [Handles::Rectangular { count: None }, Handles::Spread { count: Some(100) }];
    for handles in [Handles::MaxVol, Handles::All].into_iter().chain(some) {
        for regularizer in Regularizer::ALL.into_iter().filter(|&r| r != Regularizer::Matrix) {
            for spectrum in [0, 7] {
                let options = SolverOptions { handles, regularizer, spectrum, lambda: 0.5 };
                let alone = Solver::prepare(&MeanValue, &cage, points, options).unwrap();
                let shared = analysis.solver(options).unwrap();
                let invert = |solver: &Solver| solver.cages(&[frame.as_slice()]);
                // Over the whole spectrum all points are solved for by their normal equations.
                if handles == Handles::All && regularizer == Regularizer::Global {
                    let (a, b) = (invert(&shared).concat(), invert(&alone).concat());
                    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-6), "{options:?}");
                    continue;
                }
                assert_eq!(invert(&shared), invert(&alone), "{options:?}");
                assert_eq!(shared.handles(), alone.handles());
                let (a, b) = (shared.preparation(), alone.preparation());
                assert_eq!((a.rank, a.maxvol, &a.singular_values), (b.rank, b.maxvol, &b.singular_values));
                assert_eq!(a.condition_handles, b.condition_handles);
            }
        }
    }
}

#[test]
fn what_would_take_more_memory_than_it_may_is_refused_before_it_is_taken() {
    let (capture, cage) = capture();
    let prepare = |handles, memory| {
        let context = PrepareContext { memory, ..PrepareContext::default() };
        let options = SolverOptions { handles, ..SolverOptions::PAPER };
        Solver::prepare_with(&MeanValue, &cage, &capture.rest.points, options, &context).map(|_| ())
    };
    // The points times the vertices, twice; the covariance of 300 handles, its factor, and what is solved with it.
    let (points, vertices) = (capture.rest.points.len() as u64, cage.vertices().len() as u64);
    let (coordinates, covariance) = (8 * 2 * points * vertices, 8 * 300 * (600 + 2 * vertices));
    assert!(matches!(prepare(Handles::MaxVol, coordinates - 1), Err(PrepareError::OutOfMemory { .. })));
    assert_eq!(prepare(Handles::MaxVol, coordinates), Ok(()));
    let spread = Handles::Spread { count: Some(300) };
    assert!(matches!(prepare(spread, covariance - 1), Err(PrepareError::HandlesOutOfMemory { count: 300, .. })));
    assert_eq!(prepare(spread, covariance), Ok(()));
}

#[test]
fn spectra_are_those_of_the_matrices() {
    let (capture, cage) = capture();
    let analysis = Analysis::new(&MeanValue, &cage, &capture.rest.points, &PrepareContext::default()).unwrap();
    let m = analysis.coordinates().ncols();
    let direct = analysis.coordinates().singular_values().unwrap();
    for (found, wanted) in analysis.full_spectrum().iter().zip(direct) {
        assert!((found - wanted).abs() < 1e-10 * analysis.full_spectrum()[0], "{found} {wanted}");
    }
    let rows = &analysis.handles().unwrap().rows;
    let again = analysis.spectrum_of(rows).unwrap();
    for (found, wanted) in again.iter().zip(analysis.handle_spectrum()) {
        assert!((found - wanted).abs() < 1e-12 * again[0], "{found} {wanted}");
    }
    // A right singular vector is stretched to its singular value.
    let square = Mat::from_fn(m, m, |i, j| analysis.coordinates()[(rows[i] as usize, j)]);
    for k in [0, m / 2, m - 1] {
        let length = (&square * analysis.handle_vectors().col(k)).norm_l2();
        assert!((length - analysis.handle_spectrum()[k]).abs() < 1e-12);
    }
}

#[test]
fn rows_given_to_an_analysis_are_followed_exactly_where_they_determine_the_cage() {
    let (capture, cage) = capture();
    let analysis = Analysis::new(&MeanValue, &cage, &capture.rest.points, &PrepareContext::default()).unwrap();
    let options = SolverOptions { regularizer: Regularizer::None, spectrum: 0, ..SolverOptions::PAPER };
    let of_rows = |rows: &[u32]| analysis.handle_system_of(rows)?.solver(options, None);
    let rows = analysis.handles().unwrap().rows.clone();
    let (given, own) = (of_rows(&rows).unwrap(), analysis.solver(options).unwrap());
    let mut frame = Vec::new();
    capture.frame(3, &mut frame);
    let (a, b) = (given.cages(&[frame.as_slice()]), own.cages(&[frame.as_slice()]));
    assert!(a[0].iter().zip(&b[0]).all(|(x, y)| (x - y).abs() < 1e-5));
    // More rows than unknowns: least squares over them.
    let more: Vec<u32> = (0..capture.rest.points.len() as u32).collect();
    let all = analysis.solver(SolverOptions { handles: Handles::All, ..options }).unwrap();
    let (a, b) = (of_rows(&more).unwrap().cages(&[frame.as_slice()]), all.cages(&[frame.as_slice()]));
    assert!(a[0].iter().zip(&b[0]).all(|(x, y)| (x - y).abs() < 1e-4));
    // The same row many times determines nothing but one direction, and the Laplacian places the rest.
    let poor = of_rows(&vec![5; rows.len()]).unwrap();
    let sigma = &poor.preparation().singular_values;
    assert_eq!(sigma.iter().filter(|&&x| x > 1e-11 * sigma[0]).count(), 1);
    assert!(poor.cages(&[frame.as_slice()])[0].iter().all(|x| x.is_finite()));
}

#[test]
fn thresholds_beyond_the_unknowns_are_refused_by_an_analysis_too() {
    let (capture, cage) = capture();
    let analysis = Analysis::new(&MeanValue, &cage, &capture.rest.points, &PrepareContext::default()).unwrap();
    let unknowns = analysis.coordinates().ncols();
    let options = SolverOptions { spectrum: unknowns + 1, ..SolverOptions::PAPER };
    let refused = PrepareError::SpectrumTooLarge { spectrum: unknowns + 1, unknowns };
    assert_eq!(analysis.solver(options).unwrap_err(), refused);
    let of_rows = analysis.handle_system_of(&analysis.handles().unwrap().rows).unwrap();
    assert_eq!(of_rows.solver(options, None).unwrap_err(), refused);
}

#[test]
fn swaps_lead_from_the_start_to_the_handles_and_their_volume() {
    let mut random = Random::new(3);
    let a = Mat::from_fn(600, 25, |_, _| random.uniform().powi(3));
    let bad: Vec<u32> = (0..25).collect();
    for found in [maxvol(a.as_ref(), TOLERANCE).unwrap(), maxvol_from(a.as_ref(), bad, TOLERANCE).unwrap()] {
        let mut rows = found.start.clone();
        let mut volume = found.start_log_volume;
        for swap in &found.trace {
            assert!(swap.growth > 1.0);
            rows[swap.position as usize] = swap.row;
            volume += swap.growth.ln();
        }
        assert_eq!((rows, found.trace.len()), (found.rows.clone(), found.volume.swaps));
        assert!((volume - found.volume.log_volume).abs() < 1e-4, "{volume} {}", found.volume.log_volume);
        assert!(found.volume.max_entry <= 1.0 + TOLERANCE);
    }
    assert!(maxvol_from(a.as_ref(), vec![7; 25], TOLERANCE).is_err());
    // All but dependent: the second row is the first but for 1e-7.
    let mut near = a.clone();
    for j in 0..25 {
        near[(1, j)] = near[(0, j)] + if j == 3 { 1e-7 } else { 0.0 };
    }
    assert!(maxvol_from(near.as_ref(), (0..25).collect(), TOLERANCE).is_err());
}

#[test]
fn many_unknowns_are_prepared_to_the_same_bits_by_any_threads_and_as_an_analysis_of_everything_does() {
    let capture = Capture::new(&Options { points: 2_600, frames: 3, cage_vertices: 560 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    let points: &[Point] = &capture.rest.points;
    let everything = Analysis::new(&MeanValue, &cage, points, &PrepareContext::default()).unwrap();
    assert!(everything.coordinates().ncols() >= 512, "the sizes where only the ends of some spectra are computed");
    for handles in [Handles::MaxVol, Handles::Spread { count: None }, Handles::All] {
        let options = SolverOptions { handles, ..SolverOptions::default() };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Solver::prepare(&MeanValue, &cage, points, options).unwrap())
        };
        let (one, three) = (with(1), with(3));
        assert_eq!(one.operator(), three.operator(), "{handles:?}");
        let (a, b) = (one.preparation(), three.preparation());
        assert_eq!(a.condition_full.to_bits(), b.condition_full.to_bits());
        assert_eq!(a.condition_handles.to_bits(), b.condition_handles.to_bits());
        let whole = everything.solver(options).unwrap();
        let c = whole.preparation();
        assert_eq!(one.handles(), whole.handles());
        assert!((a.condition_full / c.condition_full - 1.0).abs() < 1e-9, "{} {}", a.condition_full, c.condition_full);
        assert!((a.condition_handles / c.condition_handles - 1.0).abs() < 1e-9, "{handles:?}");
        assert_eq!(a.singular_values, c.singular_values, "{handles:?}");
    }
}

#[test]
fn the_last_directions_alone_give_the_cages_of_the_whole_decomposition() {
    let capture = Capture::new(&Options { points: 2_100, frames: 9, cage_vertices: 1_030 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    let points: &[Point] = &capture.rest.points;
    let everything = Analysis::new(&MeanValue, &cage, points, &PrepareContext::default()).unwrap();
    let unknowns = everything.coordinates().ncols();
    assert!(unknowns >= 1024, "the sizes where only the directions that a term acts on are computed");
    let mut frame = Vec::new();
    capture.frame(5, &mut frame);
    for (handles, regularizer, spectrum, lambda) in [
        (Handles::MaxVol, Regularizer::Laplacian, 20, 1.0),
        (Handles::Spread { count: None }, Regularizer::Differential, 20, 1.0),
        (Handles::All, Regularizer::None, 0, 1.0),
        (Handles::MaxVol, Regularizer::Differential, 20, 0.0),
    ] {
        let options = SolverOptions { handles, regularizer, spectrum, lambda };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Solver::prepare(&MeanValue, &cage, points, options).unwrap())
        };
        let (alone, whole) = (with(2), everything.solver(options).unwrap());
        if handles == Handles::default() {
            assert_eq!(alone.operator(), with(1).operator());
        }
        let [found, wanted] = [&alone, &whole].map(|solver| solver.cages(&[frame.as_slice()]).concat());
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!((found - wanted).abs() < 1e-6 * alone.diagonal() as f32, "{options:?}: {found} {wanted}");
        }
        let (a, b) = (alone.preparation(), whole.preparation());
        assert!((a.condition_handles / b.condition_handles - 1.0).abs() < 1e-9, "{options:?}");
        assert!((a.condition_full / b.condition_full - 1.0).abs() < 1e-9, "{options:?}");
        // The values that are known are those of the whole decomposition.
        let known = a.singular_values.iter().zip(&b.singular_values).filter(|(found, _)| !found.is_nan());
        let last = if lambda > 0.0 { spectrum.max(1) } else { 1 };
        assert_eq!((a.singular_values.len(), known.clone().count()), (unknowns, 1 + last));
        for (found, wanted) in known {
            assert!((found / wanted - 1.0).abs() < 1e-9, "{options:?}: {found} {wanted}");
        }
    }
}

#[test]
fn an_error_that_is_nan_is_kept_whichever_way_errors_are_measured() {
    let (capture, cage) = capture();
    let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, SolverOptions::PAPER).unwrap();
    let mut frame = Vec::new();
    capture.frame(4, &mut frame);
    let cages = solver.cages(&[&frame]);
    let mut decoded = [Vec::new()];
    solver.decoder().decode(&[&cages[0]], &mut decoded);
    for points in [&[5][..], &[100, 600], &[699]] {
        let mut frame = frame.clone();
        points.iter().for_each(|&point: &usize| frame[3 * point + 1] = f64::NAN);
        let measured = solver.decoder().measure(&[&cages[0]], &[&frame]);
        for error in [measured[0], FrameError::of_positions(&decoded[0], &frame)] {
            assert!(error.linf.is_nan() && error.l2.is_nan(), "{error:?}");
            assert_eq!(error.worst as usize, points[0], "the first of them");
        }
    }
}
