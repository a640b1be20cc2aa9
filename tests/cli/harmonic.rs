//! Harmonic coordinates through the program.

use crate::refused::assert_sentence;
use crate::support::{Dir, as_model, close, largest, mean, measure, read_cages, read_frames};

const ENCODE_HARMONIC: &str = "encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite --report report.json --coordinates harmonic";

#[test]
fn captures_come_back_with_the_errors_that_were_reported() {
    let (dir, small) = Dir::with_capture();
    for handles in ["maxvol", "spread", "all"] {
        let said = dir.cager(&format!("{ENCODE_HARMONIC} --handles {handles}")).succeeds().stdout;
        assert!(said.contains("boundary elements"), "{said}");
        let report = dir.json("report.json");
        assert_eq!(report["coordinates"], "harmonic");
        assert_eq!(report["unknowns"], small.cage.vertices.len(), "{handles}");
        assert!(report["affine_reproduction_error"].as_f64().is_some_and(|e| e <= 1e-10), "{handles}");
        let refined = &report["refinement"];
        assert!(refined["elements"].as_u64() >= Some(small.cage.triangles.len() as u64), "{refined}");
        assert!(refined["refinements"].is_u64(), "{refined}");
        assert!(refined["change"].as_f64().is_some_and(|change| change > 0.0 && change <= 1e-3), "{refined}");
        assert_eq!(read_cages(&dir.path("out.cager")).len(), 20);
        dir.cager("decode out.cager -o back.npy --overwrite").succeeds();
        let found = read_frames(&dir.path("back.npy"), small.rest.points.len());
        let errors = measure(&small.rest.points, &small.frames, &found);
        let number = |key: &str| report["error"][key].as_f64().expect(key);
        close(handles, number("l2_mean"), mean(&errors.l2), 1e-4);
        close(handles, number("linf_max"), largest(&errors.linf), 1e-4);
        assert!(number("l2_max") < 0.05, "{handles}: {}", number("l2_max"));
        let text = dir.cager("inspect out.cager").succeeds().stdout;
        assert!(text.contains("harmonic"), "{text}");
    }
}

#[test]
fn containers_are_identical_for_any_number_of_threads() {
    let (dir, _) = Dir::with_capture();
    let mut files = Vec::new();
    for threads in ["1", "2", "5"] {
        dir.cager(ENCODE_HARMONIC).env("RAYON_NUM_THREADS", threads).succeeds();
        files.push(dir.read("out.cager"));
    }
    assert!(files[0] == files[1] && files[0] == files[2], "other bytes on other threads");
}

#[test]
fn points_outside_are_refused_in_one_sentence_that_counts_them() {
    let (dir, small) = Dir::with_capture();
    dir.model("cage.obj", &as_model(&small.shrunk_cage()));
    let before = dir.contents();
    let done = dir.cager(ENCODE_HARMONIC).run();
    assert_eq!(done.status, Some(1), "{}", done.stderr);
    let words = ["points lie outside the cage (", "…)", "enlarge the cage or use mean value coordinates"];
    assert_sentence(ENCODE_HARMONIC, &done.stderr, &words);
    assert!(dir.contents() == before, "the folder was changed");
}
