//! The motion of one model on another: `transfer`.

mod bad_input;

use crate::refused::refused;
use crate::support::{Dir, Small, as_model, mean, measure, read_frames};
use crate::transfer::{centres, remeshed};
use cager_capture::decode;
use cager_geometry::mesh::{Model, Point};

// Small cages are soon designed.
const TRANSFER: &str = "transfer --source-rest rest.obj --source-frames frames.npy --target copy.obj -o moved.cager --align none --cage-vertices 60";

/// The small capture, and the figure with other points and faces as `copy.obj`.
fn with_copy() -> (Dir, Small, Model) {
    let (dir, small) = Dir::with_capture();
    let copy = remeshed(&small.rest);
    dir.model("copy.obj", &copy);
    (dir, small, copy)
}

/// Mean L2 of `moved.cager`, as a share of that of a copy that stays as it is.
fn error(dir: &Dir, small: &Small, copy: &Model) -> f64 {
    dir.cager("decode moved.cager -o moved.npy --overwrite").succeeds();
    let found = read_frames(&dir.path("moved.npy"), copy.points.len());
    let truth: Vec<Vec<f64>> = small.frames.iter().map(|f| [f.clone(), centres(&small.rest, f)].concat()).collect();
    let unmoved = vec![copy.points.as_flattened().to_vec(); truth.len()];
    mean(&measure(&copy.points, &truth, &found).l2) / mean(&measure(&copy.points, &truth, &unmoved).l2)
}

/// Frame rate and frame numbers of `moved.cager`.
fn timing(dir: &Dir) -> (Option<f64>, Vec<f64>) {
    let mut container = decode::open(&dir.path("moved.cager")).expect("a container");
    (container.header().frame_rate, container.frame_numbers().expect("numbers"))
}

#[test]
fn a_model_with_another_mesh_takes_the_motion_from_frames_and_from_a_container() {
    let (dir, small, copy) = with_copy();
    let said = dir.cager(&format!("{TRANSFER} --report report.json")).succeeds();
    assert!(said.stdout.starts_with("moved.cager: 20 frames of 1,221 points as cages of "), "{}", said.stdout);
    let found = error(&dir, &small, &copy);
    assert!(found < 0.15, "{found} of unmoved");
    let report = dir.json("report.json");
    assert_eq!((report["method"].as_str(), report["frames"].as_u64()), (Some("fitted"), Some(20)));
    assert_eq!((report["scale"].as_f64(), report["points"].as_u64()), (Some(1.0), Some(1221)));
    // What is printed is what is reported.
    let number = |of: &serde_json::Value| of.as_f64().expect("a number");
    let quality = &report["quality"];
    assert!(number(&report["score"]) < 0.02, "{report}");
    assert!(number(&quality["folded"]) < 0.005 && number(&quality["stretched"]) < 0.1, "{quality}");
    assert!((0.8..1.25).contains(&number(&quality["jitter"])), "{quality}");
    for words in [
        format!("{:.2} % folded", 100.0 * number(&quality["folded"])),
        format!("{:.2} % stretched", 100.0 * number(&quality["stretched"])),
        format!("jitter {:.2} times", number(&quality["jitter"])),
    ] {
        assert!(said.stdout.contains(&words), "{words} is missing in {}", said.stdout);
    }
    // The same on any number of threads.
    let first = dir.read("moved.cager");
    dir.cager(&format!("{TRANSFER} --overwrite --threads 1")).succeeds();
    assert!(dir.read("moved.cager") == first, "another number of threads gives another file");

    dir.cager("encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager").succeeds();
    dir.cager(
        "transfer --source out.cager --target copy.obj -o moved.cager --align none --cage-vertices 60 --overwrite",
    )
    .succeeds();
    let found = error(&dir, &small, &copy);
    assert!(found < 0.15, "{found} of unmoved");
}

#[test]
fn the_target_has_the_rate_and_the_numbers_of_the_sources_frames_or_those_that_are_given() {
    let (dir, ..) = with_copy();
    let counted = |first: u32, step: u32| -> Vec<f64> { (0..5).map(|k| f64::from(first + step * k)).collect() };
    dir.cager("encode --rest rest.obj --cage cage.obj --frames frames.npy --frames-range 0-4 --fps 12.5 --start 101 -o out.cager")
        .succeeds();
    dir.cager("transfer --source out.cager --target copy.obj -o moved.cager --align none --cage-vertices 60")
        .succeeds();
    assert_eq!(timing(&dir), (Some(12.5), counted(101, 1)));
    let line =
        "transfer --source out.cager --target copy.obj -o moved.cager --align none --cage-vertices 60 --overwrite";
    dir.cager(&format!("{line} --fps 30 --start 7")).succeeds();
    assert_eq!(timing(&dir), (Some(30.0), counted(7, 1)));

    dir.cager("decode out.cager -o walk/walk.%04d.obj").succeeds();
    let line = "transfer --source-rest rest.obj --source-frames walk --target copy.obj -o moved.cager --align none --cage-vertices 60 --overwrite";
    dir.cager(line).succeeds();
    assert_eq!(timing(&dir).1, counted(101, 1));
    dir.cager(&format!("{line} --fps 25 --start 3")).succeeds();
    assert_eq!(timing(&dir), (Some(25.0), counted(3, 1)));
    std::fs::remove_file(dir.path("walk/walk.0103.obj")).expect("a frame");
    refused(&dir, line, &["walk", "103", "missing", "--allow-gaps"]);
}

