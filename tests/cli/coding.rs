//! Coded files: the bound that was asked for holds for every point of every frame, sizes and mean errors are met, and what cannot be is refused.

use crate::support::{Dir, ENCODE, Small, largest, mean, measure, polygons, read_frames};
use cager_capture::decode;
use cager_geometry::mesh::{Model, Polygons};

/// Encodes with more arguments, decodes, and gives the errors and the size.
fn coded(dir: &Dir, small: &Small, args: &str) -> (crate::support::Measured, u64) {
    dir.cager(&format!("{ENCODE} {args}")).succeeds();
    dir.cager("decode out.cager -o back.npy --overwrite").succeeds();
    let back = read_frames(&dir.path("back.npy"), small.rest.points.len());
    let size = std::fs::metadata(dir.path("out.cager")).expect("a file").len();
    (measure(&small.rest.points, &small.frames, &back), size)
}

#[test]
fn no_point_is_beyond_the_bound_whatever_moves() {
    let mut random = fastrand::Rng::with_seed(1);
    let (dir, plain) = Dir::with_capture();
    let size = cager_geometry::mesh::diagonal(&plain.rest.points);
    let mut kinds = vec![("plain", plain.frames.clone())];
    kinds.push(("one frame", plain.frames[7..8].to_vec()));
    kinds.push(("constant", vec![plain.frames[3].clone(); 12]));
    let mut noise = plain.frames.clone();
    noise.iter_mut().flatten().for_each(|x| *x += 0.02 * size * (random.f64() - 0.5));
    kinds.push(("noise", noise));
    let mut jump = plain.frames.clone();
    jump[9][300..303].iter_mut().for_each(|x| *x += 5.0 * size);
    kinds.push(("one vertex jumps", jump));
    let mut apart = plain.frames.clone();
    for (t, frame) in apart.iter_mut().enumerate().skip(10) {
        for (k, x) in frame.iter_mut().enumerate().take(120) {
            *x += 0.3 * (t - 10) as f64 * size * (k as f64).sin();
        }
    }
    kinds.push(("a part flies apart", apart));
    for (name, frames) in kinds {
        // What the program reads is in single precision.
        let frames: Vec<Vec<f64>> =
            frames.iter().map(|frame| frame.iter().map(|&x| f64::from(x as f32)).collect()).collect();
        let small = Small { rest: plain.rest.clone(), cage: plain.cage.clone(), frames };
        dir.frames("frames.npy", &small.frames);
        let mut sizes = Vec::new();
        for bound in [1e-2, 1e-3, 1e-4, 1e-5] {
            let (errors, bytes) = coded(&dir, &small, &format!("--max-error {bound} --force"));
            assert!(largest(&errors.linf) <= bound, "{name}: {} beyond {bound}", largest(&errors.linf));
            sizes.push(bytes);
        }
        assert!(sizes.is_sorted(), "{name}: {sizes:?}");
    }
}

#[test]
fn the_bound_holds_in_every_coordinate_system() {
    let (dir, small) = Dir::with_capture();
    for system in ["harmonic", "green", "green-free"] {
        for bound in [1e-3, 1e-5] {
            let (errors, _) = coded(&dir, &small, &format!("--coordinates {system} --max-error {bound}"));
            assert!(largest(&errors.linf) <= bound, "{system}: {} beyond {bound}", largest(&errors.linf));
        }
    }
}

#[test]
fn a_length_is_a_bound_in_the_unit_of_the_capture() {
    let (dir, small) = Dir::with_capture();
    let size = cager_geometry::mesh::diagonal(&small.rest.points);
    let (errors, _) = coded(&dir, &small, "--max-error 4mm --unit m");
    assert!(largest(&errors.linf) <= 0.004 / size);
    let coarse = coded(&dir, &small, "--max-error 4mm --unit cm").1;
    let fine = coded(&dir, &small, "--max-error 4mm --unit m").1;
    assert!(coarse < fine, "{coarse} {fine}");
}

