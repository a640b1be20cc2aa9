//! Bad input: one sentence that names the file and the place, exit status 1, and nothing left behind.

mod cages;
mod containers;

use crate::support::{Dir, ENCODE, Small, as_model, npy, npy_f64, polygons, quad_box};
use cager_geometry::mesh::{Model, Polygons};

/// Runs a command that must be refused with one line that has all these words, and must leave the folder as it was.
#[track_caller]
pub(crate) fn refused(dir: &Dir, line: &str, words: &[&str]) {
    let before = dir.contents();
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1), "{line}: {}{}", done.stdout, done.stderr);
    assert_sentence(line, &done.stderr, words);
    assert_eq!(done.stdout, "", "{line}");
    assert!(dir.contents() == before, "{line}: the folder was changed; it has {:?}", dir.names(""));
}

#[track_caller]
pub(crate) fn assert_sentence(line: &str, stderr: &str, words: &[&str]) {
    assert!(stderr.starts_with("cager: "), "{line}: {stderr}");
    assert!(stderr.ends_with('\n') && stderr.lines().count() == 1, "{line}: more than one line: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{line}: {word:?} is missing in {stderr}");
    }
    // A cause printed by two layers is a stutter.
    let message = stderr.trim_end().trim_start_matches("cager: ");
    let half: String = message.chars().skip(message.chars().count() / 2).collect();
    assert!(half.len() < 12 || message.matches(half.trim_start_matches([':', ' '])).count() == 1, "twice: {message}");
    if let Some(file) = words.first().filter(|word| word.contains('.') && !word.starts_with('-')) {
        assert_eq!(message.matches(file).count(), 1, "{file} is named more than once: {message}");
    }
}

#[test]
fn fewer_points_than_unknowns_are_refused_with_both_numbers() {
    let (dir, small) = Dir::with_capture();
    dir.model("rest.obj", &Model { points: small.rest.points[..50].to_vec(), ..Model::default() });
    let frames: Vec<Vec<f64>> = small.frames.iter().map(|f| f[..150].to_vec()).collect();
    dir.frames("few.npy", &frames);
    let m = format!("{} unknowns", small.cage.vertices.len());
    refused(
        &dir,
        "encode --rest rest.obj --cage cage.obj --frames few.npy -o out.cager --overwrite",
        &["rest.obj", "50 points", &m],
    );
}

#[test]
fn points_in_one_place_or_too_far_apart_are_refused() {
    let (dir, small) = Dir::with_capture();
    let mut far = small.rest.clone();
    far.points[7] = [1e200, 0.0, 0.0];
    dir.model("rest.obj", &far);
    refused(&dir, ENCODE, &["rest.obj", "too large"]);
    dir.model("rest.obj", &Model { points: vec![[0.0, 0.0, 1.0]; small.rest.points.len()], ..Model::default() });
    refused(&dir, ENCODE, &["rest.obj", "same place"]);
}

/// The text of a mesh with one coordinate replaced; gives the number of the line too.
fn spoilt_obj(model: &Model, vertex: usize, word: &str) -> (String, usize) {
    let mut text = String::from("# exported by hand\n");
    for (i, [x, y, z]) in model.points.iter().enumerate() {
        if i == vertex {
            text += &format!("v {x} {word} {z}\n");
        } else {
            text += &format!("v {x} {y} {z}\n");
        }
    }
    for face in model.faces.iter() {
        text += "f";
        for v in face {
            text += &format!(" {}", v + 1);
        }
        text += "\n";
    }
    (text, vertex + 2)
}

#[test]
fn rest_pose_or_cage_that_is_not_finite_is_refused_with_the_line() {
    let (dir, small) = Dir::with_capture();
    for word in ["nan", "NaN", "inf", "-inf", "1e999"] {
        let (text, line) = spoilt_obj(&small.rest, 123, word);
        dir.write("rest.obj", text);
        refused(&dir, ENCODE, &["rest.obj", &format!("line {line}")]);
    }
    dir.model("rest.obj", &small.rest);
    for word in ["nan", "-inf", "x"] {
        let (text, line) = spoilt_obj(&as_model(&small.cage), 31, word);
        dir.write("cage.obj", text);
        refused(&dir, ENCODE, &["cage.obj", &format!("line {line}")]);
    }
}

