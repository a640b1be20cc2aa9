//! The solver on the built-in capture: known cages come back, baselines differ as they should, bits never change.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{CageValues, CoordinateSystem, Coordinates, CoordinatesError, ElementPlan, MeanValue};
use cager_core::decode::Decoder;
use cager_core::inversion::{BATCH, Handles, PrepareContext, PrepareError, Solver, SolverOptions};
use cager_core::regularize::Regularizer;
use cager_demo::{Capture, Options};
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::Point;
use cager_geometry::vector::{along, sub};
use common::Cages;

const HANDLES: [Handles; 4] =
    [Handles::MaxVol, Handles::Rectangular { count: None }, Handles::Spread { count: None }, Handles::All];

fn capture() -> (Capture, Cage) {
    let capture = Capture::new(&Options { points: 2_000, frames: 40, cage_vertices: 100 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    (capture, cage)
}

fn prepare(capture: &Capture, cage: &Cage, options: SolverOptions) -> Solver {
    Solver::prepare(&MeanValue, cage, &capture.rest.points, options).unwrap()
}

fn frame(capture: &Capture, t: usize) -> Vec<f64> {
    let mut out = Vec::new();
    capture.frame(t, &mut out);
    out
}

/// Positions of a cage's model, in double precision.
fn posed(cage: &Cage, points: &[Point], pose: &[Point]) -> Vec<f64> {
    let phi = MeanValue.coordinates(cage, points, None).unwrap().phi;
    (0..points.len())
        .flat_map(|i| [0, 1, 2].map(|k| (0..pose.len()).map(|j| phi[(i, j)] * pose[j][k]).sum::<f64>()))
        .collect()
}

fn farthest(cage: &[f32], truth: &[Point]) -> f64 {
    cage.chunks_exact(3)
        .zip(truth)
        .map(|(a, b)| (0..3).map(|k| (f64::from(a[k]) - b[k]).powi(2)).sum::<f64>().sqrt())
        .fold(0.0, f64::max)
}

#[test]
fn cages_that_posed_the_model_come_back() {
    let (capture, cage) = capture();
    for handles in HANDLES {
        let solver = prepare(&capture, &cage, SolverOptions { handles, spectrum: 0, ..SolverOptions::PAPER });
        for t in [0, 13, 39] {
            let truth = capture.deformed_cage(t);
            let positions = posed(&cage, &capture.rest.points, &truth);
            let found = solver.cages(&[&positions]);
            assert!(farthest(&found[0], &truth) <= 1e-6 * solver.diagonal(), "{handles:?}, frame {t}");
            let error = solver.decoder().measure(&[&found[0]], &[&positions])[0];
            assert!(error.linf <= 2e-6 * solver.diagonal(), "{handles:?}, frame {t}: {}", error.linf);
        }
    }
}

#[test]
fn the_measured_error_is_that_of_the_decoded_positions() {
    let (capture, cage) = capture();
    let solver = prepare(&capture, &cage, SolverOptions::PAPER);
    let frames: Vec<Vec<f64>> = (0..5).map(|t| frame(&capture, t)).collect();
    let views: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
    let cages = solver.cages(&views);
    let cages: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    let errors = solver.decoder().measure(&cages, &views);
    let mut decoded = vec![Vec::new(); 5];
    solver.decoder().decode(&cages, &mut decoded);
    for t in 0..5 {
        let squares: Vec<f64> = frames[t]
            .chunks_exact(3)
            .zip(decoded[t].chunks_exact(3))
            .map(|(a, b)| (0..3).map(|k| (a[k] - f64::from(b[k])).powi(2)).sum())
            .collect();
        let l2 = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let linf = squares.iter().copied().fold(0.0, f64::max).sqrt();
        assert!((errors[t].l2 / l2 - 1.0).abs() < 1e-12 && (errors[t].linf / linf - 1.0).abs() < 1e-12);
    }
}

#[test]
fn coordinates_that_have_travelled_decode_to_the_same_bits() {
    let (capture, cage) = capture();
    let solver = prepare(&capture, &cage, SolverOptions::PAPER);
    let frame = frame(&capture, 3);
    let cages = solver.cages(&[&frame]);
    let phi = solver.decoder().coordinates().unwrap();
    let rows: Vec<f32> = (0..phi.nrows()).flat_map(|i| (0..phi.ncols()).map(move |j| phi[(i, j)])).collect();
    let elsewhere = Decoder::from_rows(&rows, phi.ncols(), cage.vertices().len());
    assert_eq!((elsewhere.points(), elsewhere.unknowns()), (phi.nrows(), phi.ncols()));
    let (mut here, mut there) = (vec![Vec::new()], vec![Vec::new()]);
    solver.decoder().decode(&[&cages[0]], &mut here);
    elsewhere.decode(&[&cages[0]], &mut there);
    assert_eq!(here, there);
}

#[test]
fn decoding_follows_double_precision_to_a_few_parts_in_ten_million() {
    let (capture, cage) = capture();
    let solver = prepare(&capture, &cage, SolverOptions::PAPER);
    let far: Vec<Point> = capture.deformed_cage(7).iter().map(|p| [p[0] + 1000.0, p[1], p[2]]).collect();
    let rounded: Vec<Point> = far.iter().map(|p| p.map(|x| f64::from(x as f32))).collect();
    let truth = posed(&cage, &capture.rest.points, &rounded);
    let cage32: Vec<f32> = rounded.iter().flatten().map(|&x| x as f32).collect();
    let mut out = vec![Vec::new()];
    solver.decoder().decode(&[&cage32], &mut out);
    let worst = truth.iter().zip(&out[0]).map(|(a, b)| (a - f64::from(*b)).abs()).fold(0.0, f64::max);
    // Half a unit in the last place of 1000, and the product's own rounding.
    assert!(worst < 4e-5, "{worst:e}");
}

#[test]
fn a_frame_has_the_same_bits_alone_in_any_place_of_a_batch_and_with_any_threads() {
    let (capture, cage) = capture();
    for handles in HANDLES {
        let options = SolverOptions { handles, ..SolverOptions::PAPER };
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let one = pool(1).install(|| prepare(&capture, &cage, options));
        let many = pool(4).install(|| prepare(&capture, &cage, options));
        assert_eq!(one.handles(), many.handles());
        let frames: Vec<Vec<f64>> = (0..BATCH).map(|t| frame(&capture, t)).collect();
        let views: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let together = one.cages(&views);
        let elsewhere = pool(3).install(|| many.cages(&views));
        assert_eq!(together, elsewhere);
        for t in 0..BATCH {
            assert_eq!(one.cages(&[views[t]])[0], together[t], "{handles:?}, frame {t}");
        }
        let cages: Vec<&[f32]> = together.iter().map(Vec::as_slice).collect();
        let (mut all, mut single) = (vec![Vec::new(); BATCH], vec![Vec::new()]);
        one.decoder().decode(&cages, &mut all);
        for t in 0..BATCH {
            one.decoder().decode(&cages[t..=t], &mut single);
            assert_eq!(single[0], all[t]);
        }
    }
}

#[test]
fn the_handle_rows_of_a_frame_give_the_same_cage_as_the_whole_frame() {
    let (capture, cage) = capture();
    for handles in HANDLES.into_iter().filter(|&handles| handles != Handles::All) {
        let solver = prepare(&capture, &cage, SolverOptions { handles, ..SolverOptions::PAPER });
        assert!(!solver.reads_all());
        let whole: Vec<Vec<f64>> = (0..5).map(|t| frame(&capture, t)).collect();
        let rows = |f: &Vec<f64>| -> Vec<f64> {
            solver.handles().iter().flat_map(|&i| f[3 * i as usize..][..3].to_vec()).collect()
        };
        let parts: Vec<Vec<f64>> = whole.iter().map(rows).collect();
        let from_whole = solver.cages(&whole.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let from_rows = solver.cages_of_handles(None, &parts.iter().map(Vec::as_slice).collect::<Vec<_>>());
        assert_eq!(from_whole, from_rows);
    }
}

#[test]
fn every_method_follows_a_translation_exactly() {
    let (capture, cage) = capture();
    let m = cage.vertices().len();
    let own = SparseMatrix::new(3, m, vec![(0, 0, 1.0), (1, 3, -2.0), (2, 4, 0.5), (2, 7, 0.5)]).unwrap();
    for handles in HANDLES {
        for regularizer in Regularizer::ALL {
            let options = SolverOptions { handles, regularizer, lambda: 0.1, ..SolverOptions::PAPER };
            let solver = Solver::prepare_with(
                &MeanValue,
                &cage,
                &capture.rest.points,
                options,
                &PrepareContext { matrix: Some(&own), ..PrepareContext::default() },
            )
            .unwrap();
            let here = frame(&capture, 9);
            let there: Vec<f64> = here.chunks_exact(3).flat_map(|p| [p[0] + 50.0, p[1] - 20.0, p[2] + 3.0]).collect();
            let cages = [&here, &there].map(|frame| solver.cages(&[frame]).remove(0));
            for (a, b) in cages[0].chunks_exact(3).zip(cages[1].chunks_exact(3)) {
                for (k, shift) in [50.0f32, -20.0, 3.0].into_iter().enumerate() {
                    assert!((b[k] - a[k] - shift).abs() < 2e-5, "{handles:?} {regularizer:?}: {} {}", a[k], b[k]);
                }
            }
        }
    }
}

/// Mean L2 and the cages' roughness `‖ΔC‖` stand for fidelity and smoothness.
fn l2(capture: &Capture, cage: &Cage, options: SolverOptions) -> f64 {
    let solver = prepare(capture, cage, options);
    let frames: Vec<Vec<f64>> = (0..BATCH).map(|t| frame(capture, 2 * t)).collect();
    let views: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
    let cages = solver.cages(&views);
    let cages: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    solver.decoder().measure(&cages, &views).iter().map(|e| e.l2).sum::<f64>() / BATCH as f64 / solver.diagonal()
}

#[test]
fn least_squares_has_the_lowest_error_and_global_regularisation_the_highest() {
    let (capture, cage) = capture();
    let with = |handles, regularizer, spectrum| {
        l2(&capture, &cage, SolverOptions { handles, regularizer, spectrum, lambda: 1.0 })
    };
    let least = with(Handles::All, Regularizer::None, 0);
    let maxvol = with(Handles::MaxVol, Regularizer::None, 0);
    let sub = with(Handles::MaxVol, Regularizer::Laplacian, 20);
    let global = with(Handles::MaxVol, Regularizer::Global, 0);
    assert!(least < maxvol && maxvol < 2.0 * least, "{least} {maxvol}");
    assert!(sub < global, "{sub} {global}");
}

#[test]
fn no_threshold_no_weight_and_no_regularizer_are_the_same() {
    let (capture, cage) = capture();
    let positions = frame(&capture, 3);
    let with = |regularizer, spectrum, lambda| {
        prepare(&capture, &cage, SolverOptions { handles: Handles::MaxVol, regularizer, spectrum, lambda })
            .cages(&[&positions])
    };
    let plain = with(Regularizer::None, 20, 1.0);
    assert_eq!(with(Regularizer::Laplacian, 0, 1.0), plain);
    assert_eq!(with(Regularizer::Laplacian, 20, 0.0), plain);
    assert_eq!(with(Regularizer::TruncatedSvd, 0, 1.0), plain);
    assert_ne!(with(Regularizer::Laplacian, 20, 1.0), plain);
}

/// Mean value coordinates with the weights of the last vertices passed on to four others that span them.
struct Deaf(usize);

impl CoordinateSystem for Deaf {
    fn name(&self) -> &'static str {
        "deaf"
    }
    fn values(&self, cage: &Cage) -> CageValues {
        CageValues::of_vertices(cage)
    }
    fn coordinates(
        &self,
        cage: &Cage,
        points: &[Point],
        _: Option<&ElementPlan>,
    ) -> Result<Coordinates, CoordinatesError> {
        let mut coordinates = MeanValue.coordinates(cage, points, None)?;
        let v = cage.vertices();
        let m = v.len();
        let heirs = [0, m / 4, m / 2, 3 * m / 4];
        let row = |k: usize, p: Point| if k < 3 { p[k] } else { 1.0 };
        let span = faer::Mat::from_fn(4, 4, |k, i| row(k, v[heirs[i]])).partial_piv_lu();
        for dead in m - self.0..m {
            let shares = faer::prelude::Solve::solve(&span, faer::Mat::from_fn(4, 1, |k, _| row(k, v[dead])));
            for i in 0..points.len() {
                let weight = std::mem::take(&mut coordinates.phi[(i, dead)]);
                for (k, &heir) in heirs.iter().enumerate() {
                    coordinates.phi[(i, heir)] += weight * shares[(k, 0)];
                }
            }
        }
        Ok(coordinates)
    }
}

#[test]
fn vertices_that_no_point_feels_are_counted_and_placed_by_their_neighbours() {
    let (capture, cage) = capture();
    let m = cage.vertices().len();
    for handles in HANDLES {
        for regularizer in [Regularizer::None, Regularizer::Laplacian] {
            let options = SolverOptions { handles, regularizer, ..SolverOptions::PAPER };
            let solver = Solver::prepare(&Deaf(3), &cage, &capture.rest.points, options).unwrap();
            assert_eq!(solver.preparation().rank, m - 3);
            let read = match handles {
                Handles::MaxVol => m - 3,
                Handles::All => 0,
                _ => 2 * m,
            };
            assert_eq!(solver.handles().len(), read);
            let positions = frame(&capture, 5);
            let found = solver.cages(&[&positions]);
            assert!(found[0].iter().all(|x| x.is_finite()));
            let error = solver.decoder().measure(&[&found[0]], &[&positions])[0];
            assert!(error.l2 < 0.1 * solver.diagonal(), "{handles:?} {regularizer:?} {}", error.l2);
            // An unfelt vertex lies within the cage's own extent, not at the origin or at infinity.
            let (low, high) = cager_geometry::mesh::bounds(&capture.deformed_cage(5));
            for vertex in found[0].chunks_exact(3).skip(m - 3) {
                for k in 0..3 {
                    let (x, size) = (f64::from(vertex[k]), high[k] - low[k]);
                    assert!(x > low[k] - 0.5 * size && x < high[k] + 0.5 * size, "{vertex:?}");
                }
            }
        }
    }
}

#[test]
fn what_cannot_be_solved_is_refused() {
    let (capture, cage) = capture();
    let m = cage.vertices().len();
    let refused = |points: &[Point], options| Solver::prepare(&MeanValue, &cage, points, options).unwrap_err();
    let good = &capture.rest.points;
    let options = SolverOptions::PAPER;
    assert_eq!(refused(&good[..m - 1], options), PrepareError::TooFewPoints { points: m - 1, unknowns: m });
    let mut broken = good.clone();
    broken[17][2] = f64::INFINITY;
    assert_eq!(refused(&broken, options), PrepareError::NotFinite { point: 17 });
    assert_eq!(refused(&vec![good[0]; 2 * m], options), PrepareError::NoExtent);
    let spectrum = SolverOptions { spectrum: m + 1, ..options };
    assert_eq!(refused(good, spectrum), PrepareError::SpectrumTooLarge { spectrum: m + 1, unknowns: m });
    for lambda in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(matches!(refused(good, SolverOptions { lambda, ..options }), PrepareError::BadLambda { .. }));
    }
}

#[test]
fn a_model_of_few_places_repeated_many_times_is_solved_as_far_as_it_goes() {
    let (capture, cage) = capture();
    let points: Vec<Point> = (0..2_000).map(|i| capture.rest.points[(i % 30) * 60]).collect();
    let solver = Solver::prepare(&MeanValue, &cage, &points, SolverOptions::PAPER).unwrap();
    assert_eq!(solver.preparation().rank, 30);
    let positions: Vec<f64> = points.iter().flatten().copied().collect();
    let found = solver.cages(&[&positions]);
    let error = solver.decoder().measure(&[&found[0]], &[&positions])[0];
    assert!(error.linf < 1e-5 * solver.diagonal(), "{}", error.linf / solver.diagonal());
}

#[test]
fn a_model_far_too_small_for_its_cage_is_still_followed_by_every_method() {
    let (capture, cage) = capture();
    for scale in [1e-1, 1e-2, 1e-3] {
        let centre = capture.rest.points[300];
        let shrunk = |p: &Point| along(centre, scale, sub(*p, centre));
        let points: Vec<Point> = capture.rest.points.iter().map(shrunk).collect();
        let moved: Vec<f64> =
            points.iter().flat_map(|p| [1.1 * p[0] + 0.2 * p[1], p[1] - 0.1 * p[0] + 3.0, p[2]]).collect();
        for handles in HANDLES {
            for spectrum in [0, 20] {
                let options = SolverOptions { handles, spectrum, ..SolverOptions::PAPER };
                let solver = Solver::prepare(&MeanValue, &cage, &points, options).unwrap();
                let found = solver.cages(&[&moved]);
                let error = solver.decoder().measure(&[&found[0]], &[&moved])[0];
                let l2 = error.l2 / solver.diagonal();
                eprintln!(
                    "{scale:e} {handles:?} s {spectrum}: rank {} condition {:e} L2 {l2:e}",
                    solver.preparation().rank,
                    solver.preparation().condition_full
                );
                assert!(l2 < 1e-2, "{scale:e} {handles:?} s {spectrum}: rank {} L2 {l2:e}", solver.preparation().rank);
            }
        }
    }
}