#[test]
fn sizes_and_mean_errors_are_met() {
    let (dir, small) = Dir::with_capture();
    let whole = coded(&dir, &small, "").1;
    for bytes in [6_000, 9_000, 14_000] {
        let (_, size) = coded(&dir, &small, &format!("--target-size {bytes}"));
        assert!(size <= bytes && size > bytes * 4 / 5, "{size} of {bytes}");
    }
    // The size that is advised is met.
    let refused = dir.cager(&format!("{ENCODE} --target-size 300")).run().stderr;
    let advised = refused.split("allow at least ").nth(1).and_then(|rest| rest.split(',').next()).expect("a size");
    let (_, size) = coded(&dir, &small, &format!("--target-size {advised}"));
    assert!(size <= advised.parse().expect("a number"), "{size} of {advised}");
    // More room than can be used.
    assert!(coded(&dir, &small, "--target-size 10MB").1 < 10_000_000);
    for error in [3e-3, 1e-3, 2e-4] {
        let (errors, size) = coded(&dir, &small, &format!("--mean-error {error}"));
        assert!(mean(&errors.l2) <= error && mean(&errors.l2) > 0.5 * error, "{} of {error}", mean(&errors.l2));
        assert!(size < whole, "{size} {whole}");
    }
    let sizes = ["preview", "standard", "master"].map(|quality| coded(&dir, &small, &format!("--quality {quality}")).1);
    assert!(sizes.is_sorted(), "{sizes:?}");
}

#[test]
fn mean_errors_are_met_where_a_part_of_the_points_gives_the_first_step() {
    let (dir, capture) = Dir::with(Small::of(3_200));
    for error in [1e-3, 5e-5] {
        let (errors, _) = coded(&dir, &capture, &format!("--mean-error {error}"));
        assert!(mean(&errors.l2) <= error && mean(&errors.l2) > 0.9 * error, "{} of {error}", mean(&errors.l2));
    }
}

#[test]
fn without_a_cage_its_size_is_chosen_for_the_bound() {
    let (dir, _) = Dir::with_capture();
    let encode = ENCODE.replace(" --cage cage.obj", "");
    let chosen = |bound: &str, output: &str| -> u64 {
        let encode = encode.replace("out.cager", output);
        let args = format!("{encode} --max-error {bound} --time-limit 1 --report {output}.json");
        let said = dir.cager(&args).succeeds().stdout;
        assert!(said.contains("vertices, estimated from what a small cage leaves"), "{said}");
        dir.json(&format!("{output}.json"))["cage_vertices"].as_u64().expect("a number")
    };
    let (coarse, fine) = (chosen("5e-2", "coarse.cager"), chosen("1e-4", "fine.cager"));
    assert!(coarse <= 80 && coarse <= fine, "{coarse} {fine}");
}

#[test]
fn what_cannot_be_met_is_refused_in_a_sentence_and_nothing_is_written() {
    let (dir, _) = Dir::with_capture();
    let before = dir.contents();
    for (args, said) in [
        ("--max-error 1e-8", "ask for at least"),
        ("--max-error 1e-12", "ask for at least"),
        ("--target-size 300", "allow at least"),
        ("--max-error 0.2mm", "needs --unit"),
        ("--max-error 5m --unit mm", "times the rest pose's diagonal"),
        ("--mean-error 1e-12", "single precision"),
        ("--dry-run --max-error 0.2mm", "needs --unit"),
        ("--mean-error NaN", "above 0"),
    ] {
        let output = dir.cager(&format!("{ENCODE} {args}")).run();
        assert_eq!(output.status, Some(1), "{args}: {}", output.stderr);
        assert!(output.stderr.contains(said), "{args}: {}", output.stderr);
    }
    for (args, said) in [
        ("--max-error NaN", "number"),
        ("--max-error -1", "above 0"),
        ("--max-error 3furlong", "no unit"),
        ("--max-error 2", "below 1"),
        ("--target-size little", "500KB"),
        ("--max-error 1e-3 --quality master", "cannot be used with"),
    ] {
        let output = dir.cager(&format!("{ENCODE} {args}")).run();
        assert_eq!(output.status, Some(2), "{args}: {}", output.stderr);
        assert!(output.stderr.contains(said), "{args}: {}", output.stderr);
    }
    assert!(dir.contents() == before);
}

/// Each polygon beginning with its smallest corner, in order.
fn turned(faces: &Polygons) -> Vec<Vec<u32>> {
    let least = |face: &[u32]| (0..face.len()).map(|k| [&face[k..], &face[..k]].concat()).min().expect("corners");
    let mut all: Vec<Vec<u32>> = faces.iter().map(least).collect();
    all.sort();
    all
}

