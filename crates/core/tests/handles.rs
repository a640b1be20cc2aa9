//! Choices of handles on the built-in capture.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_core::inversion::{Handles, PrepareError, Solver, SolverOptions};
use cager_core::regularize::Regularizer;
use cager_demo::{Capture, Options};
use cager_geometry::mesh::Point;
use common::Cages;

const CHOICES: [Handles; 6] = [
    Handles::MaxVol,
    Handles::Rectangular { count: None },
    Handles::Spread { count: None },
    Handles::Spread { count: Some(150) },
    Handles::Spread { count: Some(1_200) },
    Handles::All,
];

fn capture() -> (Capture, Cage) {
    capture_of(2_000, 100)
}

fn capture_of(points: usize, cage_vertices: usize) -> (Capture, Cage) {
    let capture = Capture::new(&Options { points, frames: 40, cage_vertices });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    (capture, cage)
}

fn prepare(capture: &Capture, cage: &Cage, handles: Handles) -> Solver {
    let options = SolverOptions { handles, regularizer: Regularizer::None, ..SolverOptions::PAPER };
    Solver::prepare(&MeanValue, cage, &capture.rest.points, options).unwrap()
}

fn mean_l2(capture: &Capture, solver: &Solver) -> f64 {
    let error = |t: usize| {
        let mut frame = Vec::new();
        capture.frame(t, &mut frame);
        let cage = solver.cages(&[&frame]).remove(0);
        solver.decoder().measure(&[&cage], &[&frame])[0].l2 / solver.diagonal()
    };
    (0..10).map(|k| error(4 * k)).sum::<f64>() / 10.0
}

fn farthest(cage: &[f32], truth: &[Point]) -> f64 {
    let apart = |(a, b): (&[f32], &Point)| (0..3).map(|k| (f64::from(a[k]) - b[k]).powi(2)).sum::<f64>().sqrt();
    cage.chunks_exact(3).zip(truth).map(apart).fold(0.0, f64::max)
}

#[test]
fn affine_maps_of_the_model_are_affine_maps_of_the_cage() {
    let (capture, cage) = capture();
    let maps: [fn(Point) -> Point; 4] = [
        |p| p,
        |p| [2.0 * p[0] + 0.3 * p[1], p[1] - 0.2 * p[2], 0.5 * p[2] + p[0]],
        |p| [-p[1] + 7.0, p[0] - 3.0, p[2] + 40.0],
        |p| [0.01 * p[0], 0.01 * p[1], -3.0 * p[2]],
    ];
    for handles in CHOICES {
        let solver = prepare(&capture, &cage, handles);
        for (k, map) in maps.into_iter().enumerate() {
            let moved: Vec<f64> = capture.rest.points.iter().flat_map(|&p| map(p)).collect();
            let wanted: Vec<Point> = cage.vertices().iter().map(|&p| map(p)).collect();
            let found = solver.cages(&[&moved]);
            let apart = farthest(&found[0], &wanted) / solver.diagonal();
            assert!(apart < 4e-6, "{handles:?}, map {k}: {apart:e}");
        }
    }
}

#[test]
fn more_handles_that_are_spread_come_closer_to_all_points() {
    let (capture, cage) = capture();
    let l2 = |handles| mean_l2(&capture, &prepare(&capture, &cage, handles));
    let (maxvol, rectangular, all) = (l2(Handles::MaxVol), l2(Handles::Rectangular { count: None }), l2(Handles::All));
    let spread = [150, 200, 400, 1_200].map(|count| l2(Handles::Spread { count: Some(count) }));
    assert!(all < rectangular && rectangular < maxvol, "{all} {rectangular} {maxvol}");
    assert!(spread.is_sorted_by(|a, b| a > b), "{spread:?}");
    assert!(spread[1] < 1.12 * all && all <= spread[3] * (1.0 + 1e-6), "{spread:?} {all}");
}

#[test]
fn as_few_handles_as_unknowns_are_those_of_maximum_volume_and_as_many_as_points_are_all() {
    let (capture, cage) = capture_of(800, 60);
    let (m, n) = (cage.vertices().len(), capture.rest.points.len());
    let mut frame = Vec::new();
    capture.frame(9, &mut frame);
    let invert = |handles| prepare(&capture, &cage, handles).cages(&[&frame]).remove(0);
    let (maxvol, all) = (invert(Handles::MaxVol), invert(Handles::All));
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(near(&invert(Handles::Spread { count: Some(m) }), &maxvol));
    assert!(near(&invert(Handles::Rectangular { count: Some(m) }), &maxvol));
    assert!(near(&invert(Handles::Spread { count: Some(n) }), &all));
    assert!(near(&invert(Handles::Rectangular { count: Some(n) }), &all));
}

#[test]
fn handles_begin_with_those_of_maximum_volume_and_none_comes_twice() {
    let (capture, cage) = capture();
    let m = cage.vertices().len();
    let maxvol = prepare(&capture, &cage, Handles::MaxVol);
    for handles in [Handles::Rectangular { count: Some(333) }, Handles::Spread { count: Some(333) }] {
        let solver = prepare(&capture, &cage, handles);
        assert_eq!(solver.handles().len(), 333);
        assert_eq!(&solver.handles()[..m], maxvol.handles());
        let mut sorted = solver.handles().to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), 333);
        let found = solver.preparation();
        assert_eq!(found.maxvol.log_volume, maxvol.preparation().maxvol.log_volume);
        assert!(found.condition_handles >= 1.0 && found.condition_handles < 2.0 * found.condition_full);
    }
}

#[test]
fn too_few_and_too_many_handles_are_refused() {
    let (capture, cage) = capture();
    let (unknowns, points) = (cage.vertices().len(), capture.rest.points.len());
    for count in [0, unknowns - 1, points + 1, usize::MAX] {
        for handles in [Handles::Rectangular { count: Some(count) }, Handles::Spread { count: Some(count) }] {
            let options = SolverOptions { handles, ..SolverOptions::PAPER };
            let error = Solver::prepare(&MeanValue, &cage, &capture.rest.points, options).unwrap_err();
            assert_eq!(error, PrepareError::HandleCount { count, unknowns, points });
        }
    }
    assert_eq!(Handles::Spread { count: None }.count(150, 100), 150, "no more than there are");
}

#[test]
fn coincident_points_do_not_disturb_what_is_interpolated() {
    let (mut capture, cage) = capture();
    let n = capture.rest.points.len();
    capture.rest.points.extend_from_within(..500);
    let handles = Handles::Spread { count: Some(n + 100) };
    let solver = prepare(&capture, &cage, handles);
    let moved: Vec<f64> = capture.rest.points.iter().flat_map(|p| [p[0] * 1.5, p[1], p[2] - p[0]]).collect();
    let found = solver.cages(&[&moved]);
    let error = solver.decoder().measure(&[&found[0]], &[&moved])[0];
    assert!(error.linf < 1e-5 * solver.diagonal(), "{}", error.linf);
}
