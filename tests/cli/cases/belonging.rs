//! Captures whose points change their order or their unit after the first frame.

use crate::refused::assert_sentence;
use crate::support::{Dir, ENCODE, Small, npy_f64};
use cager_geometry::mesh::{Model, Point};

const CASE: &str = "01-order-or-unit-changes-after-frame-0";

/// Refused with these words and nothing written; with --force it is done with the same words as a warning.
#[track_caller]
pub(super) fn refused_unless_forced(dir: &Dir, line: &str, words: &[&str]) {
    let before = dir.contents();
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1), "{line}: {}{}", done.stdout, done.stderr);
    assert_sentence(line, &done.stderr, words);
    assert!(done.stderr.contains("--force"), "{}", done.stderr);
    assert!(dir.contents() == before, "{line}: the folder was changed");
    let forced = dir.cager(&format!("{line} --force")).succeeds();
    assert!(words.iter().all(|word| forced.stderr.contains(word)), "{}", forced.stderr);
    assert_eq!(forced.stderr.matches("does not look like").count(), 1, "{}", forced.stderr);
}

fn encode(frames: &str) -> String {
    format!("encode --rest rest.obj --cage cage.obj --frames {frames} -o out.cager --overwrite")
}

#[test]
fn mesh_files_in_another_order_from_a_later_frame_on_are_refused() {
    let dir = Dir::with_case(CASE);
    let words = ["walk/f01.obj", "frame 1", "rest.obj", "its points come in another order"];
    refused_unless_forced(&dir, &encode("walk"), &words);
    refused_unless_forced(&dir, &encode("walk/f%02d.obj"), &words);
    // Without a cage it is told before one is designed, and so is it where nothing is written.
    for line in ["encode --rest rest.obj --frames walk -o a.cager", &format!("{} --dry-run", encode("walk"))] {
        let done = dir.cager(line).run();
        assert_eq!(done.status, Some(1), "{done:?}");
        assert_sentence(line, &done.stderr, &words);
    }
}

#[test]
fn mesh_files_in_another_unit_from_a_later_frame_on_are_refused() {
    let dir = Dir::with_case(CASE);
    let words = ["walk-mm/f02.obj", "frame 2", "about 1000 times larger", "as with other units"];
    refused_unless_forced(&dir, &encode("walk-mm"), &words);
    let design = "cage --rest rest.obj --frames walk-mm --vertices 20 --time-limit 2 -o made.obj";
    let compare = "compare --rest rest.obj --cage cage.obj --frames walk-mm -o out.html --coordinates mvc";
    for line in [design, compare] {
        assert_sentence(line, &dir.cager(line).run().stderr, &words);
    }
}

/// The small capture, longer, with each point changed in frames 47 and 48; these are not among the frames looked at before the work.
fn changed_late(small: &Small, change: impl Fn(usize, usize) -> Point) -> Vec<Vec<f64>> {
    let frame = |t: usize| small.frames[if (t / 20).is_multiple_of(2) { t % 20 } else { 19 - t % 20 }].as_chunks().0;
    let n = small.rest.points.len();
    (0..50)
        .map(|t| (0..n).flat_map(|i| if (47..49).contains(&t) { change(t - 40, i) } else { frame(t)[i] }).collect())
        .collect()
}

#[test]
fn late_frames_of_an_array_in_another_order_or_unit_are_refused() {
    let (dir, small) = Dir::with_capture();
    let n = small.rest.points.len();
    let mut order: Vec<usize> = (0..n).collect();
    fastrand::Rng::with_seed(5).shuffle(&mut order);
    let mut by_x: Vec<usize> = (0..n).collect();
    by_x.sort_by(|&a, &b| small.rest.points[a][0].total_cmp(&small.rest.points[b][0]));
    let at = |t: usize, i: usize| small.frames[t].as_chunks().0[i];
    for (what, frames) in [
        ("another order", changed_late(&small, |t, i| at(t, order[i]))),
        ("another order", changed_late(&small, |t, i| at(t, by_x[i]))),
        ("about 39.37 times smaller", changed_late(&small, |t, i| at(t, i).map(|x| x / 39.37))),
        ("about 100 times larger", changed_late(&small, |t, i| at(t, i).map(|x| x * 100.0))),
    ] {
        dir.write("frames.npy", npy_f64(&frames));
        refused_unless_forced(&dir, ENCODE, &["frames.npy: frame 47 ", what]);
        // A range of them as well, by the numbers of the whole.
        let line = format!("{ENCODE} --frames-range 40-49");
        assert_sentence(&line, &dir.cager(&line).run().stderr, &["frames.npy: frame 47 ", what]);
    }
}

#[test]
fn what_is_hidden_for_a_frame_by_making_it_small_is_encoded() {
    let (dir, small) = Dir::with_capture();
    let mut frames = small.frames.clone();
    frames[7].iter_mut().for_each(|x| *x *= 1e-3);
    dir.frames("frames.npy", &frames);
    dir.cager(ENCODE).succeeds();
}

#[test]
fn files_whose_faces_are_split_otherwise_or_listed_in_another_order_are_encoded() {
    let (dir, small) = Dir::with_capture();
    for (frame, turn) in [0, 1, 2, 0].into_iter().enumerate() {
        let posed = small.posed(frame);
        let mut faces: Vec<Vec<u32>> = posed.faces.iter().map(<[u32]>::to_vec).collect();
        let count = faces.len();
        faces.rotate_left(turn * count / 3);
        for face in &mut faces {
            let corners = face.len();
            face.rotate_left(turn % corners);
        }
        let model = Model { faces: crate::support::polygons(faces), ..posed };
        dir.model(&format!("poses/f{frame}.obj"), &model);
    }
    // One without faces, and one whose faces cannot be read.
    let points = Model { points: small.posed(4).points, ..Model::default() };
    dir.model("poses/f4.obj", &points);
    let mut text = dir.read("poses/f3.obj");
    text.extend_from_slice(b"f 1 2\n");
    dir.write("poses/f5.obj", text);
    let done = dir.cager(&encode("poses")).succeeds();
    assert!(!done.stderr.contains("another order"), "{}", done.stderr);
}
