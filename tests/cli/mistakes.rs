//! Files that do not belong together, or are not what their names say: noticed before the work, with the likely cause.

use crate::refused::assert_sentence;
use crate::support::{Dir, ENCODE, Small, as_model, npy, npy_f64, quad_box, read_frames, split};
use cager_geometry::mesh::{Model, Point};

/// Every point of every frame changed.
fn changed(small: &Small, change: impl Fn(Point) -> Point) -> Vec<Vec<f64>> {
    let moved = |frame: &Vec<f64>| frame.as_chunks().0.iter().flat_map(|&p| change(p)).collect();
    small.frames.iter().map(moved).collect()
}

/// Every frame with its points in another order.
fn shuffled(small: &Small) -> Vec<Vec<f64>> {
    let n = small.rest.points.len();
    let mut order: Vec<usize> = (0..n).collect();
    fastrand::Rng::with_seed(7).shuffle(&mut order);
    let of = |frame: &Vec<f64>| order.iter().flat_map(|&i| [0, 1, 2].map(|k| frame[3 * i + k])).collect();
    small.frames.iter().map(of).collect()
}

/// Refused with these words, and done with a warning once --force is given.
#[track_caller]
fn refused_unless_forced(dir: &Dir, line: &str, words: &[&str]) {
    let before = dir.contents();
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1), "{line}: {}{}", done.stdout, done.stderr);
    assert_sentence(line, &done.stderr, words);
    assert!(done.stderr.contains("--force"), "{}", done.stderr);
    assert!(dir.contents() == before, "{line}: the folder was changed");
    let forced = dir.cager(&format!("{line} --force")).succeeds();
    assert!(forced.stderr.contains("warning: "), "{}", forced.stderr);
}

#[test]
fn a_capture_in_other_units_is_refused_unless_forced() {
    let (dir, small) = Dir::with_capture();
    dir.frames("frames.npy", &changed(&small, |p| p.map(|x| 100.0 * x)));
    refused_unless_forced(&dir, ENCODE, &["frames.npy", "rest.obj", "100 times larger", "units"]);
    dir.frames("frames.npy", &changed(&small, |p| p.map(|x| x / 39.37)));
    refused_unless_forced(&dir, ENCODE, &["frames.npy", "39.37 times smaller", "units"]);
    // A service is not asked.
    let there = dir.cager(&format!("{ENCODE} --server http://127.0.0.1:9")).run();
    assert_sentence("--server", &there.stderr, &["frames.npy", "39.37 times smaller"]);
}

#[test]
fn a_comparison_refuses_what_an_encoding_refuses_unless_forced() {
    let (dir, small) = Dir::with_capture();
    dir.frames("frames.npy", &changed(&small, |p| p.map(|x| 100.0 * x)));
    let line =
        "compare --rest rest.obj --cage cage.obj --frames frames.npy -o out.html --coordinates mvc --frames-at-most 3";
    refused_unless_forced(&dir, line, &["frames.npy", "rest.obj", "100 times larger", "units"]);
}

#[test]
fn a_capture_with_its_points_in_another_order_is_refused_unless_forced() {
    let (dir, small) = Dir::with_capture();
    dir.frames("frames.npy", &shuffled(&small));
    refused_unless_forced(&dir, ENCODE, &["frames.npy", "another order", "times longer in frame 0"]);
    dir.model("cloud.ply", &Model { points: small.rest.points.clone(), ..Model::default() });
    let line = "encode --rest cloud.ply --cage cage.obj --frames frames.npy -o cloud.cager";
    refused_unless_forced(&dir, line, &["frames.npy", "cloud.ply", "another order"]);
}