#[test]
fn a_matrix_says_where_the_source_lies_on_the_target() {
    let (dir, small, copy) = with_copy();
    let place = |&[x, y, z]: &Point| [3.0 - 2.0 * y, 2.0 * x, 2.0 * z];
    dir.model("copy.obj", &Model { points: copy.points.iter().map(place).collect(), ..copy.clone() });
    let line = TRANSFER.replace(" --align none", "");
    dir.cager(&format!("{line} --align 0,-2,0,3,2,0,0,0,0,0,2,0,0,0,0,1 --report report.json")).succeeds();
    let report = dir.json("report.json");
    let number = |name: &str| report[name].as_f64().expect("a number");
    assert!((number("scale") - 2.0).abs() < 1e-9 && (number("turned_degrees") - 90.0).abs() < 1e-6, "{report}");
    dir.cager("decode moved.cager -o moved.npy").succeeds();
    let found = read_frames(&dir.path("moved.npy"), copy.points.len());
    let truth = small.frames.iter().map(|f| [f.clone(), centres(&small.rest, f)].concat());
    let truth: Vec<Vec<f64>> =
        truth.map(|f| f.as_chunks::<3>().0.iter().map(place).collect::<Vec<_>>().into_flattened()).collect();
    let found = mean(&measure(&copy.points, &truth, &found).l2);
    assert!(found < 0.02, "{found} of the diagonal");
    for bad in ["1,0,0,0,0,1,0,0,0,0,-1,0,0,0,0,1", "1,0,0,0,0,2,0,0,0,0,1,0,0,0,0,1", "1,0,0", "turned"] {
        refused(&dir, &format!("{line} --overwrite --align {bad}"), &["--align", bad]);
    }
}

#[test]
fn the_ways_of_the_paper_go_through_a_cage_around_both() {
    let (dir, small, copy) = with_copy();
    dir.model("around.obj", &as_model(&small.cage));
    for rest in ["public --public ico", "public --public sphere", "rigid --public ico", "public --cage around.obj"] {
        let mut found = Vec::new();
        for detail in ["", " --detail"] {
            dir.cager(&format!("{TRANSFER} --method {rest}{detail} --overwrite --report report.json")).succeeds();
            found.push(error(&dir, &small, &copy));
            let report = dir.json("report.json");
            assert_eq!(report["method"].as_str(), rest.split(' ').next());
            assert_eq!(report["detail"].as_bool(), Some(!detail.is_empty()));
            assert!(report["quality"]["stretched"].as_f64().is_some() && report["score"].is_null(), "{report}");
            std::fs::remove_file(dir.path("report.json")).expect("a report");
        }
        assert!(found[0] < 0.7, "{rest}: {found:?} of unmoved");
        // Of a model that is smooth, a cage loses nothing that could come back.
        assert!(found[1] < found[0] + 0.05, "{rest}: {found:?} of unmoved, without and with detail");
    }
}

#[test]
fn pairs_of_vertices_say_how_a_symmetrical_model_lies() {
    let (dir, small, copy) = with_copy();
    let line = TRANSFER.replace(" --align none", "");
    let pairs: Vec<String> = (0..small.rest.points.len()).step_by(60).map(|v| format!("{v} {v}\n")).collect();
    dir.write("pairs.txt", format!("# source target\n\n{}", pairs.concat()));
    dir.cager(&format!("{line} --pairs pairs.txt")).succeeds();
    let found = error(&dir, &small, &copy);
    assert!(found < 0.15, "{found} of unmoved");
}

#[test]
fn a_dry_run_writes_nothing_and_needs_no_room() {
    let (dir, ..) = with_copy();
    dir.cager("encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager").succeeds();
    let before = dir.contents();
    for source in ["--source-rest rest.obj --source-frames frames.npy", "--source out.cager"] {
        let said = dir.cager(&format!("transfer {source} --target copy.obj -o moved.cager --dry-run")).succeeds();
        assert_eq!(said.stdout, "moved.cager: would be written: 20 frames of 1,221 points\n");
        assert!(dir.contents() == before, "{source}");
    }
}
