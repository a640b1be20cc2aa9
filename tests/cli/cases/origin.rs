//! Coordinates far away from the origin.

use crate::refused::assert_sentence;
use crate::support::{Dir, ENCODE, largest, measure, npy_f64, read_frames};
use cager_formats::read_model;
use cager_geometry::mesh::{Model, Point};

const CASE: &str = "07-utm-coordinates";

/// The case, the points of its rest pose and its frames.
fn case() -> (Dir, Vec<Point>, Vec<Vec<f64>>) {
    let dir = Dir::with_case(CASE);
    let rest = read_model(&dir.path("rest.obj")).expect("a rest pose").points;
    let frames = read_frames(&dir.path("frames.npy"), rest.len());
    (dir, rest, frames)
}

/// The largest error of any point, over the diagonal, of decoded frames.
fn error(dir: &Dir, name: &str, rest: &[Point], truth: &[Vec<f64>]) -> f64 {
    largest(&measure(rest, truth, &read_frames(&dir.path(name), rest.len())).linf)
}

fn reported(dir: &Dir, name: &str) -> f64 {
    dir.json(name)["error"]["linf_max"].as_f64().expect("an error")
}

/// The same capture near the origin of its coordinates, to be compared with.
fn near(dir: &Dir) -> Dir {
    let near = Dir::new();
    let rest = read_model(&dir.path("rest.obj")).expect("a rest pose");
    let origin = rest.points[0].map(f64::round);
    let moved = |points: &[Point]| points.iter().map(|p| [0, 1, 2].map(|k| p[k] - origin[k])).collect::<Vec<_>>();
    for name in ["rest.obj", "cage.obj"] {
        let model = read_model(&dir.path(name)).expect(name);
        near.model(name, &Model { points: moved(&model.points), ..model });
    }
    let frames = read_frames(&dir.path("frames.npy"), rest.points.len());
    let frames: Vec<Vec<f64>> = frames.iter().map(|frame| moved(frame.as_chunks().0).concat()).collect();
    near.write("frames.npy", npy_f64(&frames));
    near
}

#[test]
fn a_capture_in_utm_metres_is_as_exact_as_one_near_the_origin() {
    let (dir, rest, frames) = case();
    let near = near(&dir);
    for options in ["", " --quality standard", " --quality preview", " --max-error 1e-4", " --target-size 40KB"] {
        let line = format!("{ENCODE} --report report.json{options}");
        let done = dir.cager(&line).succeeds();
        assert_eq!(done.stderr, "", "{options}");
        near.cager(&line).succeeds();
        let (here, there) = (reported(&dir, "report.json"), reported(&near, "report.json"));
        assert!(here < 1.05 * there + 1e-6, "{options}: {here} where {there} is expected");
        dir.cager("decode out.cager -o back.npy --overwrite").succeeds();
        let found = error(&dir, "back.npy", &rest, &frames);
        assert!((found / here - 1.0).abs() < 1e-3, "{options}: {found} where {here} is reported");
    }
    // A bound is kept, by the frames as they were given.
    dir.cager(&format!("{ENCODE} --max-error 1e-4")).succeeds();
    dir.cager("decode out.cager -o back.npy --overwrite").succeeds();
    assert!(error(&dir, "back.npy", &rest, &frames) <= 1e-4);
}

#[test]
fn the_origin_is_told_and_formats_that_would_lose_it_are_refused() {
    let (dir, rest, frames) = case();
    dir.cager(&format!("{ENCODE} --report report.json")).succeeds();
    let bound = 1.001 * reported(&dir, "report.json");
    for output in ["back.npy", "obj", "ply/*.ply"] {
        dir.cager("decode out.cager -o").arg(output).succeeds();
        let name = output.trim_end_matches("/*.ply");
        assert!(error(&dir, name, &rest, &frames) <= bound, "{output}");
    }
    for output in ["back.pc2", "back.mdd"] {
        let line = format!("decode out.cager -o {output}");
        let done = dir.cager(&line).run();
        assert_eq!(done.status, Some(1));
        assert_sentence(&line, &done.stderr, &[output, "single precision", ".npy"]);
        assert!(!dir.path(output).exists());
    }
    let origin = &dir.json("report.json")["origin"];
    assert!(origin.as_array().is_some_and(|o| o.iter().all(|x| x.as_f64().is_some_and(|x| x.fract() == 0.0))));
    let json: serde_json::Value =
        serde_json::from_str(&dir.cager("inspect --json out.cager").succeeds().stdout).expect("JSON");
    assert_eq!(&json["origin"], origin);
    let text = dir.cager("inspect out.cager").succeeds().stdout;
    assert!(text.contains(&format!("  origin    {}", origin[0].as_f64().expect("a number"))), "{text}");
}