#[test]
fn binary_mesh_that_is_not_finite_is_refused_with_the_vertex() {
    let (dir, small) = Dir::with_capture();
    for (bad, vertex) in [(f32::NAN, 77), (f32::NEG_INFINITY, 0)] {
        let n = small.rest.points.len();
        let mut ply = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        )
        .into_bytes();
        for (i, p) in small.rest.points.iter().enumerate() {
            for (k, &x) in p.iter().enumerate() {
                let x = if i == vertex && k == 2 { bad } else { x as f32 };
                ply.extend(x.to_le_bytes());
            }
        }
        dir.write("rest.ply", ply);
        refused(
            &dir,
            "encode --rest rest.ply --cage cage.obj --frames frames.npy -o out.cager --overwrite",
            &["rest.ply", &format!("vertex {vertex}")],
        );
    }
}

#[test]
fn frame_that_is_not_finite_is_refused_with_the_frame_and_the_point() {
    for (bad, frame, point) in [(f64::NAN, 0, 5), (f64::INFINITY, 13, 0), (f64::NEG_INFINITY, 19, 599)] {
        let (dir, mut small) = Dir::with_capture();
        let point = point.min(small.rest.points.len() - 1);
        small.frames[frame][3 * point + 1] = bad;
        dir.write("frames.npy", npy_f64(&small.frames));
        refused(&dir, ENCODE, &["frames.npy", &format!("frame {frame}:"), &format!("point {point} ")]);
    }
}

#[test]
fn frame_too_large_for_a_container_is_refused_with_the_frame() {
    let (dir, mut small) = Dir::with_capture();
    small.frames[6].fill(1e200);
    dir.write("frames.npy", npy_f64(&small.frames));
    refused(&dir, ENCODE, &["frame 6"]);
}

#[test]
fn wrong_frame_in_a_folder_is_refused_with_its_file_and_frame() {
    let (dir, small) = Dir::with_capture();
    for frame in 0..12 {
        dir.model(&format!("poses/{frame}.obj"), &small.posed(frame));
    }
    let line = "encode --rest rest.obj --cage cage.obj --frames poses -o out.cager --overwrite";
    let mut short = small.posed(10);
    short.points.pop();
    short.faces = Polygons::new();
    dir.model("poses/10.obj", &short);
    let n = small.rest.points.len();
    refused(&dir, line, &["poses/10.obj", "frame 10 ", &format!("{} points", n - 1), &n.to_string()]);
    let (text, number) = spoilt_obj(&small.posed(10), 40, "nan");
    dir.write("poses/10.obj", text);
    refused(&dir, line, &["poses/10.obj", "frame 10:", &format!("line {number}")]);
    dir.write("poses/10.obj", "");
    refused(&dir, line, &["poses/10.obj", "frame 10:", "empty"]);
}

#[test]
fn capture_of_another_mesh_is_refused_with_both_numbers() {
    let (dir, small) = Dir::with_capture();
    let n = small.rest.points.len();
    let frames: Vec<Vec<f64>> = small.frames.iter().map(|f| f[3..].to_vec()).collect();
    for name in ["other.npy", "other.pc2", "other.mdd"] {
        dir.frames(name, &frames);
        refused(
            &dir,
            &format!("encode --rest rest.obj --cage cage.obj --frames {name} -o out.cager --overwrite"),
            &[name, &(n - 1).to_string(), &format!("{n} are expected")],
        );
    }
}

#[test]
fn frames_that_are_not_there_are_refused() {
    let (dir, small) = Dir::with_capture();
    dir.write("notes/readme.txt", "no frames");
    std::fs::create_dir(dir.path("empty")).expect("a folder");
    dir.model("mixed/1.obj", &small.rest);
    dir.model("mixed/2.ply", &small.rest);
    dir.write("walk.dae", "a format that is not read");
    dir.write("walk.mp4", "another");
    for (frames, word) in [
        ("empty", "no mesh files"),
        ("notes", "no mesh files"),
        ("walk*.obj", "no mesh files"),
        ("nowhere/*.obj", "no mesh files"),
        ("nowhere", "check the path"),
        ("nowhere.npy", "check the path"),
        ("mixed", "mixes"),
        ("walk.dae", "export the animated mesh as Alembic, USD or a point cache, .abc, .usdc, .pc2 or .mdd"),
        ("walk.mp4", ".npy .pc2 .mdd"),
        ("[.obj", "pattern"),
    ] {
        refused(
            &dir,
            &format!("encode --rest rest.obj --cage cage.obj --frames {frames} -o out.cager --overwrite"),
            &[frames, word],
        );
    }
}

