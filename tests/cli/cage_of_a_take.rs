//! The cage of a .cager file, used again: for another take of its model, or wherever a cage is asked for.

use crate::refused::refused;
use crate::support::{Dir, ENCODE, largest, measure, read_cages, read_frames};
use cager_formats::read_model;
use cager_geometry::mesh::Model;

/// [`ENCODE`] with the cage of `out.cager`, into `again.cager`.
const AGAIN: &str =
    "encode --rest rest.obj --cage out.cager --frames frames.npy -o again.cager --overwrite --report again.json";

/// What the reports of `out.cager` and `again.cager` say of the worst frame.
fn worst(dir: &Dir) -> [f64; 2] {
    ["report.json", "again.json"].map(|name| dir.json(name)["error"]["linf_max"].as_f64().expect("an error"))
}

#[test]
fn a_container_serves_as_the_cage_that_it_was_made_with() {
    let (dir, _) = Dir::with_encoded();
    let done = dir.cager(AGAIN).succeeds();
    assert_eq!(done.stderr, "");
    assert!(dir.read("again.cager") == dir.read("out.cager"), "another cage than the container's");
    // Coded, it is as exact as the file was asked to be.
    dir.cager(&format!("{ENCODE} --max-error 1e-3 --report report.json")).succeeds();
    dir.cager(&format!("{AGAIN} --max-error 1e-3")).succeeds();
    assert_eq!(read_cages(&dir.path("again.cager"))[0].len(), read_cages(&dir.path("out.cager"))[0].len());
    assert!(worst(&dir).iter().all(|&error| error <= 1e-3), "{:?}", worst(&dir));
}

#[test]
fn a_designed_cage_serves_the_next_take_and_the_summary_says_how() {
    let (dir, small) = Dir::with_capture();
    let (first, next) = small.frames.split_at(small.frames.len() / 2);
    dir.frames("first.npy", first);
    dir.frames("next.npy", next);
    let line = "encode --rest rest.obj --frames first.npy --cage-vertices 60 --time-limit 5 -o out.cager";
    let said = dir.cager(line).succeeds().stdout;
    assert!(said.contains("for more takes of this model pass --cage out.cager"), "{said}");
    let said = dir.cager(&AGAIN.replace("frames.npy", "next.npy")).succeeds().stdout;
    assert!(!said.contains("pass --cage"), "{said}");
    let rest_cage = |name: &str| {
        dir.cager(&format!("decode {name}.cager --cages -o {name}.npy --overwrite")).succeeds();
        read_model(&dir.path(&format!("{name}.cage.obj"))).expect("a cage")
    };
    assert_eq!(rest_cage("again"), rest_cage("out"));
    dir.cager("decode again.cager -o back.npy").succeeds();
    let found = read_frames(&dir.path("back.npy"), small.rest.points.len());
    let found = largest(&measure(&small.rest.points, next, &found).l2);
    assert!(found < 0.02, "{found} of the diagonal");
    // It can be improved for the other take, and is a cage for comparisons and for moving another model.
    dir.cager("cage --rest rest.obj --frames next.npy --improve out.cager --time-limit 2 -o better.obj").succeeds();
    assert_eq!(read_model(&dir.path("better.obj")).expect("a cage").faces, rest_cage("out").faces);
    dir.cager("cage --rest rest.obj --check out.cager").succeeds();
    dir.cager("compare --rest rest.obj --cage out.cager --frames next.npy --coordinates mvc -o figures.json")
        .succeeds();
    let line = "transfer --source-rest rest.obj --source-frames next.npy --target rest.obj --align none -o moved.cager";
    dir.cager(&format!("{line} --cage out.cager")).succeeds();
}

#[test]
fn a_cage_far_from_the_origin_comes_back_there() {
    let dir = Dir::with_case("07-utm-coordinates");
    dir.cager(&format!("{ENCODE} --report report.json")).succeeds();
    assert_eq!(dir.cager(AGAIN).succeeds().stderr, "");
    let [first, again] = worst(&dir);
    assert!((again / first - 1.0).abs() < 1e-6, "{again} where {first} is expected");
}

#[test]
fn containers_that_are_no_cage_for_a_model_are_refused() {
    let (dir, small) = Dir::with_encoded();
    // Another model stands elsewhere.
    let moved = small.rest.points.iter().map(|p| [p[0] + 5.0, 2.0 * p[1], p[2]]).collect();
    dir.model("other.obj", &Model { points: moved, ..small.rest.clone() });
    refused(&dir, &AGAIN.replace("rest.obj", "other.obj"), &["out.cager", "outside"]);
    refused(&dir, &AGAIN.replace("out.cager", "none.cager"), &["none.cager", "cannot be read"]);
    dir.write("text.cager", "v 0 0 0\n");
    refused(&dir, &AGAIN.replace("out.cager", "text.cager"), &["text.cager", "not a .cager file"]);
    let bytes = dir.read("out.cager");
    dir.write("cut.cager", &bytes[..bytes.len() / 2]);
    refused(&dir, &AGAIN.replace("out.cager", "cut.cager"), &["cut.cager", "damaged"]);
    // What is read is not overwritten.
    refused(&dir, &AGAIN.replace("again.cager", "out.cager"), &["out.cager", "input"]);
    assert!(dir.read("out.cager") == bytes);
}
