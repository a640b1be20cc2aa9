//! What is chosen where nothing is said, and what a first encoding tells.

use crate::real_data::{cage_of, data};
use crate::support::Dir;
use cager_core::coordinates::{CoordinateSystem, Green, Harmonic, MeanValue};
use cager_core::inversion::{Rows, Solver, SolverOptions};
use cager_formats::read_model;
use std::fs;

const SYSTEMS: [&str; 4] = ["mvc", "harmonic", "green", "green-free"];

#[test]
fn points_are_spread_and_the_end_of_the_spectrum_keeps_the_shape_of_the_rest_cage() {
    let (dir, _) = Dir::with_capture();
    dir.cager(
        "encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite --report report.json",
    )
    .succeeds();
    let report = dir.json("report.json");
    let unknowns = report["unknowns"].as_u64().expect("unknowns");
    assert_eq!((&report["handles"], &report["regularizer"]), (&"spread".into(), &"differential".into()));
    assert_eq!(report["handle_indices"].as_array().map(Vec::len), Some(2 * unknowns as usize));
    assert_eq!(report["spectrum"].as_u64(), Some(20.min(unknowns / 16)));
}

#[test]
fn a_frame_that_equals_the_rest_pose_gives_the_rest_cage() {
    let (dir, _) = Dir::with_capture();
    fs::create_dir(dir.path("only")).expect("a folder");
    fs::copy(dir.path("rest.obj"), dir.path("only/1.obj")).expect("a frame");
    for system in SYSTEMS {
        let encode =
            "encode --rest rest.obj --cage cage.obj --frames only -o out.cager --overwrite --report report.json";
        dir.cager(&format!("{encode} --coordinates {system}")).succeeds();
        let largest = dir.json("report.json")["error"]["linf_max"].as_f64().expect("an error");
        assert!(largest <= 1e-6, "{system}: {largest:e}");
    }
}

/// With the cages that artists made.
#[test]
#[ignore = "needs the captures: make captures"]
fn a_rest_pose_of_the_pairs_gives_its_cage() {
    let root = data();
    let mut compared = 0;
    for pair in ["cagelabweb_armadillo", "pgc_hand", "pgc_octopus", "qmvc_beast", "qmvc_ogre"] {
        let folder = root.join("pairs").join(pair);
        let (rest, cage) = (read_model(&folder.join("mesh.obj")).expect("a model"), cage_of(&folder.join("cage.obj")));
        let systems: [&dyn CoordinateSystem; 4] = [&MeanValue, &Harmonic, &Green::Consistent, &Green::Free];
        for system in systems {
            let options = SolverOptions::for_unknowns(system.values(&cage).unknowns());
            let frame: Vec<f64> = rest.points.iter().flatten().copied().collect();
            let solver = match Solver::prepare(system, &cage, &rest.points, options) {
                Ok(solver) => solver,
                // Harmonic coordinates are of points inside, and Green's of cages that do not outnumber the points.
                Err(error) => {
                    eprintln!("{pair}, {}: {error}", system.name());
                    continue;
                }
            };
            let cage = solver.invert(Rows::All, None, &[&frame]).remove(0).cage;
            let error = solver.decoder().measure(&[&cage], &[&frame])[0].linf / solver.diagonal();
            assert!(error <= 1e-6, "{pair}, {}: {error:e}", system.name());
            compared += 1;
        }
    }
    assert!(compared >= 12, "{compared} of 20");
}

#[test]
fn the_worst_frame_and_point_are_named_with_their_distance_in_the_unit_of_the_files() {
    let (dir, small) = Dir::with_capture();
    let said = dir
        .cager(
            "encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite --report report.json",
        )
        .succeeds();
    let report = dir.json("report.json");
    let (worst, diagonal) = (&report["error"]["worst"], report["diagonal"].as_f64().expect("a diagonal"));
    let number = |key: &str| worst[key].as_u64().expect(key) as usize;
    let (frame, point) = (number("frame"), number("point"));
    let distance = worst["distance"].as_f64().expect("a distance");
    let per_frame = report["error"]["per_frame"][frame]["linf"].as_f64().expect("an error");
    assert_eq!(Some(per_frame), report["error"]["linf_max"].as_f64());
    assert!((distance - per_frame * diagonal).abs() <= 1e-6 * distance, "{worst}");
    assert!(said.stdout.contains(&format!("point {point} of frame {frame}: off by ")), "{}", said.stdout);

    dir.cager("decode out.cager -o back.npy").succeeds();
    let found = crate::support::read_frames(&dir.path("back.npy"), small.rest.points.len());
    let off = |k: usize| found[frame][3 * point + k] - small.frames[frame][3 * point + k];
    let measured = (0..3).map(|k| off(k).powi(2)).sum::<f64>().sqrt();
    assert!((measured - distance).abs() <= 1e-5 * diagonal, "{measured} where {distance} was reported");
}
