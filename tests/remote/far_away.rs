//! Captures that a service could not take as they are: it sees them moved, or not at all.

use crate::server::Server;
use crate::support::{Dir, ENCODE, largest, measure, npy_f64, read_frames};
use cager_formats::read_model;

#[test]
fn a_capture_in_utm_metres_is_sent_about_its_origin_and_comes_back_where_it_was() {
    let dir = Dir::with_case("07-utm-coordinates");
    let server = Server::start(&dir);
    let rest = read_model(&dir.path("rest.obj")).expect("a rest pose").points;
    let frames = read_frames(&dir.path("frames.npy"), rest.len());
    for options in ["", " --max-error 1e-4", " --flip-cage"] {
        if options == " --flip-cage" {
            let text = String::from_utf8(dir.read("cage.obj")).expect("text");
            let turned = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
                ["f", a, b, c] => format!("f {a} {c} {b}\n"),
                _ => format!("{line}\n"),
            };
            dir.write("cage.obj", text.lines().map(turned).collect::<String>());
        }
        dir.cager(&format!("{ENCODE} --report here.json{options}")).succeeds();
        let line = format!("{ENCODE} --report there.json{options} --server {}", server.address());
        let done = dir.cager(&line).succeeds();
        assert!(!done.stderr.contains("diagonals"), "{}", done.stderr);
        let error = |name: &str| dir.json(name)["error"]["linf_max"].as_f64().expect("an error");
        assert!(error("there.json") < 1.01 * error("here.json") + 1e-6, "{options}");
        assert_eq!(dir.json("there.json")["origin"], dir.json("here.json")["origin"]);
        dir.cager("decode out.cager -o back.npy --overwrite").succeeds();
        let found = largest(&measure(&rest, &frames, &read_frames(&dir.path("back.npy"), rest.len())).linf);
        assert!(found < 1.001 * error("there.json") + 1e-6, "{options}: {found}");
    }
}

#[test]
fn frames_that_depart_are_refused_before_or_while_they_are_sent_with_the_same_words() {
    let dir = Dir::with_case("01-order-or-unit-changes-after-frame-0");
    let server = Server::start(&dir);
    for (frames, words) in [("walk", "walk/f01.obj: frame 1 "), ("walk-mm", "walk-mm/f02.obj: frame 2 ")] {
        let line = format!("encode --rest rest.obj --cage cage.obj --frames {frames} -o out.cager");
        let here = dir.cager(&line).run();
        let there = dir.cager(&format!("{line} --server {}", server.address())).run();
        assert_eq!((there.status, &there.stderr), (Some(1), &here.stderr));
        assert!(there.stderr.contains(words), "{}", there.stderr);
        assert!(!dir.path("out.cager").exists());
    }
    let line = "encode --rest rest.obj --cage cage.obj --frames walk -o out.cager --force";
    let forced = dir.cager(&format!("{line} --server {}", server.address())).succeeds();
    assert!(forced.stderr.contains("walk/f01.obj: frame 1 "), "{}", forced.stderr);
    // A late frame, which is not looked at before.
    let (dir, small) = Dir::with_capture();
    let server = Server::start(&dir);
    let mut frames: Vec<Vec<f64>> = (0..50).map(|t| small.frames[t % 20].clone()).collect();
    frames[33].iter_mut().for_each(|x| *x *= 100.0);
    dir.write("frames.npy", npy_f64(&frames));
    let there = dir.cager(&format!("{ENCODE} --server {}", server.address())).run();
    assert_eq!(there.status, Some(1), "{}", there.stderr);
    for words in ["frames.npy: frame 33 ", "about 100 times larger", "as with other units", "--force"] {
        assert!(there.stderr.contains(words), "{}", there.stderr);
    }
}