#[test]
fn missing_and_unreadable_meshes_are_refused() {
    let (dir, _) = Dir::with_capture();
    dir.write("rest.dae", "a format that is not read");
    dir.write("bare", "no extension");
    dir.write("empty.obj", "");
    dir.write("text.obj", "Dear reader,\nthis is a letter.\n");
    std::fs::create_dir(dir.path("folder.obj")).expect("a folder");
    for (rest, word) in [
        ("nowhere.obj", "check the path"),
        ("rest.obj/x.obj", "check the path"),
        ("rest.dae", ".obj .ply .off .stl .glb"),
        ("bare", "extension"),
        ("empty.obj", "empty"),
        ("text.obj", "no points"),
        ("folder.obj", "name a file"),
    ] {
        let rest_line = format!("encode --rest {rest} --cage cage.obj --frames frames.npy -o out.cager --overwrite");
        refused(&dir, &rest_line, &[rest, word]);
        let cage_line = format!("encode --rest rest.obj --cage {rest} --frames frames.npy -o out.cager --overwrite");
        refused(&dir, &cage_line, &[rest, word]);
    }
}

#[test]
fn truncated_point_cache_is_refused_wherever_it_was_cut() {
    let (dir, small) = Dir::with_capture();
    for kind in ["npy", "pc2", "mdd"] {
        dir.frames(&format!("whole.{kind}"), &small.frames);
        let whole = dir.read(&format!("whole.{kind}"));
        let name = format!("cut.{kind}");
        let line = format!("encode --rest rest.obj --cage cage.obj --frames {name} -o out.cager --overwrite");
        for length in [0, 1, 4, 7, 11, 20, 31, whole.len() / 2, whole.len() - 1] {
            dir.write(&name, &whole[..length]);
            refused(&dir, &line, &[&name]);
        }
        dir.write(&name, [whole.as_slice(), b"excess"].concat());
        refused(&dir, &line, &[&name, "6 bytes are in excess"]);
        dir.write(&name, &whole[..whole.len() - 12 * small.rest.points.len() - 1]);
        refused(&dir, &line, &[&name, "20 frames", "18 whole frames"]);
    }
}

#[test]
fn arrays_of_other_types_orders_and_shapes_are_refused() {
    let (dir, small) = Dir::with_capture();
    let (frames, n) = (small.frames.len(), small.rest.points.len());
    let shape = format!("({frames}, {n}, 3)");
    let data = vec![0; 8 * 3 * n * frames];
    for (kind, fortran, shape, word) in [
        ("<i4", false, shape.as_str(), "<i4"),
        ("<f2", false, &shape, "<f2"),
        ("<c8", false, &shape, "<c8"),
        ("<f4", false, &format!("({n}, {frames}, 3)"), "transpose"),
        ("<f4", false, &format!("({})", 3 * frames * n), "shape"),
        ("<f4", false, "(0, 5, 3)", "5"),
        ("<f4", false, &format!("(99999999999999999999, {n}, 3)"), "header"),
    ] {
        dir.write("frames.npy", npy(kind, fortran, shape, &data));
        refused(&dir, ENCODE, &["frames.npy", word]);
    }
}

#[test]
fn bad_solver_options_are_refused_by_the_options_name() {
    let (dir, small) = Dir::with_capture();
    for lambda in ["nan", "NaN", "-1", "-0.5", "inf"] {
        refused(&dir, &format!("{ENCODE} --lambda {lambda}"), &["--lambda", "at least 0"]);
        refused(&dir, &format!("{ENCODE} --spectrum auto --lambda {lambda}"), &["--lambda", "at least 0"]);
    }
    let m = small.cage.vertices.len();
    refused(&dir, &format!("{ENCODE} --spectrum {}", m + 1), &["--spectrum", &format!("at most {m}")]);
    dir.cager(&format!("{ENCODE} --spectrum {m}")).succeeds();
}

