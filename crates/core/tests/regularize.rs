//! Regularisation terms: what they minimise, what they depend on, and thresholds chosen by measuring.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{
    CageValues, CoordinateSystem, Coordinates, CoordinatesError, ElementPlan, Green, MeanValue,
};
use cager_core::inversion::{BATCH, Handles, PrepareContext, PrepareError, Solver, SolverOptions};
use cager_core::regularize::{Reference, Regularizer, TermError};
use cager_core::spectral::Analysis;
use cager_demo::{Capture, Options};
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::Point;
use common::Cages;
use faer::Mat;

fn with(matrix: &SparseMatrix) -> PrepareContext<'_> {
    PrepareContext { matrix: Some(matrix), ..PrepareContext::default() }
}

fn capture() -> (Capture, Cage) {
    let capture = Capture::new(&Options { points: 2_000, frames: 40, cage_vertices: 100 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    (capture, cage)
}

fn frame(capture: &Capture, t: usize) -> Vec<f64> {
    let mut out = Vec::new();
    capture.frame(t, &mut out);
    out
}

fn as_matrix(rows: &[f32]) -> Mat<f64> {
    Mat::from_fn(rows.len() / 3, 3, |i, k| f64::from(rows[3 * i + k]))
}

/// Second differences along the order of the vertices: nothing a cage would want, so that every row matters.
fn own_term(m: usize) -> SparseMatrix {
    let row = |i: u32| [(i, i, 0.7), (i, i + 1, -1.0), (i, i + 2, 0.3)];
    SparseMatrix::new(m - 2, m, (0..m as u32 - 2).flat_map(row).collect()).unwrap()
}

#[test]
fn every_term_minimises_its_energy() {
    let (capture, cage) = capture();
    let m = cage.vertices().len();
    let phi = MeanValue.coordinates(&cage, &capture.rest.points, None).unwrap().phi;
    let own = own_term(m);
    let (before, now) = (frame(&capture, 11), frame(&capture, 14));
    let lambda = 0.3;
    let terms = [Regularizer::Laplacian, Regularizer::Differential, Regularizer::Temporal, Regularizer::Matrix];
    for (regularizer, handles) in terms.into_iter().flat_map(|t| [(t, Handles::MaxVol), (t, Handles::All)]) {
        let options = SolverOptions { regularizer, handles, spectrum: m, lambda };
        let solver = Solver::prepare_with(&MeanValue, &cage, &capture.rest.points, options, &with(&own)).unwrap();
        let previous = solver.cages(&[&before]).remove(0);
        let found = as_matrix(&solver.cages_after(Some(&previous), &[&now])[0]);
        let read: Vec<usize> = match handles {
            Handles::All => (0..phi.nrows()).collect(),
            _ => solver.handles().iter().map(|&row| row as usize).collect(),
        };
        let rows = Mat::from_fn(read.len(), m, |i, j| phi[(read[i], j)]);
        let target = Mat::from_fn(read.len(), 3, |i, k| now[3 * read[i] + k]);
        let delta = regularizer.delta(Some(&own), &cage, m).unwrap();
        let reference = match regularizer.reference() {
            Reference::Origin => Mat::zeros(m, 3),
            Reference::RestCage => Mat::from_fn(m, 3, |i, k| cage.vertices()[i][k]),
            Reference::PreviousCage => as_matrix(&previous),
        };
        let share = m as f64 / read.len() as f64;
        let data = rows.transpose() * (&rows * &found - &target) * share;
        let shape = delta.transpose() * (&delta * (&found - &reference)) * lambda;
        // Cages follow translations whatever the term: its rows have to sum to zero here.
        let sum: f64 = (0..m).map(|j| delta[(0, j)]).sum();
        assert!(sum.abs() < 1e-12);
        let gradient = &data + &shape;
        assert!(data.norm_max() > 1e-4, "{regularizer:?} {handles:?}: the term has an influence");
        assert!(gradient.norm_max() < 2e-6, "{regularizer:?} {handles:?}: {:e}", gradient.norm_max());
    }
}

#[test]
fn a_weight_means_the_same_however_densely_the_model_is_sampled() {
    let (capture, cage) = capture();
    let twice = |points: &[f64]| -> Vec<f64> { [points, points].concat() };
    let rest: Vec<Point> = capture.rest.points.iter().chain(&capture.rest.points).copied().collect();
    let now = frame(&capture, 14);
    for regularizer in [Regularizer::Differential, Regularizer::Global, Regularizer::Tikhonov] {
        let options = SolverOptions { regularizer, handles: Handles::All, spectrum: 20, lambda: 0.3 };
        let cages = |rest: &[Point], frame: &[f64]| {
            as_matrix(&Solver::prepare(&MeanValue, &cage, rest, options).unwrap().cages(&[frame])[0])
        };
        let apart = cages(&rest, &twice(&now)) - cages(&capture.rest.points, &now);
        assert!(apart.norm_max() < 2e-6, "{regularizer:?}: {:e}", apart.norm_max());
    }
}

#[test]
fn no_weight_is_no_threshold() {
    let (capture, cage) = capture();
    let now = frame(&capture, 14);
    for handles in [Handles::MaxVol, Handles::Spread { count: None }, Handles::All] {
        for regularizer in [Regularizer::Laplacian, Regularizer::Differential, Regularizer::Temporal] {
            let cage = |spectrum, lambda| {
                let options = SolverOptions { handles, regularizer, spectrum, lambda };
                Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap().cages(&[&now])
            };
            assert_eq!(cage(20, 0.0), cage(0, 1.0), "{handles:?} {regularizer:?}");
        }
    }
}

#[test]
fn the_rest_cage_comes_back_where_its_differential_coordinates_are_kept() {
    let (capture, cage) = capture();
    let rest: Vec<f64> = capture.rest.points.as_flattened().to_vec();
    let far = |regularizer| {
        let options = SolverOptions { regularizer, spectrum: 60, lambda: 100.0, ..SolverOptions::PAPER };
        let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
        let found = solver.cages(&[&rest]).remove(0);
        let apart = found.iter().zip(cage.vertices().as_flattened()).map(|(a, b)| (f64::from(*a) - b).abs());
        apart.fold(0.0, f64::max) / solver.diagonal()
    };
    assert!(far(Regularizer::Differential) < 1e-6, "{:e}", far(Regularizer::Differential));
    assert!(far(Regularizer::Temporal) < 1e-6, "the first frame's predecessor is the rest cage");
    assert!(far(Regularizer::Laplacian) > 1e-3, "{:e}", far(Regularizer::Laplacian));
}

#[test]
fn frames_that_follow_each_other_have_the_same_bits_in_any_batches() {
    let (capture, cage) = capture();
    for handles in [Handles::MaxVol, Handles::Spread { count: None }, Handles::All] {
        let options = SolverOptions { regularizer: Regularizer::Temporal, handles, ..SolverOptions::PAPER };
        let solver = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap();
        assert!(solver.follows_previous());
        let frames: Vec<Vec<f64>> = (0..2 * BATCH).map(|t| frame(&capture, t)).collect();
        let views: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let mut whole = solver.cages(&views[..BATCH]);
        whole.extend(solver.cages_after(whole.last().cloned().as_deref(), &views[BATCH..]));
        let mut single: Vec<Vec<f32>> = Vec::new();
        for view in &views {
            single.push(solver.cages_after(single.last().cloned().as_deref(), &[view]).remove(0));
        }
        assert_eq!(whole, single);
        assert_ne!(whole[5], solver.cages(&[views[5]])[0], "the predecessor matters");
        if handles != Handles::All {
            let rows: Vec<f64> =
                solver.handles().iter().flat_map(|&i| frames[5][3 * i as usize..][..3].to_vec()).collect();
            assert_eq!(solver.cages_of_handles(Some(&whole[4]), &[&rows])[0], whole[5]);
        }
    }
}

/// The Laplacian as a matrix of the user's own, each row written `copies` times at less weight.
fn laplacian_as_matrix(cage: &Cage, copies: usize) -> SparseMatrix {
    let m = cage.vertices().len();
    let delta = Regularizer::Laplacian.delta(None, cage, m).unwrap();
    let scale = (copies as f64).sqrt();
    let entries = (0..m * copies).flat_map(|row| {
        let delta = &delta;
        (0..m).map(move |j| (row as u32, j as u32, delta[(row / copies, j)] / scale)).filter(|entry| entry.2 != 0.0)
    });
    SparseMatrix::new(m * copies, m, entries.collect()).unwrap()
}

#[test]
fn a_matrix_that_is_the_laplacian_does_what_the_laplacian_does() {
    let (capture, cage) = capture();
    let positions = frame(&capture, 8);
    let solve = |regularizer, matrix: &SparseMatrix| {
        let options = SolverOptions { regularizer, ..SolverOptions::PAPER };
        let solver = Solver::prepare_with(&MeanValue, &cage, &capture.rest.points, options, &with(matrix)).unwrap();
        as_matrix(&solver.cages(&[&positions])[0])
    };
    let wanted = solve(Regularizer::Laplacian, &laplacian_as_matrix(&cage, 1));
    for copies in [1, 7] {
        let found = solve(Regularizer::Matrix, &laplacian_as_matrix(&cage, copies));
        assert!((&found - &wanted).norm_max() < 1e-6, "{copies}: {:e}", (&found - &wanted).norm_max());
    }
}

#[test]
fn a_matrix_that_does_not_fit_is_refused() {
    let (capture, cage) = capture();
    let m = cage.vertices().len();
    let options = SolverOptions { regularizer: Regularizer::Matrix, ..SolverOptions::PAPER };
    let points = &capture.rest.points;
    assert_eq!(
        Solver::prepare(&MeanValue, &cage, points, options).unwrap_err(),
        PrepareError::Term(TermError::Missing)
    );
    let narrow = SparseMatrix::new(4, m - 1, vec![(0, 0, 1.0)]).unwrap();
    let error = Solver::prepare_with(&MeanValue, &cage, points, options, &with(&narrow)).unwrap_err();
    assert_eq!(error, PrepareError::Term(TermError::Columns { columns: m - 1, vertices: m, unknowns: m }));
    for entries in [vec![(4, 0, 1.0)], vec![(0, m as u32, 1.0)], vec![(0, 0, f64::NAN)], vec![(0, 0, 1e101)]] {
        assert_eq!(SparseMatrix::new(4, m, entries), None);
    }
    let empty = SparseMatrix::new(0, m, Vec::new()).unwrap();
    let solver = Solver::prepare_with(&MeanValue, &cage, points, options, &with(&empty)).unwrap();
    let plain = SolverOptions { regularizer: Regularizer::None, ..options };
    let plain = Solver::prepare(&MeanValue, &cage, points, plain).unwrap();
    let positions = frame(&capture, 2);
    let apart = as_matrix(&solver.cages(&[&positions])[0]) - as_matrix(&plain.cages(&[&positions])[0]);
    assert!(apart.norm_max() < 1e-6, "an empty matrix wants nothing: {:e}", apart.norm_max());
}

#[test]
fn the_chosen_threshold_is_the_largest_within_the_bound() {
    let (capture, cage) = capture();
    let m = cage.vertices().len();
    let analysis = Analysis::new(&MeanValue, &cage, &capture.rest.points, &PrepareContext::default()).unwrap();
    let samples: Vec<Vec<f64>> = (0..8).map(|k| frame(&capture, 5 * k)).collect();
    for handles in
        [Handles::MaxVol, Handles::Rectangular { count: None }, Handles::Spread { count: None }, Handles::All]
    {
        for regularizer in [Regularizer::Laplacian, Regularizer::Differential, Regularizer::TruncatedSvd] {
            let options = SolverOptions { handles, regularizer, lambda: 0.001, ..SolverOptions::PAPER };
            let handle_system = analysis.handle_system(handles).unwrap();
            let measured = |spectrum| {
                let solver = analysis.solver(SolverOptions { spectrum, ..options }).unwrap();
                let l2 = |frame: &Vec<f64>| {
                    let cage = solver.cages(&[frame]).remove(0);
                    solver.decoder().measure(&[&cage], &[frame])[0].l2 / solver.diagonal()
                };
                samples.iter().map(l2).sum::<f64>() / samples.len() as f64
            };
            let found = handle_system.choose_threshold(options, None, &samples, 0.05).unwrap();
            for &(s, l2) in &found.tried {
                assert!((l2 / measured(s) - 1.0).abs() < 1e-4, "{handles:?} {regularizer:?} {s}: {l2} {}", measured(s));
            }
            let most = 1.05 * found.tried[0].1;
            let within = |s: usize| found.tried.iter().any(|&(tried, l2)| tried == s && l2 <= most);
            assert!(within(found.spectrum) && found.extra() <= 0.05, "{found:?}");
            let next_exceeds = found.tried.iter().any(|&(s, l2)| s == found.spectrum + 1 && l2 > most);
            assert!(found.spectrum == m || next_exceeds, "{handles:?} {regularizer:?} {found:?}");
            assert!(found.tried.len() < 30, "{found:?}");
            assert!(
                found.spectrum > 0 || regularizer == Regularizer::TruncatedSvd,
                "{handles:?} {regularizer:?} {found:?}"
            );
        }
    }
    let options = SolverOptions::PAPER;
    let handle_system = analysis.handle_system(options.handles).unwrap();
    let at = |bound| handle_system.choose_threshold(options, None, &samples, bound).unwrap().spectrum;
    assert!(at(0.0) <= at(0.2) && at(0.2) < at(2.0), "{} {} {}", at(0.0), at(0.2), at(2.0));
    assert_eq!(at(1e9), m);
}

#[test]
fn a_threshold_for_frames_that_follow_each_other_is_measured_in_their_order() {
    let (capture, cage) = capture();
    let analysis = Analysis::new(&MeanValue, &cage, &capture.rest.points, &PrepareContext::default()).unwrap();
    let options = SolverOptions { regularizer: Regularizer::Temporal, ..SolverOptions::PAPER };
    let samples: Vec<Vec<f64>> = (0..20).map(|t| frame(&capture, t)).collect();
    let handle_system = analysis.handle_system(options.handles).unwrap();
    let found = handle_system.choose_threshold(options, None, &samples, 0.05).unwrap();
    for &(spectrum, l2) in &found.tried {
        let solver = analysis.solver(SolverOptions { spectrum, ..options }).unwrap();
        let mut previous: Option<Vec<f32>> = None;
        let mut sum = 0.0;
        for frame in &samples {
            let cage = solver.cages_after(previous.as_deref(), &[frame]).remove(0);
            sum += solver.decoder().measure(&[&cage], &[frame])[0].l2 / solver.diagonal();
            previous = Some(cage);
        }
        let measured = sum / samples.len() as f64;
        assert!((l2 / measured - 1.0).abs() < 1e-4, "{spectrum}: {l2} {measured}");
    }
    assert!(found.extra() <= 0.05);
}

#[test]
fn a_threshold_for_normals_that_follow_is_measured_on_the_cages_that_are_found() {
    let (capture, cage) = capture();
    let analysis = Analysis::new(&Green::Consistent, &cage, &capture.rest.points, &PrepareContext::default()).unwrap();
    let samples: Vec<Vec<f64>> = (0..4).map(|k| frame(&capture, 9 * k)).collect();
    let options = SolverOptions::PAPER;
    let handle_system = analysis.handle_system(options.handles).unwrap();
    let found = handle_system.choose_threshold(options, None, &samples, 0.2).unwrap();
    for &(spectrum, l2) in found.tried.iter().step_by(4) {
        let solver = analysis.solver(SolverOptions { spectrum, ..options }).unwrap();
        let error = |frame: &Vec<f64>| {
            let cage = solver.cages(&[frame]).remove(0);
            solver.decoder().measure(&[&cage], &[frame])[0].l2 / solver.diagonal()
        };
        let measured = samples.iter().map(error).sum::<f64>() / samples.len() as f64;
        assert!((l2 / measured - 1.0).abs() < 1e-9, "{spectrum}: {l2} {measured}");
    }
}

/// Mean value coordinates and, for every face, a direction: the mean of what its corners have, which moves nothing.
struct WithNormals;

impl CoordinateSystem for WithNormals {
    fn name(&self) -> &'static str {
        "with-normals"
    }
    fn values(&self, cage: &Cage) -> CageValues {
        let normals = cage.faces().iter().map(|_| [0.0, 0.0, 1.0]);
        CageValues { rest: cage.vertices().iter().copied().chain(normals).collect(), dependent_normals: None }
    }
    fn coordinates(
        &self,
        cage: &Cage,
        points: &[Point],
        _: Option<&ElementPlan>,
    ) -> Result<Coordinates, CoordinatesError> {
        let mut coordinates = MeanValue.coordinates(cage, points, None)?;
        let (v, f) = (cage.vertices().len(), cage.faces().len());
        let phi = &coordinates.phi;
        // Of the sum over all faces nothing is left, so that the rest pose is reproduced.
        let weight = |i: usize, face: usize| {
            let corners = cage.faces()[face].vertices;
            corners.iter().map(|&c| phi[(i, c as usize)]).product::<f64>().cbrt()
        };
        let wide = Mat::from_fn(points.len(), v + f, |i, j| {
            if j < v { phi[(i, j)] } else { weight(i, j - v) - weight(i, (j - v + 1) % f) }
        });
        coordinates.phi = wide;
        Ok(coordinates)
    }
}

#[test]
fn terms_know_cages_with_normals() {
    let (capture, cage) = capture();
    let (v, f) = (cage.vertices().len(), cage.faces().len());
    let delta = Regularizer::Laplacian.delta(None, &cage, v + f).unwrap();
    for i in 0..v + f {
        let sum: f64 = (0..v + f).map(|j| delta[(i, j)]).sum();
        assert!(sum.abs() < 1e-12, "row {i}: a constant is smooth");
    }
    let positions = frame(&capture, 6);
    for regularizer in [Regularizer::Laplacian, Regularizer::Differential, Regularizer::Matrix] {
        let own = own_term(v);
        let options = SolverOptions { regularizer, ..SolverOptions::PAPER };
        let solver = Solver::prepare_with(&WithNormals, &cage, &capture.rest.points, options, &with(&own)).unwrap();
        let found = solver.cages(&[&positions]);
        let error = solver.decoder().measure(&[&found[0]], &[&positions])[0];
        assert_eq!(solver.preparation().rank, v + f - 1, "the mean of all directions moves nothing");
        assert!(error.l2 < 0.05 * solver.diagonal(), "{regularizer:?}: {}", error.l2);
    }
}