#[test]
fn the_rest_pose_comes_back_with_its_polygons_and_the_order_of_its_points() {
    let (dir, mut small) = Dir::with_capture();
    // Two triangles in three become quads and pentagons that share edges with the others, and some points have no face.
    let triangles = small.rest.faces.triangulated();
    let kept = triangles.iter().skip(40).map(|t| t.to_vec());
    small.rest = Model {
        points: small.rest.points.clone(),
        faces: polygons(kept.chain([vec![0, 5, 9, 2], vec![3, 8, 1, 7, 6]])),
        ..Model::default()
    };
    dir.model("rest.obj", &small.rest);
    let rest = || decode::open(&dir.path("out.cager")).expect("a container").rest().expect("a rest pose");
    coded(&dir, &small, "--max-error 1e-3");
    let found = rest();
    assert_eq!(turned(&found.faces), turned(&small.rest.faces));
    let size = cager_geometry::mesh::diagonal(&small.rest.points);
    for (a, b) in found.points.iter().zip(&small.rest.points) {
        assert!((0..3).all(|k| (a[k] - b[k]).abs() <= 2.6e-4 * size), "{a:?} {b:?}");
    }
    coded(&dir, &small, "--max-error 1e-3 --exact-rest");
    assert_eq!(rest(), small.rest);
}

#[test]
fn frames_decode_alone_and_layers_on_their_own() {
    let (dir, small) = Dir::with_capture();
    coded(&dir, &small, "--max-error 1e-4");
    let all = dir.read("back.npy");
    let points = small.rest.points.len();
    let whole = read_frames(&dir.path("back.npy"), points);
    dir.cager("decode out.cager -o some.npy --range 3-15x4").succeeds();
    let some = read_frames(&dir.path("some.npy"), points);
    for (found, expected) in some.iter().zip([3, 7, 11, 15]) {
        let off = found.iter().zip(&whole[expected]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{off}");
    }
    dir.cager("decode out.cager -o cages.npy --layer cages").succeeds();
    let cages = measure(&small.rest.points, &small.frames, &read_frames(&dir.path("cages.npy"), points));
    let full = measure(&small.rest.points, &small.frames, &whole);
    assert!(mean(&cages.l2) > 5.0 * mean(&full.l2), "{} {}", mean(&cages.l2), mean(&full.l2));
    // Cages out and in again move the model as its own cages do, with all that is beside them.
    dir.cager("decode out.cager --cages -o only.npy").succeeds();
    dir.cager("decode out.cager --with-cages only.npy -o again.npy").succeeds();
    // Cages whose decoded positions would be infinite.
    dir.frames("far.npy", &vec![vec![3e38; 3 * small.cage.vertices.len()]; 2]);
    let said = dir.cager("edit out.cager --with-cages far.npy -o far.cager").run();
    assert!(said.status == Some(1) && said.stderr.contains("too far away"), "{}", said.stderr);
    for rate in ["1e-300", "1e30"] {
        assert_eq!(dir.cager(&format!("decode out.cager --fps {rate} -o odd.mdd")).run().status, Some(2));
    }
    let again = read_frames(&dir.path("again.npy"), points);
    let off = again.iter().flatten().zip(whole.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off}");
    dir.cager("edit out.cager --with-cages only.npy -o edited.cager").succeeds();
    let said = dir.cager("inspect out.cager").succeeds().stdout;
    assert!(said.contains("guaranteed") && said.contains("resi"), "{said}");
    let inspected: serde_json::Value =
        serde_json::from_str(&dir.cager("inspect out.cager --json").succeeds().stdout).expect("JSON");
    assert_eq!(inspected["coding"]["max_error"], 1e-4);
    // The same input gives the same bytes, with any number of threads.
    let first = dir.read("out.cager");
    for threads in [1, 3] {
        dir.cager(&format!("{ENCODE} --max-error 1e-4 --threads {threads}")).succeeds();
        assert!(dir.read("out.cager") == first, "{threads} threads");
    }
    dir.cager("decode out.cager -o back.npy --overwrite --threads 1").succeeds();
    assert!(dir.read("back.npy") == all);
}

#[test]
fn damage_is_named_or_does_no_harm() {
    let (dir, small) = Dir::with_capture();
    coded(&dir, &small, "--max-error 1e-3");
    let bytes = dir.read("out.cager");
    for at in (20..bytes.len()).step_by(bytes.len() / 40) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        dir.write("damaged.cager", &damaged);
        let output = dir.cager("inspect damaged.cager").run();
        assert_eq!(output.status, Some(1), "byte {at}: {}", output.stderr);
        assert!(output.stderr.contains("damaged.cager"), "{}", output.stderr);
    }
}

