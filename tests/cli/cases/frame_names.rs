//! Folders and patterns: which files are frames, and in which order.

use crate::refused::assert_sentence;
use crate::support::{Dir, Small};
use serde_json::json;

const ENCODE: &str = "encode --rest rest.obj --cage cage.obj -o out/out.cager --overwrite --report out/report.json";

/// A folder for the outputs beside what is there.
fn with_out(dir: Dir) -> Dir {
    dir.write("out/.keep", "");
    dir
}

/// The small capture with some frames under these names.
fn named(names: &[&str]) -> Dir {
    let (dir, small) = Dir::with_capture();
    for (frame, name) in names.iter().enumerate() {
        dir.model(name, &small.posed(frame));
    }
    with_out(dir)
}

/// The numbers of the frames that were encoded.
#[track_caller]
fn numbers(dir: &Dir, options: &str, frames: &str) -> Vec<f64> {
    dir.cager(&format!("{ENCODE} {options} --frames")).arg(frames).succeeds();
    let report = dir.json("out/report.json");
    let numbers = report["frame_numbers"].as_array().cloned().unwrap_or_default();
    if numbers.is_empty() {
        return (0..report["frames"].as_u64().expect("frames")).map(|k| k as f64).collect();
    }
    numbers.iter().map(|number| number.as_f64().expect("a number")).collect()
}

#[track_caller]
fn refused(dir: &Dir, frames: &str, words: &[&str]) -> String {
    let done = dir.cager(&format!("{ENCODE} --frames")).arg(frames).run();
    assert_eq!(done.status, Some(1), "{frames}: {}{}", done.stdout, done.stderr);
    assert_sentence(frames, &done.stderr, words);
    assert_eq!(dir.names("out"), [".keep"]);
    done.stderr
}

#[test]
fn the_rest_pose_among_the_frames_is_left_out_with_a_note() {
    let dir = with_out(Dir::with_case("02-rest-pose-inside-frames-folder"));
    let line = "encode --cage cage.obj -o out/out.cager --overwrite --report out/report.json";
    for (rest, frames) in [
        ("walk/rest.obj", "walk"),
        ("./walk/../walk/rest.obj", "walk/"),
        ("walk/rest.obj", "walk/*.obj"),
        ("walk/rest.obj", "./walk"),
    ] {
        let done = dir.cager(&format!("{line} --rest {rest} --frames {frames}")).succeeds();
        assert!(done.stderr.contains("walk/rest.obj: is given as the rest pose"), "{}", done.stderr);
        assert_eq!(dir.json("out/report.json")["frame_numbers"], json!([1.0, 2.0, 3.0]));
    }
    // A copy of it is no frame either.
    refused(&with_out(Dir::with_case("02-rest-pose-inside-frames-folder")), "walk", &["rest.obj", "'walk/f*.obj'"]);
}

#[test]
fn the_cage_among_the_frames_is_left_out_even_in_another_format() {
    let (dir, small) = Dir::with_capture();
    for frame in 1..4 {
        dir.model(&format!("walk/{frame}.obj"), &small.posed(frame));
    }
    dir.model("walk/cage.ply", &crate::support::as_model(&small.cage));
    let line = "encode --rest rest.obj --cage walk/cage.ply --frames walk -o out.cager";
    let said = dir.cager(line).succeeds().stderr;
    assert!(said.contains("walk/cage.ply: is given as the rest pose or the cage"), "{said}");
}

#[cfg(unix)]
#[test]
fn links_to_the_rest_pose_are_the_rest_pose() {
    let dir = named(&["walk/f1.obj", "walk/f2.obj", "walk/f3.obj"]);
    std::os::unix::fs::symlink(dir.path("rest.obj"), dir.path("walk/neutral.obj")).expect("a link");
    assert_eq!(numbers(&dir, "", "walk"), [1.0, 2.0, 3.0]);
}

#[test]
fn a_rest_pose_that_is_called_as_the_frames_are_is_the_first_of_them() {
    let dir = named(&["walk/f00.obj", "walk/f01.obj", "walk/f02.obj"]);
    let line = "encode --rest walk/f00.obj --cage cage.obj --frames walk -o out/out.cager --report out/report.json";
    let done = dir.cager(line).succeeds();
    assert_eq!(dir.json("out/report.json")["frames"], 3);
    assert!(!done.stderr.contains("is given as the rest pose"), "{}", done.stderr);
    // A file that is named as the capture is one.
    dir.cager("encode --rest walk/f00.obj --cage cage.obj --frames walk/f00.obj -o one.cager").succeeds();
}

#[test]
fn two_files_with_one_number_or_several_sequences_are_refused_with_patterns_that_pick_one() {
    for (folder, words, picks) in [
        ("dup", ["f003 (1).obj", "f001.obj and f1.obj have the same frame number"], "dup/f???.obj"),
        ("takes", ["3 like walk_*_v2.obj", "3 like walk_*_v3.obj"], "takes/walk_*_v2.obj"),
        ("two", ["3 like a_*.obj", "3 like b_*.obj"], "two/a_*.obj"),
    ] {
        let dir = with_out(Dir::with_case("03-two-files-for-one-frame-number"));
        let said = refused(&dir, folder, &words);
        assert!(said.contains(&format!("'{picks}'")) && said.contains("--all-files"), "{said}");
        assert_eq!(numbers(&dir, "", picks).len(), 3, "{picks}");
        assert!(numbers(&dir, "--all-files", folder).len() > 4, "{folder}");
    }
}

