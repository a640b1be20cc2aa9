//! Harmonic coordinates through the program.

use crate::refused::assert_sentence;
use crate::support::{Dir, as_model, close, largest, mean, measure, read_cages, read_frames};
use cager_proto::container::{ContainerReader, ContainerWriter};
use std::io::Cursor;

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

/// The container with other boundary elements in it.
fn with_elements(dir: &Dir, output: &str, elements: Option<&[u8]>) {
    let mut from = ContainerReader::open(Cursor::new(dir.read("out.cager"))).expect("a container");
    let (rest, cage) = (from.rest().expect("a model"), from.cage().expect("a cage"));
    let mut to = ContainerWriter::new(Vec::new(), from.header(), &rest, &cage).expect("a header");
    if let Some(elements) = elements {
        to.add_elements(elements).expect("elements");
    }
    let mut rows = Vec::new();
    for frame in 0..from.frames() {
        from.read_frame(frame, &mut rows).expect("a frame");
        to.write_frame(&rows, 0.0, 0.0).expect("a frame");
    }
    std::fs::write(dir.path(output), to.finish(None).expect("a container")).expect("a file");
}

#[test]
fn containers_keep_the_boundary_elements_that_decoding_follows() {
    let (dir, small) = Dir::with_capture();
    dir.cager(ENCODE_HARMONIC).succeeds();
    let elements = ContainerReader::open(Cursor::new(dir.read("out.cager"))).expect("a container").elements();
    let elements = elements.expect("no damage").expect("elements");
    dir.cager("decode out.cager -o back.npy").succeeds();
    dir.cager("decode out.cager -o model.npy --model rest.obj").succeeds();
    assert!(dir.read("back.npy") == dir.read("model.npy"), "another model is decoded with other elements");
    // Files from before the section choose the same elements anew.
    with_elements(&dir, "old.cager", None);
    dir.cager("decode old.cager -o old.npy").succeeds();
    let n = small.rest.points.len();
    let errors =
        measure(&small.rest.points, &read_frames(&dir.path("back.npy"), n), &read_frames(&dir.path("old.npy"), n));
    assert!(largest(&errors.linf) < 1e-6, "{}", largest(&errors.linf));
    // One more turn of the iteration gives other positions: the file decides, and nothing else.
    let mut more = elements.clone();
    more[2] += 1;
    with_elements(&dir, "more.cager", Some(&more));
    dir.cager("decode more.cager -o more.npy").succeeds();
    assert!(dir.read("more.npy") != dir.read("back.npy"), "the elements of the file are not followed");
    for wrong in
        [&elements[..elements.len() - 1], &[], &[2, 0, 1, 9], &[0; 50_000], &[elements.as_slice(), &[0]].concat()]
    {
        with_elements(&dir, "wrong.cager", Some(wrong));
        let command = "decode wrong.cager -o wrong.npy";
        let done = dir.cager(command).run();
        assert_eq!(done.status, Some(1), "{}", done.stderr);
        assert_sentence(command, &done.stderr, &["wrong.cager", "boundary elements", "get the file again"]);
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
