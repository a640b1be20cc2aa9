//! Real captures recovered from surfaces drawn anew in every frame, whose true motion is known; and real scans.

use crate::real_data::data;
use crate::recover::ply;
use crate::refused::refused;
use crate::support::{Dir, measure, read_frames};
use cager_formats::{open_frames, read_model};
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_shape::registration::{Observation, ObservationOptions};
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

#[test]
#[ignore = "needs the captures: make captures"]
fn a_walk_that_is_followed_by_a_rig_has_its_gait_in_report_and_picture() {
    let (folder, dir) = (data().join("makehuman-cmu-walk"), Dir::new());
    let rest = read_model(&folder.join("rest.obj")).expect("a rest pose");
    let mut reader = open_frames(folder.join("frames.npy"), rest.points.len()).expect("frames");
    let mut frame = Vec::new();
    for t in 0..12 {
        reader.read_next(&mut frame).expect("a frame");
        let mesh = TriMesh { vertices: frame.as_chunks().0.to_vec(), ..TriMesh::from(&rest) };
        let options = ObservationOptions { points: 4000, seed: t };
        let (seen, _) = Observation::of_mesh(&mesh.vertices, &mesh.triangles, &options).expect("a surface");
        dir.write(&format!("scan_{t:04}.ply"), ply(&seen, true));
    }
    dir.model("rest.obj", &rest);
    dir.cager("rig rest.obj -o rig.json").succeeds();
    let clip = data().join("bvh/02_02.bvh");
    dir.cager("manifold --rig rig.json --dims 5 --poses 40 -o poses.json").arg(clip).succeeds();
    let line = "recover --template rest.obj --frames scan_*.ply --rig rig.json --manifold poses.json --points 3000 -o out.cager";
    refused(&dir, &format!("{line} --gait gait.png"), &["gait.png", ".svg"]);
    dir.cager(&format!("{line} --report report.json --gait gait.svg --fps 30")).succeeds();
    let report = dir.json("report.json");
    let curves = report["gait"].as_array().expect("curves");
    let heights =
        |k: usize| curves[k]["heights"].as_array().expect("heights").iter().filter_map(serde_json::Value::as_f64);
    assert_eq!((curves.len(), curves[1]["joint"].as_str(), heights(1).count()), (4, Some("right ankle"), 12));
    let lowest = (0..4).flat_map(heights).fold(f64::INFINITY, f64::min);
    assert!(lowest == 0.0 && heights(0).chain(heights(1)).all(|height| height > 0.0), "{report}");
    let svg = String::from_utf8(dir.read("gait.svg")).expect("text");
    assert_eq!(
        (svg.matches("<polyline").count(), svg.contains(">seconds</text>"), svg.contains("NaN")),
        (4, true, false)
    );
    // What was recovered tells where its joints are.
    let said = dir.cager("rig rest.obj --rig rig.json --motion out.cager -o corrected.json").succeeds();
    assert!(said.stdout.contains("joints moved") && said.stdout.contains("knee by"), "{}", said.stdout);
    let joint = |rig: &str, quad: usize| dir.json(rig)["quads"][quad]["joint"].clone();
    assert!(joint("rig.json", 10) != joint("corrected.json", 10) && joint("rig.json", 0) == joint("corrected.json", 0));
    dir.model("less.obj", &Model { points: rest.points[1..].to_vec(), ..Model::default() });
    refused(
        &dir,
        "rig less.obj --rig rig.json --motion out.cager -o none.json",
        &["out.cager", "less.obj", "this template"],
    );
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