#[test]
fn other_names_for_several_files_in_place_of_one_are_refused() {
    for (names, words) in [
        (vec!["w/1.obj", "w/01.obj"], vec!["01.obj and 1.obj have the same frame number"]),
        (vec!["w/f1.obj", "w/f2.obj", "w/f2 - Copy.obj"], vec!["f2 - Copy.obj", "2 like f?.obj"]),
        (vec!["w/f1.obj", "w/f1 (1).obj"], vec!["f1 (1).obj looks like a copy of f1.obj"]),
        (vec!["w/run1.obj", "w/run2.obj", "w/walk3.obj", "w/walk4.obj"], vec!["'w/run*.obj'", "'w/walk*.obj'"]),
        (vec!["w/a_v1.obj", "w/b_v1.obj", "w/a_v2.obj", "w/b_v2.obj"], vec!["like a_v*.obj", "like b_v*.obj"]),
        (vec!["w/t1_01.obj", "w/t1_02.obj", "w/t2_01.obj", "w/t2_02.obj"], vec!["like t1_*.obj", "like t2_*.obj"]),
        (vec!["w/f1/m.obj", "w/f2/m.obj", "w/g1/m.obj", "w/g2/m.obj"], vec!["'w/f*/m.obj'", "'w/g*/m.obj'"]),
    ] {
        let dir = named(&names);
        let source = if names[0].ends_with("/m.obj") { "w/*/m.obj" } else { "w" };
        refused(&dir, source, &words);
    }
}

#[test]
fn frames_come_in_the_order_that_a_person_reads() {
    for (names, wanted) in [
        (vec!["w/0.5.obj", "w/0.04.obj", "w/0.45.obj"], vec![0.04, 0.45, 0.5]),
        (vec!["w/f1.5.obj", "w/f1.obj", "w/f2.obj", "w/f10.obj"], vec![1.0, 1.5, 2.0, 10.0]),
        (vec!["w/frame_-4.obj", "w/frame_-5.obj", "w/frame_-3.obj"], vec![-5.0, -4.0, -3.0]),
        (vec!["w/2024-01-05_v2_0007.obj", "w/2024-01-05_v2_0008.obj"], vec![7.0, 8.0]),
        (vec!["w/f0001_t0.04.obj", "w/f0002_t0.08.obj", "w/f0003_t0.12.obj"], vec![1.0, 2.0, 3.0]),
        (vec!["w/v1_10.obj", "w/v2_11.obj", "w/v1_9.obj"], vec![9.0, 10.0, 11.0]),
    ] {
        assert_eq!(numbers(&named(&names), "--allow-gaps", "w"), wanted, "{names:?}");
    }
}

#[test]
fn brackets_in_names_of_folders_stand_for_themselves_where_there_is_such_a_folder() {
    let dir =
        named(&["take[1]/f5.obj", "take[1]/f6.obj", "take1/f7.obj", "take1/f8.obj", "x/b[2]_3.obj", "x/b[2]_4.obj"]);
    for pattern in ["take[1]/f*.obj", "take[1]", "take[1]/f%d.obj", "take[1]/f#.obj", "take[1]/f[56].obj", "t*1]/*.obj"]
    {
        assert_eq!(numbers(&dir, "", pattern), [5.0, 6.0], "{pattern}");
    }
    assert_eq!(numbers(&dir, "", "take[12]/f*.obj"), [7.0, 8.0]);
    assert_eq!(numbers(&dir, "", "x/b[2]_*.obj"), [3.0, 4.0]);
}

#[test]
fn numbers_and_gaps_are_taken_from_folders_too() {
    let names = ["s/frame_0008/mesh.obj", "s/frame_0009/mesh.obj", "s/frame_0010/mesh.obj"];
    let dir = named(&names);
    for pattern in ["s/frame_%04d/mesh.obj", "s/*/mesh.obj", "s/frame_####/*.obj", "s/frame_*/mesh.obj"] {
        assert_eq!(numbers(&dir, "", pattern), [8.0, 9.0, 10.0], "{pattern}");
    }
    let gap = named(&["s/frame_1/mesh.obj", "s/frame_2/mesh.obj", "s/frame_4/mesh.obj", "s/frame_5/mesh.obj"]);
    refused(&gap, "s/*/mesh.obj", &["frame 3 is missing", "--allow-gaps"]);
    refused(&gap, "s", &["holds no mesh files", "'s/*/*.obj'"]);
    refused(&gap, "s/frame_%04d/mesh.obj", &["matches no file"]);
}

#[test]
fn a_file_that_ends_within_a_line_is_called_cut() {
    let small = Small::new();
    let text = |frame: usize| {
        let mut text = String::new();
        small.frames[frame].chunks(3).for_each(|p| text += &format!("v {:.6} {:.6} {:.6}\n", p[0], p[1], p[2]));
        text
    };
    let whole = text(2);
    let half = whole.lines().count() / 2;
    let lines = |count: usize| whole.split_inclusive('\n').take(count).collect::<String>();
    for (cut, words) in [
        (whole[..whole.len() - 4].to_owned(), ["ends within a line", "so it was cut"]),
        (lines(half)[..lines(half).len() - 3].to_owned(), ["ends within a line after 300 of 600 points", "was cut"]),
        (lines(half)[..lines(half).len() - 12].to_owned(), ["line 300: the file ends within this line", "was cut"]),
    ] {
        let dir = named(&[]);
        for frame in [0, 1, 3] {
            dir.write(&format!("w/f{frame}.obj"), text(frame));
        }
        dir.write("w/f2.obj", cut);
        refused(&dir, "w", &["w/f2.obj", "frame 2", words[0], words[1]]);
    }
}
