//! Captures with a file for each frame, of formats that could hold all of them.

use crate::refused::assert_sentence;
use crate::support::Dir;
use serde_json::json;

const ENCODE: &str =
    "encode --rest rest.obj --cage cage.obj -o out.cager --overwrite --report report.json --max-error 0.01 --frames";

/// A case, with a cage around it.
fn case(name: &str) -> Dir {
    let (dir, other) = (Dir::with_case(name), Dir::with_case("30-usd-rest-is-not-the-first-frame"));
    dir.write("cage.obj", other.read("cage.obj"));
    dir
}

/// What was decoded is what the case says.
fn assert_truth(dir: &Dir) {
    dir.cager("decode out.cager -o decoded.npy --overwrite").succeeds();
    let read = |name: &str| {
        let mut reader = cager_formats::open_frames(dir.path(name), 82).expect("frames");
        let (mut all, mut frame) = (Vec::new(), Vec::new());
        while reader.read_next(&mut frame).expect("a frame") {
            all.extend_from_slice(&frame);
        }
        all
    };
    let (decoded, truth) = (read("decoded.npy"), read("truth.npy"));
    assert_eq!(decoded.len(), truth.len());
    // The bound is a share of the diagonal, of some 2.1.
    assert!(decoded.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 0.022));
}

#[test]
fn one_array_of_several_is_taken_by_its_name_in_each_file() {
    let dir = case("24-npz-one-frame-each-with-two-arrays");
    let done = dir.cager(&format!("{ENCODE} take")).run();
    assert_eq!(done.status, Some(1));
    let words = ["take/hips.000001.npz", "has 2 arrays of one frame each (v_posed, v_cano)", "--prim v_posed"];
    assert_sentence("take", &done.stderr, &words);
    assert!(!done.stderr.contains("numpy"), "{}", done.stderr);
    // Alone as well, as arrays called so are no sequence.
    let said = dir.cager(&format!("{ENCODE} take/hips.000001.npz")).run().stderr;
    assert!(said.contains("--prim v_posed") && !said.contains("numpy"), "{said}");
    for frames in ["take", "take/*.npz", "take/hips.%06d.npz"] {
        dir.cager(&format!("{ENCODE} {frames} --prim v_posed")).succeeds();
        assert_eq!(dir.json("report.json")["frame_numbers"], json!([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), "{frames}");
        assert_truth(&dir);
    }
}

#[test]
fn files_of_usd_with_a_frame_each_are_the_frames_of_one_capture() {
    let dir = case("25-one-file-for-each-frame-of-usd-alembic-maya");
    for frames in ["shot", "shot/cache.*.usda", "shot/cache.%04d.usda", "shot/cache.####.usda"] {
        dir.cager(&format!("{ENCODE} {frames}")).succeeds();
        let numbers: Vec<f64> = (1001..1007).map(f64::from).collect();
        assert_eq!(dir.json("report.json")["frame_numbers"], json!(numbers), "{frames}");
        assert_truth(&dir);
    }
}

#[test]
fn the_rest_pose_of_usd_is_its_first_frame() {
    let dir = Dir::with_case("30-usd-rest-is-not-the-first-frame");
    let line = "encode --rest moved.usda --frames moved.usda --cage cage.obj -o out.cager --report report.json";
    dir.cager(line).succeeds();
    assert_eq!(dir.json("report.json")["frames"], 3);
}
