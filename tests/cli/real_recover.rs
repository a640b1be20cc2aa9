//! Real captures recovered from surfaces drawn anew in every frame, whose true motion is known; and real scans.

use crate::real_data::data;
use crate::recover::ply;
use crate::support::{Dir, measure, read_frames};
use cager_formats::{open_frames, read_model};
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_registration::{Observation, ObservationOptions};
use std::path::Path;

/// Recovers every `step`th frame of a capture from 15,000 points each, with the first as the template. Root mean square errors of the frames, as shares of the
/// diagonal, and of their second differences in time.
fn recovered(folder: &Path, frames: usize, step: usize) -> (Vec<f64>, f64) {
    let rest = read_model(&folder.join("rest.obj")).expect("a rest pose");
    let mut reader = open_frames(folder.join("frames.npy"), rest.points.len()).expect("frames");
    let (dir, mut truth, mut frame) = (Dir::new(), Vec::new(), Vec::new());
    for t in 0..frames {
        reader.read_next(&mut frame).expect("a frame");
        if t % step == 0 {
            let mesh = TriMesh { vertices: frame.as_chunks().0.to_vec(), ..TriMesh::from(&rest) };
            let options = ObservationOptions { points: 15_000, seed: 5000 + t as u64 };
            let (seen, _) = Observation::of_mesh(&mesh.vertices, &mesh.triangles, &options).expect("a surface");
            dir.write(&format!("scan_{:04}.ply", truth.len()), ply(&seen, true));
            truth.push(frame.clone());
        }
    }
    let template = Model { points: truth[0].as_chunks().0.to_vec(), ..rest };
    dir.model("rest.obj", &template);
    let said = dir.cager("recover --template rest.obj --frames scan_*.ply -o out.cager").succeeds();
    assert!(said.stdout.contains(" 0 lost"), "{}", said.stdout);
    dir.cager("decode out.cager -o out.npy").succeeds();
    let found = read_frames(&dir.path("out.npy"), template.points.len());
    let errors = measure(&template.points, &truth, &found).l2;
    let off: Vec<Vec<f64>> =
        found.iter().zip(&truth).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect();
    let seconds: Vec<f64> = off
        .windows(3)
        .flat_map(|w| (0..w[0].len()).map(|i| w[0][i] - 2.0 * w[1][i] + w[2][i]).collect::<Vec<_>>())
        .collect();
    let points: &[Point] = seconds.as_chunks().0;
    let mean = points.iter().map(|p| p.iter().map(|x| x * x).sum::<f64>()).sum::<f64>() / points.len() as f64;
    let jitter = mean.sqrt() / cager_geometry::mesh::diagonal(&template.points);
    (errors, jitter)
}

fn mean(errors: &[f64]) -> f64 {
    errors[1..].iter().sum::<f64>() / (errors.len() - 1) as f64
}

#[test]
#[ignore = "needs the captures: make captures"]
fn the_dancer_the_walk_and_the_horse_are_recovered_within_their_bounds() {
    for (name, frames, step, bound, worst) in [
        ("samba", 60, 1, 0.0060, 0.014),
        ("samba", 120, 2, 0.0065, 0.014),
        ("makehuman-cmu-walk", 73, 2, 0.0045, 0.009),
        ("horse-gallop", 48, 1, 0.0065, 0.014),
    ] {
        let (errors, jitter) = recovered(&data().join(name), frames, step);
        assert!(
            mean(&errors) <= bound && errors.iter().all(|&error| error <= worst),
            "{name} every {step}: {errors:?}"
        );
        assert!(step > 1 || name != "samba" || jitter <= 0.003, "{name}: {jitter}");
    }
}

#[test]
#[ignore = "needs the captures: make captures"]
fn scans_of_a_dancer_are_met_and_met_closer_with_offsets() {
    let folder = data().join("scans-dancer");
    let dir = Dir::new();
    let line = |rest: &str| format!("recover {rest} -o out.cager --overwrite --report report.json --template");
    for (rest, bound) in [("", 0.0007), ("--offsets --max-error 1e-3", 0.0004)] {
        let frames = folder.join("dancer_fr000*.ply");
        dir.cager(&line(rest)).arg(folder.join("dancer_fr0005.ply")).arg("--frames").arg(&frames).succeeds();
        let report = dir.json("report.json");
        let mean = |key: &str| report[key].as_f64().expect("a distance");
        assert!(mean("from_surface") <= bound, "{rest}: {report}");
        assert!(report["lost"].as_array().is_some_and(Vec::is_empty));
    }
}