#[test]
fn a_capture_with_exchanged_axes_is_refused_with_the_option_that_turns_it() {
    let (dir, small) = Dir::with_capture();
    dir.cager(&format!("{ENCODE} --report straight.json")).succeeds();
    // It has the axes of the rest pose: both are turned by neither.
    for up in ["y", "z"] {
        refused_unless_forced(&dir, &format!("{ENCODE} --up {up}"), &["leave out --up, or pass --up"]);
    }
    dir.frames("frames.npy", &changed(&small, |[x, y, z]| [x, -z, y]));
    refused_unless_forced(&dir, ENCODE, &["frames.npy", "axes y and z look exchanged", "--up z"]);
    dir.cager(&format!("{ENCODE} --up z --report turned.json")).succeeds();
    assert_eq!(dir.json("turned.json")["error"], dir.json("straight.json")["error"]);
    dir.frames("frames.npy", &changed(&small, |[x, y, z]| [x, z, -y]));
    refused_unless_forced(&dir, ENCODE, &["frames.npy", "--up y"]);
}

#[test]
fn designing_a_cage_looks_at_the_capture_too() {
    let (dir, small) = Dir::with_capture();
    dir.frames("frames.npy", &changed(&small, |p| p.map(|x| 0.01 * x)));
    let line = "cage --rest rest.obj --frames frames.npy --vertices 20 --time-limit 2 -o made.obj";
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1));
    assert_sentence(line, &done.stderr, &["frames.npy", "100 times smaller", "--force"]);
}

#[test]
fn a_cage_in_other_units_or_axes_is_refused_with_what_would_make_it_fit() {
    let (dir, small) = Dir::with_capture();
    let cage = |change: fn(Point) -> Point| {
        let mut cage = as_model(&small.cage);
        cage.points.iter_mut().for_each(|p| *p = change(*p));
        dir.model("cage.obj", &cage);
    };
    cage(|p| p.map(|x| 0.01 * x));
    refused_unless_forced(&dir, ENCODE, &["cage.obj", "of the rest pose outside", "scaled by 100", "units"]);
    cage(|p| p.map(|x| 100.0 * x));
    let line = ENCODE;
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1), "{done:?}");
    assert_sentence(line, &done.stderr, &["cage.obj", "times larger than the rest pose", "scaled by 0.01", "--force"]);
}

#[test]
fn the_cage_of_another_model_is_refused_unless_forced() {
    let (dir, small) = Dir::with_capture();
    let slab: Vec<Point> = small.rest.points.iter().map(|p| [0.02 * p[0] + 3.0, 0.5 * p[1], 0.9 * p[2]]).collect();
    dir.model("cage.obj", &quad_box(&slab));
    refused_unless_forced(&dir, ENCODE, &["cage.obj", "of the rest pose outside", "another model"]);
}

#[test]
fn gaps_in_frame_numbers_are_refused_with_the_missing_numbers() {
    let (dir, small) = Dir::with_capture();
    for number in [1, 2, 3, 5, 8] {
        dir.model(&format!("poses/f{number}.obj"), &small.posed(number));
    }
    let line = "encode --rest rest.obj --cage cage.obj --frames poses -o out.cager --overwrite";
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1));
    assert_sentence(line, &done.stderr, &["poses", "4 and 6 to 7 are missing", "--allow-gaps"]);
    dir.cager(&format!("{line} --allow-gaps --report report.json")).succeeds();
    assert_eq!(dir.json("report.json")["frame_numbers"], serde_json::json!([1.0, 2.0, 3.0, 5.0, 8.0]));
}