#[test]
fn a_size_is_used_where_a_capture_begins_still() {
    let (dir, small) = Dir::with_capture();
    let frames = (0..330).map(|t| small.frames[if t < 60 { 0 } else { t % 20 }].clone()).collect();
    let small = Small { frames, ..small };
    dir.frames("frames.npy", &small.frames);
    let (_, size) = coded(&dir, &small, "--target-size 40000");
    assert!((28_000..=40_000).contains(&size), "{size}");
}

#[test]
fn a_large_plane_is_read_again() {
    let dir = Dir::new();
    let side = 300u32;
    let at = |i: u32, j: u32| i * side + j;
    let squares = (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j)));
    let faces = polygons(squares.map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]));
    let points = (0..side * side).map(|k| [f64::from(k / side), f64::from(k % side), 0.0]).collect();
    let rest = Model { points, faces, ..Model::default() };
    dir.model("rest.obj", &rest);
    dir.model("cage.obj", &crate::support::quad_box(&rest.points));
    let frame: Vec<f64> = rest.points.as_flattened().to_vec();
    dir.frames("frames.npy", &[frame.clone(), frame]);
    dir.cager(&format!("{ENCODE} --max-error 1e-2")).succeeds();
    dir.cager("decode out.cager -o back.npy").succeeds();
}

#[test]
fn what_is_intact_of_a_damaged_or_cut_file_is_decoded() {
    let (dir, small) = Dir::with_capture();
    // Long enough for two groups.
    let small = Small { frames: small.frames.iter().cycle().take(300).cloned().collect(), ..small };
    dir.frames("frames.npy", &small.frames);
    coded(&dir, &small, "--max-error 1e-3");
    let points = small.rest.points.len();
    let whole = read_frames(&dir.path("back.npy"), points);
    let bytes = dir.read("out.cager");
    let last = |tag: &[u8]| bytes.windows(4).rposition(|window| window == tag).expect("a section");
    let second = bytes[..last(b"TOC_")].windows(4).rposition(|window| window == b"FRAM").expect("a group");
    let mut damaged = bytes.clone();
    damaged[second + 60] ^= 1;
    dir.write("damaged.cager", &damaged);
    dir.write("cut.cager", &bytes[..second + 70]);
    for name in ["damaged", "cut"] {
        assert_eq!(dir.cager(&format!("decode {name}.cager -o {name}.npy")).run().status, Some(1));
        let said = dir.cager(&format!("decode {name}.cager -o {name}.npy --salvage")).succeeds().stderr;
        let lost =
            if name == "cut" { "frames after frame 255 are lost" } else { "44 of frames 256 to 299 are damaged" };
        assert!(said.contains(lost), "{said}");
        let found = read_frames(&dir.path(&format!("{name}.npy")), points);
        assert!(found == whole[..256], "{name}: {} frames", found.len());
    }
    let said = dir.cager("decode damaged.cager -o none.npy --salvage --frame 270").run().stderr;
    assert!(said.contains("damaged.cager: no frame is left: frame 270 is damaged"), "{said}");
    // Frames whose numbers alone are damaged.
    dir.cager(&format!("{ENCODE} --max-error 1e-3 --start 101")).succeeds();
    let mut bytes = dir.read("out.cager");
    let end = bytes.windows(4).rposition(|window| window == b"TOC_").expect("a table of contents");
    let numbers = bytes[..end].windows(4).rposition(|window| window == b"fnum").expect("numbers");
    bytes[numbers + 70] ^= 1;
    dir.write("numbers.cager", &bytes);
    assert_eq!(dir.cager("decode numbers.cager -o numbers.npy").run().status, Some(1));
    let said = dir.cager("decode numbers.cager -o numbers.npy --salvage").succeeds().stderr;
    assert!(said.contains("the numbers of its frames are damaged"), "{said}");
    assert!(read_frames(&dir.path("numbers.npy"), points) == whole);
    // Without any frame, or without the whole model.
    dir.write("cut.cager", &bytes[..200]);
    let output = dir.cager("decode cut.cager -o none.npy --salvage").run();
    assert_eq!(output.status, Some(1));
    assert!(output.stderr.contains("missing"), "{}", output.stderr);
}