#[test]
fn bad_solver_options_are_refused_in_the_same_words_before_anything_is_sent() {
    let (dir, small) = Dir::with_capture();
    let (m, head) = (small.cage.vertices.len(), "%%MatrixMarket matrix coordinate real general\n");
    dir.write("wide.mtx", format!("{head}3 {} 1\n1 1 1\n", m + 1));
    for (options, words) in [
        ("--lambda nan", ["--lambda", "at least 0"]),
        ("--lambda inf", ["--lambda", "at least 0"]),
        ("--lambda -1", ["--lambda", "at least 0"]),
        ("--spectrum 4294967296", ["--spectrum", "at most"]),
        ("--spectrum 4294967316", ["--spectrum", "at most"]),
        ("--handles spread --handle-count 4294967296", ["--handle-count", "points"]),
        ("--handles rectangular --handle-count 3", ["--handle-count", "unknowns"]),
        ("--regularizer matrix --regularizer-matrix wide.mtx", ["wide.mtx", "columns"]),
    ] {
        let line = format!("{ENCODE} {options}");
        refused(&dir, &line, &words);
        // Nobody listens there: what is said is said without asking.
        let there = format!("{line} --server http://127.0.0.1:9");
        refused(&dir, &there, &words);
        assert_eq!(dir.cager(&line).run().stderr, dir.cager(&there).run().stderr, "{options}");
    }
}

#[test]
fn output_that_cannot_be_written_is_refused_before_the_work() {
    let (dir, _) = Dir::with_encoded();
    let line = "encode --rest rest.obj --cage cage.obj --frames frames.npy";
    std::fs::create_dir(dir.path("folder")).expect("a folder");
    let mut places = vec!["rest.obj/out.cager", "nowhere/out.cager", "folder", "folder/.."];
    if cfg!(target_os = "linux") {
        // A pipe here, which what is written whole at the end has no use for.
        places.extend(["/proc/out.cager", "/dev/full", "/dev/stdout"]);
    }
    for place in places {
        refused(&dir, &format!("{line} -o {place}"), &[place]);
        // The report's place is looked at before anything is written, so that there is no .cager without its report.
        refused(&dir, &format!("{line} -o new.cager --report {place}"), &[place]);
    }
    for place in ["rest.obj/back.npy", "nowhere/back.pc2", "nowhere/poses", "back.fbx", "rest.obj/"] {
        refused(&dir, &format!("decode out.cager -o {place}"), &[place]);
    }
    dir.write("full/keep.txt", "mine");
    refused(&dir, "decode out.cager -o full", &["full", "not empty"]);
    std::fs::create_dir(dir.path("folder.npy")).expect("a folder");
    dir.write("folder.npy/keep.txt", "mine");
    refused(&dir, "decode out.cager -o folder.npy", &["folder.npy"]);
}

#[test]
fn output_in_place_of_an_input_is_refused() {
    let (dir, _) = Dir::with_capture();
    let line = "encode --rest rest.obj --cage cage.obj --frames frames.npy";
    for input in ["rest.obj", "./cage.obj", "frames.npy"] {
        refused(&dir, &format!("{line} -o {input}"), &[input, "input"]);
        refused(&dir, &format!("{line} -o out.cager --overwrite --report {input}"), &[input, "input"]);
    }
    refused(&dir, &format!("{line} -o both --report both"), &["both", "two files"]);
    dir.write("both", "an old file");
    refused(&dir, &format!("{line} -o both --report ./both --overwrite"), &["both", "two files"]);
}

#[test]
fn small_capture_by_itself_is_good() {
    // What all the others spoil in one place.
    let small = Small::new();
    assert!(small.frames.iter().flatten().all(|x| x.is_finite()));
    let (dir, _) = Dir::with_capture();
    assert_eq!(dir.cager(ENCODE).succeeds().stderr, "");
}

#[test]
fn a_frame_of_the_captures_own_folder_is_not_replaced_by_the_output() {
    let (dir, small) = Dir::with_capture();
    for t in 0..3 {
        dir.model(&format!("walk/{t}.obj"), &small.posed(t));
    }
    for frames in ["walk", "walk/*.obj"] {
        let line = format!("encode --rest rest.obj --cage cage.obj --frames {frames} -o walk/1.obj");
        refused(&dir, &line, &["1.obj", "is an input"]);
        refused(&dir, &format!("{line} --overwrite"), &["1.obj", "is an input"]);
    }
}