#[test]
fn the_numbers_of_frame_files_signs_and_fractions_included_come_back_in_decoded_names() {
    let (dir, small) = Dir::with_capture();
    for (k, name) in ["f-2", "f-1", "f0", "f1", "f1.5", "f2"].iter().enumerate() {
        dir.model(&format!("poses/{name}.obj"), &small.posed(k));
    }
    dir.cager("encode --rest rest.obj --cage cage.obj --frames poses -o out.cager --overwrite").succeeds();
    dir.cager("decode out.cager -o back").succeeds();
    let names = ["-0002", "-0001", "0000", "0001", "0001.5", "0002"].map(|number| format!("frame_{number}.obj"));
    let mut sorted = names.to_vec();
    sorted.sort();
    assert_eq!(dir.names("back"), sorted);
    dir.cager("decode out.cager -o back.npy").succeeds();
    // In the order of their numbers, and the same frames.
    let single = |name: &str| -> Vec<Vec<f32>> {
        let frames = read_frames(&dir.path(name), small.rest.points.len());
        frames.iter().map(|frame| frame.iter().map(|&x| x as f32).collect()).collect()
    };
    assert_eq!(single("back"), single("back.npy"));
    let told = dir.cager("inspect out.cager").succeeds().stdout;
    assert!(told.contains("numbers   -2 to 2"), "{told}");
    let json: serde_json::Value =
        serde_json::from_str(&dir.cager("inspect --json out.cager").succeeds().stdout).expect("JSON");
    assert_eq!(json["frame_numbers"], serde_json::json!([-2.0, -1.0, 0.0, 1.0, 1.5, 2.0]));
}

#[test]
fn frame_rate_and_start_are_kept_and_can_be_given() {
    let (dir, small) = Dir::with_capture();
    let mdd = |name: &str| {
        let bytes = dir.read(name);
        let value = |k: usize| f32::from_be_bytes(bytes[4 * k..][..4].try_into().expect("four bytes"));
        [value(2), value(3)]
    };
    dir.cager(&format!("{ENCODE} --fps 50 --start 100")).succeeds();
    dir.cager("decode out.cager -o back.mdd").succeeds();
    assert_eq!(mdd("back.mdd"), [2.0, 2.02]);
    dir.cager("decode out.cager -o other.mdd --fps 10 --start 0").succeeds();
    assert_eq!(mdd("other.mdd"), [0.0, 0.1]);
    // What a cache tells is kept without being asked for.
    let mut pc2 = {
        dir.frames("walk.pc2", &small.frames);
        dir.read("walk.pc2")
    };
    pc2[20..24].copy_from_slice(&101_f32.to_le_bytes());
    pc2[24..28].copy_from_slice(&2_f32.to_le_bytes());
    dir.write("walk.pc2", &pc2);
    dir.cager("encode --rest rest.obj --cage cage.obj --frames walk.pc2 -o out.cager --overwrite").succeeds();
    dir.cager("decode out.cager -o back.pc2").succeeds();
    assert_eq!(dir.read("back.pc2")[..32], pc2[..32]);
    for wrong in ["--fps 0", "--fps -1", "--fps nan", "--start x"] {
        assert_eq!(dir.cager(&format!("{ENCODE} {wrong}")).run().status, Some(2), "{wrong}");
    }
}

#[test]
fn arrays_with_their_axes_in_another_order_encode_as_if_they_had_the_usual_one() {
    let (dir, small) = Dir::with_capture();
    dir.cager(&format!("{ENCODE} --report usual.json")).succeeds();
    let (frames, n) = (small.frames.len(), small.rest.points.len());
    let mut data = Vec::new();
    for frame in &small.frames {
        for k in 0..3 {
            data.extend((0..n).flat_map(|i| frame[3 * i + k].to_le_bytes()));
        }
    }
    dir.write("frames.npy", npy("<f8", false, &format!("({frames}, 3, {n})"), &data));
    dir.cager(&format!("{ENCODE} --report axes.json")).succeeds();
    assert_eq!(dir.json("axes.json")["error"], dir.json("usual.json")["error"]);
    let mut fortran = Vec::new();
    for k in 0..3 {
        for i in 0..n {
            fortran.extend(small.frames.iter().flat_map(|frame| frame[3 * i + k].to_le_bytes()));
        }
    }
    dir.write("frames.npy", npy("<f8", true, &format!("({frames}, {n}, 3)"), &fortran));
    dir.cager(&format!("{ENCODE} --report fortran.json")).succeeds();
    assert_eq!(dir.json("fortran.json")["error"], dir.json("usual.json")["error"]);
}