#[test]
fn cages_go_out_and_come_in_where_the_capture_is() {
    let (dir, rest, frames) = case();
    dir.cager(ENCODE).succeeds();
    dir.cager("decode out.cager -o back.npy").succeeds();
    dir.cager("decode out.cager --cages -o cages.npy").succeeds();
    // The rest cage is the one that was given.
    let (given, written) = (read_model(&dir.path("cage.obj")), read_model(&dir.path("cages.cage.obj")));
    assert_eq!(given.expect("a cage").points, written.expect("a cage").points);
    dir.cager("edit out.cager --with-cages cages.npy -o edited.cager").succeeds();
    dir.cager("decode edited.cager -o edited.npy").succeeds();
    dir.cager("decode out.cager --with-cages cages.npy -o with.npy").succeeds();
    let back = read_frames(&dir.path("back.npy"), rest.len());
    for name in ["edited.npy", "with.npy"] {
        assert!(error(&dir, name, &rest, &back) < 1e-6, "{name}");
    }
    // Another model, here every second point of the same.
    let some = Model { points: rest.iter().copied().step_by(2).collect(), ..Model::default() };
    dir.model("some.ply", &some);
    let done = dir.cager("decode out.cager --model some.ply -o some.npy").succeeds();
    assert_eq!(done.stderr, "");
    let half = |frame: &Vec<f64>| frame.as_chunks::<3>().0.iter().step_by(2).copied().collect::<Vec<_>>().concat();
    let expected: Vec<Vec<f64>> = back.iter().map(half).collect();
    assert!(error(&dir, "some.npy", &some.points, &expected) < 1e-6);
    assert_eq!(frames.len(), expected.len());
}

#[test]
fn designing_comparing_and_other_units_work_far_away_too() {
    let (dir, rest, frames) = case();
    dir.cager("encode --rest rest.obj --frames frames.npy -o own.cager --cage-vertices 40 --report own.json")
        .succeeds();
    dir.cager("decode own.cager -o own.npy").succeeds();
    let (found, told) = (error(&dir, "own.npy", &rest, &frames), reported(&dir, "own.json"));
    assert!(told < 0.05 && (found / told - 1.0).abs() < 1e-3, "{found} {told}");
    let line = "compare --rest rest.obj --cage cage.obj --frames frames.npy -o c.html --json c.json --coordinates mvc --frames-at-most 3";
    dir.cager(line).succeeds();
    // In millimetres, and a part of it that is small.
    for (scale, name) in [(1000.0, "mm"), (1e-3, "km")] {
        let other = Dir::new();
        let scaled = |points: &[Point]| points.iter().map(|p| p.map(|x| scale * x)).collect::<Vec<_>>();
        for file in ["rest.obj", "cage.obj"] {
            let model = read_model(&dir.path(file)).expect(file);
            other.model(file, &Model { points: scaled(&model.points), ..model });
        }
        let frames: Vec<Vec<f64>> = frames.iter().map(|frame| scaled(frame.as_chunks().0).concat()).collect();
        other.write("frames.npy", npy_f64(&frames));
        other.cager(&format!("{ENCODE} --max-error 1e-4")).succeeds();
        other.cager("decode out.cager -o back.npy").succeeds();
        let rest = scaled(&rest);
        assert!(error(&other, "back.npy", &rest, &frames) <= 1.0001e-4, "{name}");
    }
}

#[test]
fn frames_that_came_in_single_precision_are_told_from_double_ones() {
    let (dir, _, frames) = case();
    dir.frames("single.npy", &frames);
    let line = "encode --rest rest.obj --cage cage.obj --frames single.npy -o single.cager --force";
    let said = dir.cager(line).succeeds().stderr;
    assert!(said.contains("warning: single.npy: its frames are in single precision"), "{said}");
    assert!(said.contains("float64"), "{said}");
}

#[test]
fn formats_of_single_precision_are_written_where_they_lose_nothing_that_is_seen() {
    let (dir, rest, frames) = case();
    // Some hundred diagonals away instead of millions.
    let other = Dir::new();
    let origin = [449_500.0, 5_400_000.0, 300.0];
    let moved = |points: &[Point]| points.iter().map(|p| [0, 1, 2].map(|k| p[k] - origin[k])).collect::<Vec<_>>();
    for file in ["rest.obj", "cage.obj"] {
        let model = read_model(&dir.path(file)).expect(file);
        other.model(file, &Model { points: moved(&model.points), ..model });
    }
    let frames: Vec<Vec<f64>> = frames.iter().map(|frame| moved(frame.as_chunks().0).concat()).collect();
    other.write("frames.npy", npy_f64(&frames));
    other.cager(&format!("{ENCODE} --max-error 1e-3 --report report.json")).succeeds();
    assert!(other.json("report.json")["origin"].is_array());
    for output in ["back.npy", "back.pc2", "back.mdd"] {
        other.cager(&format!("decode out.cager -o {output}")).succeeds();
        assert!(error(&other, output, &moved(&rest), &frames) < 1.1e-3, "{output}");
    }
}

#[test]
fn a_capture_near_the_origin_has_none() {
    let (dir, _) = Dir::with_encoded();
    assert!(dir.json("report.json").get("origin").is_none());
    assert!(!dir.read("out.cager").windows(4).any(|bytes| bytes == b"ORIG"));
}
