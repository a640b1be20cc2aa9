//! Case 33: frames asked for by the numbers that `inspect` shows.

use crate::refused::refused;
use crate::support::{Dir, read_frames};

const CASE: &str = "33-frames-by-their-numbers";

#[test]
fn numbers_are_refused_with_the_frames_that_have_them() {
    let dir = Dir::with_case(CASE);
    let encode = "encode --rest rest.obj --frames shot";
    dir.cager(&format!("{encode} -o a.cager")).succeeds();
    assert!(dir.cager("inspect a.cager").succeeds().stdout.contains("numbers   1001 to 1006"));
    let counted = "frames are counted from 0 here, 0 to 5";
    refused(&dir, "decode a.cager --frame 1003 -o p.obj", &["a.cager", counted, "number 1003 is frame 2; give 2"]);
    refused(&dir, "decode a.cager --range 1001-1005x2 -o p.npy", &["a.cager", counted, "are frames 0-4x2; give 0-4x2"]);
    refused(&dir, "decode a.cager --cages --frame 1006 -o p.npy", &["a.cager", counted, "number 1006 is frame 5"]);
    refused(&dir, "explore a.cager@1003 a.cager@0 -o p.npy", &["a.cager", counted, "number 1003 is frame 2"]);
    let line = format!("{encode} --frames-range 1003-1005 -o b.cager");
    refused(&dir, &line, &["shot", counted, "numbers 1003-1005 are frames 2-4; give 2-4"]);
    let line = format!("{encode} --frames-range 1003-1009 -o b.cager");
    refused(&dir, &line, &["shot", "has frames 0 to 5, with the numbers 1001 to 1006"]);
}

#[test]
fn frames_are_told_with_their_numbers_where_those_are_others() {
    let dir = Dir::with_case(CASE);
    let encode = "encode --rest rest.obj --frames shot";
    let whole = dir.cager(&format!("{encode} -o a.cager")).succeeds();
    assert!(!whole.stderr.contains("counted from 0"), "{}", whole.stderr);
    let part = dir.cager(&format!("{encode} --frames-range 2-4 -o b.cager")).succeeds();
    let told = "shot: frames 2-4, counted from 0, have the numbers 1003 to 1005";
    assert_eq!(part.stderr.matches(told).count(), 1, "{}", part.stderr);
    let one = dir.cager("decode a.cager --frame 2 -o one.npy").succeeds();
    let told = "a.cager: frame 2, counted from 0, has the number 1003\n";
    assert!(one.stdout.contains(told) || one.stderr.contains(told), "{one:?}");
    dir.cager("decode a.cager -o all.npy").succeeds();
    assert_eq!(read_frames(&dir.path("one.npy"), 82)[0], read_frames(&dir.path("all.npy"), 82)[2]);
    // Of frames that are numbered from 0 nothing is said.
    let (dir, _) = Dir::with_encoded();
    let one = dir.cager("decode out.cager --frame 2 -o one.npy").succeeds();
    assert!(!format!("{one:?}").contains("counted from 0"), "{one:?}");
}