#[test]
fn faces_of_a_polygon_cage_are_counted_as_in_its_file() {
    let (dir, small) = Dir::with_capture();
    let mut cage = quad_box(&small.rest.points);
    let quads: Vec<Vec<u32>> = cage.faces.iter().map(<[u32]>::to_vec).collect();
    cage.faces = polygons(quads.iter().cloned().chain([quads[5].clone()]));
    dir.model("cage.obj", &cage);
    refused(&dir, ENCODE, &["cage.obj", "faces 5 and 6 "]);
}

#[test]
fn a_point_far_from_the_cage_is_refused_by_number() {
    let (dir, mut small) = Dir::with_capture();
    small.rest.points[17] = [1e9, 0.0, 0.0];
    dir.model("rest.obj", &small.rest);
    refused(&dir, ENCODE, &["rest.obj", "point 17 "]);
}

#[test]
fn handles_that_cannot_be_read_are_refused_with_the_numbers_that_count() {
    let (dir, small) = Dir::with_capture();
    let (m, n) = (small.cage.vertices.len(), small.rest.points.len());
    let range = [format!("{m} unknowns"), format!("{n} points")];
    for handles in ["spread", "rectangular"] {
        for count in [0, m - 1, n + 1] {
            let line = format!("{ENCODE} --handles {handles} --handle-count {count}");
            refused(&dir, &line, &["--handle-count", &count.to_string(), &range[0], &range[1]]);
        }
    }
    for handles in ["maxvol", "all"] {
        let line = format!("{ENCODE} --handles {handles} --handle-count {}", 2 * m);
        refused(&dir, &line, &["--handle-count", "leave it out"]);
    }
}

#[test]
fn matrices_that_do_not_fit_are_refused_with_their_file() {
    let (dir, small) = Dir::with_capture();
    let m = small.cage.vertices.len();
    let line = format!("{ENCODE} --regularizer matrix --regularizer-matrix d.mtx");
    let head = "%%MatrixMarket matrix coordinate real general\n";
    refused(&dir, &line, &["d.mtx", "cannot be read"]);
    for (text, words) in [
        ("v 0 0 0\n".to_owned(), vec!["line 1".to_owned(), "%%MatrixMarket".to_owned()]),
        (format!("{head}3 {m} 1\n1 1 inf\n"), vec!["line 3".to_owned(), "NaN or infinite".to_owned()]),
        (format!("{head}3 {m} 1\n4 1 1\n"), vec!["line 3".to_owned(), "from 1 to 3".to_owned()]),
        (format!("{head}9999999999999 {m} 1\n1 1 1\n"), vec!["line 2".to_owned(), "larger than any".to_owned()]),
        (format!("{head}3 {} 1\n1 1 1\n", m + 1), vec![format!("{} columns", m + 1), format!("{m} vertices")]),
    ] {
        dir.write("d.mtx", text);
        let words: Vec<&str> = std::iter::once("d.mtx").chain(words.iter().map(String::as_str)).collect();
        refused(&dir, &line, &words);
    }
    refused(
        &dir,
        &format!("{ENCODE} --regularizer matrix"),
        &["--regularizer matrix", "--regularizer-matrix FILE.mtx"],
    );
    let line = format!("{ENCODE} --regularizer-matrix d.mtx");
    refused(&dir, &line, &["--regularizer-matrix", "differential uses no matrix"]);
}

#[test]
fn thresholds_that_cannot_be_chosen_are_refused() {
    let (dir, _) = Dir::with_capture();
    for bound in ["-0.1", "nan", "inf"] {
        let line = format!("{ENCODE} --spectrum auto --spectrum-bound {bound}");
        refused(&dir, &line, &["--spectrum-bound", "at least 0"]);
    }
    for bound in ["1e300", "101"] {
        let line = format!("{ENCODE} --spectrum auto --spectrum-bound {bound}");
        refused(&dir, &line, &["--spectrum-bound", "at most 100"]);
    }
    refused(&dir, &format!("{ENCODE} --spectrum-bound 0.1"), &["--spectrum-bound", "--spectrum auto"]);
    refused(
        &dir,
        &format!("{ENCODE} --regularizer none --spectrum auto"),
        &["--spectrum auto", "none has no threshold"],
    );
    let line = format!("{ENCODE} --spectrum auto --server http://127.0.0.1:9");
    refused(&dir, &line, &["--spectrum auto", "without --server"]);
}