#[test]
fn a_cage_split_at_seams_is_welded_and_the_program_says_so() {
    let (dir, small) = Dir::with_capture();
    let (cage, from) = split(&as_model(&small.cage));
    dir.model("cage.obj", &cage);
    let done = dir.cager(&format!("{ENCODE} --report report.json")).succeeds();
    let merged = from.len() - small.cage.vertices.len();
    assert!(done.stderr.contains(&format!("cage.obj: merged {merged} vertices")), "{}", done.stderr);
    assert_eq!(dir.json("report.json")["cage_vertices"], small.cage.vertices.len());
}

#[test]
fn a_rest_pose_split_at_seams_is_welded_where_that_is_asked_for() {
    let (dir, small) = Dir::with_capture();
    let (rest, from) = split(&small.rest);
    dir.model("rest.obj", &rest);
    let n = small.rest.points.len();
    let done = dir.cager(ENCODE).run();
    assert_eq!(done.status, Some(1));
    assert_sentence(
        ENCODE,
        &done.stderr,
        &["frames.npy", &format!("{n} points"), &from.len().to_string(), "seams", "--weld"],
    );
    // Frames split as the rest pose is.
    let all: Vec<Vec<f64>> = small
        .frames
        .iter()
        .map(|frame| from.iter().flat_map(|&v| [0, 1, 2].map(|k| frame[3 * v + k])).collect())
        .collect();
    dir.write("split.npy", npy_f64(&all));
    let line =
        "encode --rest rest.obj --cage cage.obj --frames split.npy -o out.cager --overwrite --report report.json";
    dir.cager(&format!("{line} --weld")).succeeds();
    assert_eq!(dir.json("report.json")["points"], n);
    let welded = dir.json("report.json")["error"]["l2_mean"].as_f64().expect("an error");
    assert!(welded < 0.05, "{welded}");
}

#[test]
fn a_coordinate_too_large_is_blamed_on_its_frame_and_point_and_not_on_the_output() {
    let (dir, mut small) = Dir::with_capture();
    small.frames[6][3 * 41 + 1] = 1e300;
    dir.write("frames.npy", npy_f64(&small.frames));
    let done = dir.cager(ENCODE).run();
    assert_eq!(done.status, Some(1));
    assert_sentence(ENCODE, &done.stderr, &["frames.npy", "frame 6: point 41", "1e300"]);
    assert!(!done.stderr.contains("out.cager"), "{}", done.stderr);
}

#[test]
fn an_expanded_pattern_gets_the_hint_to_quote_it() {
    let (dir, small) = Dir::with_capture();
    dir.model("poses/1.obj", &small.posed(1));
    dir.model("poses/2.obj", &small.posed(2));
    let line = "encode --rest rest.obj --cage cage.obj --frames poses/1.obj poses/2.obj -o out.cager --overwrite";
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(2));
    assert!(done.stderr.contains("quote the pattern"), "{}", done.stderr);
}

#[test]
fn a_negative_spectrum_is_refused_with_what_may_be_given() {
    let (dir, _) = Dir::with_capture();
    let done = dir.cager(&format!("{ENCODE} --spectrum -1")).run();
    assert_eq!(done.status, Some(2));
    assert!(done.stderr.contains("give a whole number of at least 0, all, or auto"), "{}", done.stderr);
}

#[cfg(unix)]
#[test]
fn a_pipe_in_place_of_a_file_is_called_a_pipe() {
    let (dir, _) = Dir::with_encoded();
    dir.command("mkfifo", ["pipe.cager", "pipe.npy"]).succeeds();
    for (line, file) in [
        ("inspect pipe.cager", "pipe.cager"),
        ("decode pipe.cager -o back.npy", "pipe.cager"),
        ("encode --rest rest.obj --cage cage.obj --frames pipe.npy -o other.cager", "pipe.npy"),
    ] {
        let done = dir.cager(line).run();
        assert_eq!(done.status, Some(1), "{line}");
        assert!(done.stderr.contains(file) && !done.stderr.contains("check the disk"), "{}", done.stderr);
        assert!(
            done.stderr.contains("pipe or a device") || done.stderr.contains("not a regular file"),
            "{}",
            done.stderr
        );
    }
}
