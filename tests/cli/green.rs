//! Green coordinates through the program.

use crate::support::{Dir, close, largest, mean, measure, read_cages, read_frames};

const ENCODE_GREEN: &str =
    "encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite --report report.json";

#[test]
fn captures_come_back_from_both_systems_with_the_errors_that_were_reported() {
    let (dir, small) = Dir::with_capture();
    let (vertices, faces) = (small.cage.vertices.len(), small.cage.triangles.len());
    for (system, rows) in [("green", vertices), ("green-free", vertices + faces)] {
        for handles in ["maxvol", "spread", "all"] {
            let what = format!("{system}, {handles}");
            dir.cager(&format!("{ENCODE_GREEN} --coordinates {system} --handles {handles}")).succeeds();
            let report = dir.json("report.json");
            assert_eq!(report["coordinates"], system);
            assert_eq!(report["unknowns"], rows, "{what}");
            assert!(report["affine_reproduction_error"].as_f64().is_some_and(|e| e < 1e-10), "{what}");
            let cages = read_cages(&dir.path("out.cager"));
            assert!(cages.len() == 20 && cages.iter().all(|cage| cage.len() == 3 * rows), "{what}");
            dir.cager("decode out.cager -o back.npy --overwrite").succeeds();
            let found = read_frames(&dir.path("back.npy"), small.rest.points.len());
            let errors = measure(&small.rest.points, &small.frames, &found);
            let number = |key: &str| report["error"][key].as_f64().expect(key);
            close(&what, number("l2_mean"), mean(&errors.l2), 1e-4);
            close(&what, number("linf_max"), largest(&errors.linf), 1e-4);
            assert!(number("l2_max") < 0.05, "{what}: {}", number("l2_max"));
            let text = dir.cager("inspect out.cager").succeeds().stdout;
            assert!(text.contains(system), "{text}");
        }
    }
}

#[test]
fn the_report_says_how_the_iteration_went() {
    let (dir, _) = Dir::with_capture();
    dir.cager(&format!("{ENCODE_GREEN} --coordinates green")).succeeds();
    let found = &dir.json("report.json")["consistency"];
    let count = |key: &str| found[key].as_u64().expect(key);
    assert_eq!(count("converged") + count("stopped") + count("kept_start"), 20, "{found}");
    assert!(found["l2_mean"].as_f64() < found["start_l2_mean"].as_f64(), "{found}");
    assert!(found["steps_mean"].as_f64().is_some_and(|steps| steps >= 1.0 && steps <= count("steps_max") as f64));
    for system in ["mvc", "green-free"] {
        dir.cager(&format!("{ENCODE_GREEN} --coordinates {system}")).succeeds();
        assert!(dir.json("report.json").get("consistency").is_none(), "{system} is linear");
    }
}

#[test]
fn containers_are_identical_for_any_number_of_threads() {
    let (dir, _) = Dir::with_capture();
    for system in ["green", "green-free"] {
        let mut files = Vec::new();
        for threads in ["1", "2", "5"] {
            dir.cager(&format!("{ENCODE_GREEN} --coordinates {system}")).env("RAYON_NUM_THREADS", threads).succeeds();
            files.push(dir.read("out.cager"));
        }
        assert!(files[0] == files[1] && files[0] == files[2], "{system}: other bytes on other threads");
    }
}

#[test]
fn frames_that_follow_each_other_are_improved_in_their_order() {
    let (dir, _) = Dir::with_capture();
    let line = format!("{ENCODE_GREEN} --coordinates green --regularizer temporal");
    dir.cager(&line).env("RAYON_NUM_THREADS", "1").succeeds();
    let (cages, report) = (read_cages(&dir.path("out.cager")), dir.json("report.json"));
    assert!(report["error"]["l2_max"].as_f64().is_some_and(|l2| l2 < 0.05), "{}", report["error"]);
    dir.cager(&line).env("RAYON_NUM_THREADS", "5").succeeds();
    assert!(read_cages(&dir.path("out.cager")) == cages);
}

#[test]
fn points_outside_are_encoded_and_counted() {
    let (dir, small) = Dir::with_capture();
    dir.model("cage.obj", &crate::support::as_model(&small.shrunk_cage()));
    for system in ["green", "green-free"] {
        let said = dir.cager(&format!("{ENCODE_GREEN} --coordinates {system}")).succeeds().stderr;
        assert!(said.contains("points lie outside the cage"), "{said}");
        let report = dir.json("report.json");
        assert!(report["affine_reproduction_error"].as_f64().is_some_and(|e| e < 1e-10), "{system}");
        dir.cager("decode out.cager -o back.npy --overwrite").succeeds();
    }
}

#[test]
fn too_few_points_for_free_normals_are_refused_in_one_sentence() {
    let (dir, mut small) = Dir::with_capture();
    let keep = small.cage.vertices.len() + 10;
    small.rest.points.truncate(keep);
    small.rest.faces = cager_geometry::mesh::Polygons::new();
    dir.model("rest.ply", &small.rest);
    let frames: Vec<Vec<f64>> = small.frames.iter().map(|frame| frame[..3 * keep].to_vec()).collect();
    dir.frames("few.npy", &frames);
    let line = "encode --rest rest.ply --cage cage.obj --frames few.npy -o few.cager --coordinates";
    let done = dir.cager(&format!("{line} green-free")).run();
    assert_eq!(done.status, Some(1));
    assert!(done.stderr.contains("fewer than the") && done.stderr.lines().count() == 1, "{}", done.stderr);
    dir.cager(&format!("{line} green")).succeeds();
}
