//! Models of more points than are analysed, and coordinates that are computed in parts.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_core::decode::{Decoder, FrameError};
use cager_core::inversion::{Handles, PrepareContext, Solver, SolverOptions};
use cager_core::spectral::Analysis;
use cager_demo::{Capture, Options};
use common::Cages;

fn capture(points: u32, cage_vertices: u32) -> (Capture, Cage) {
    let capture = Capture::new(&Options { points: points as usize, frames: 12, cage_vertices: cage_vertices as usize });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    (capture, cage)
}

fn frames(capture: &Capture) -> Vec<Vec<f64>> {
    let frame = |t: usize| {
        let mut frame = Vec::new();
        capture.frame(t, &mut frame);
        frame
    };
    [1, 4, 7].map(frame).to_vec()
}

fn errors(solver: &Solver, frames: &[Vec<f64>]) -> (Vec<Vec<f32>>, Vec<FrameError>) {
    let frames: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
    let cages = solver.cages(&frames);
    let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    let errors = solver.decoder().measure(&views, &frames);
    (cages, errors)
}

fn prepare(system: &dyn CoordinateSystem, (capture, cage): &(Capture, Cage), handles: Handles, keeps: bool) -> Solver {
    let options = SolverOptions { handles, ..SolverOptions::default() };
    let context =
        PrepareContext { stores_coordinates: keeps, analysed_entries: 8_000_000, ..PrepareContext::default() };
    Solver::prepare_with(system, cage, &capture.rest.points, options, &context).unwrap()
}

#[test]
fn decoders_that_compute_their_coordinates_have_the_bits_of_those_that_keep_them() {
    // Parts are whole blocks, and these are two and a bit.
    let (capture, cage) = capture(70_001, 200);
    let points = &capture.rest.points;
    for system in [&MeanValue as &dyn CoordinateSystem, &Green::Consistent] {
        let (pointwise, columns) = (system.pointwise().unwrap(), system.values(&cage).columns());
        let phi = system.coordinates(&cage, points, None).unwrap().phi;
        let decoders = [
            Decoder::new(phi.as_ref(), cage.vertices().len()),
            Decoder::with_stored_coordinates(pointwise, &cage, points, columns),
            Decoder::with_recomputed_coordinates(pointwise, &cage, points, columns),
        ];
        assert!(decoders[1].size_bytes() > 0 && decoders[2].size_bytes() == 0);
        let decoders = decoders.map(|decoder| decoder.with_dependent_normals(system.values(&cage).dependent_normals));
        let bent: Vec<f32> =
            cage.vertices().iter().flat_map(|p| [p[0] + 0.1 * p[1] * p[1], p[1], p[2]]).map(|x| x as f32).collect();
        let found = decoders.map(|decoder| {
            let mut out = vec![Vec::new()];
            decoder.decode(&[&bent], &mut out);
            (out, decoder.measure(&[&bent], &[&points.concat()]), decoder.largest_sum(&[&bent]))
        });
        assert!(found[0] == found[1] && found[0] == found[2], "{}", system.name());
        // The point that is named is the worst.
        let (out, errors, largest_sum) = &found[0];
        let distance =
            |(p, q): (&[f32], &[f64; 3])| (0..3).map(|k| (f64::from(p[k]) - q[k]).powi(2)).sum::<f64>().sqrt();
        let distances: Vec<f64> = out[0].chunks_exact(3).zip(points).map(distance).collect();
        let worst = distances.iter().copied().fold(0.0, f64::max);
        assert!((distances[errors[0].worst as usize] - worst).abs() < 1e-12 && (worst - errors[0].linf).abs() < 1e-12);
        // The sum of the sizes of what is added up for it, which is that of the decoder's columns only where these are all vertices.
        if columns == cage.vertices().len() {
            let centre = [0, 1, 2].map(|k| bent.iter().skip(k).step_by(3).sum::<f32>() / columns as f32);
            let of_axis = |k: usize| {
                let sizes: Vec<f64> = bent.chunks_exact(3).map(|row| f64::from((row[k] - centre[k]).abs())).collect();
                let sum = |row: faer::RowRef<'_, f64>| row.iter().zip(&sizes).map(|(x, size)| x.abs() * size).sum();
                phi.row_iter().map(sum).fold(0.0, f64::max)
            };
            let wanted = (0..3).map(of_axis).fold(0.0, f64::max);
            assert!((largest_sum / wanted - 1.0).abs() < 1e-4, "{largest_sum} {wanted}");
        }
    }
}

#[test]
fn a_sample_of_a_large_model_gives_nearly_the_errors_of_all_its_points() {
    let large = capture(75_000, 120);
    let frames = frames(&large.0);
    let whole = Analysis::new(&MeanValue, &large.1, &large.0.rest.points, &PrepareContext::default()).unwrap();
    for handles in [Handles::MaxVol, Handles::Spread { count: None }, Handles::All] {
        let options = SolverOptions { handles, ..SolverOptions::default() };
        let (_, wanted) = errors(&whole.solver(options).unwrap(), &frames);
        let [kept, computed] = [true, false].map(|keeps| prepare(&MeanValue, &large, handles, keeps));
        assert_eq!(kept.handles(), computed.handles());
        assert!(!kept.reads_all() && kept.handles().iter().any(|&point| point > 72_000), "{handles:?}");
        let both = errors(&kept, &frames);
        assert_eq!(both, errors(&computed, &frames));
        let (_, found) = both;
        // Other rows of maximum volume are as good as these, within what their choice leaves open.
        let most = if handles == Handles::MaxVol { 1.2 } else { 1.01 };
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!(found.l2 < most * wanted.l2, "{handles:?}: {} {}", found.l2, wanted.l2);
        }
    }
}

#[test]
fn normals_that_follow_are_found_from_a_sample() {
    let large = capture(75_000, 120);
    let frames = frames(&large.0);
    let [kept, computed] = [true, false].map(|keeps| prepare(&Green::Consistent, &large, Handles::default(), keeps));
    let found = errors(&kept, &frames);
    assert_eq!(found, errors(&computed, &frames));
    for error in found.1 {
        assert!(error.l2 < 1e-2 * kept.diagonal(), "{}", error.l2);
    }
}

#[test]
fn a_small_part_with_a_cage_of_its_own_is_as_well_determined_as_without_a_large_model_beside_it() {
    let (mut model, cage) = capture(75_000, 120);
    let far = |p: [f64; 3]| [p[0] + 40.0, p[1], p[2]];
    let corners =
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mut mesh = cage.mesh().clone();
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(corners.map(far));
    mesh.triangles.extend(faces.map(|face| face.map(|v: u32| v + first)));
    let both = Cage::new(mesh).unwrap();
    // Twelve points where a sample takes every second one of the model's.
    let part = corners.iter().flat_map(|c| [0.3, 0.5].map(|s| far([s * c[0] + 0.1, s * c[1] + 0.05, s * c[2]])));
    model.rest.points.extend(part);
    let solver = prepare(&MeanValue, &(model, both), Handles::default(), true);
    let found = solver.preparation();
    assert_eq!(found.rank, solver.decoder().unknowns());
    assert!(
        found.condition_full < 1e4 && found.condition_handles < 1e4,
        "{} {}",
        found.condition_full,
        found.condition_handles
    );
}
