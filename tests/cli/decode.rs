//! `cager decode`.

use crate::support::{Dir, measure, read_frames};
use cager_formats::read_model;

#[test]
fn every_output_format_holds_the_same_positions() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    dir.cager("decode out.cager -o back.npy").succeeds();
    let truth = read_frames(&dir.path("back.npy"), points);
    assert_eq!(truth.len(), 20);
    for output in ["back.pc2", "back.mdd", "poses", "slashed/", "binary/*.ply"] {
        dir.cager(&format!("decode out.cager -o {output}")).succeeds();
        let found = read_frames(&dir.path(output), points);
        // Text gives the shortest digits of an f32, which are that f32 again and no other.
        let same = truth.iter().flatten().zip(found.iter().flatten()).all(|(&a, &b)| a as f32 == b as f32);
        assert!(same && found.len() == 20, "{output}");
    }
    let errors = measure(&small.rest.points, &small.frames, &truth);
    assert!(errors.l2.iter().all(|&l2| l2 < 0.02), "{:?}", errors.l2);
}

#[test]
fn npy_is_what_numpy_loads() {
    let (dir, small) = Dir::with_encoded();
    dir.cager("decode out.cager -o back.npy").succeeds();
    let bytes = dir.read("back.npy");
    let header = String::from_utf8_lossy(&bytes[10..128]).into_owned();
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"));
    assert!(header.contains("'<f4'") && header.contains("False"), "{header}");
    assert!(header.contains(&format!("(20, {}, 3)", small.rest.points.len())), "{header}");
    assert_eq!(bytes.len(), 128 + 20 * small.rest.points.len() * 12);
}

#[test]
fn folder_has_one_mesh_per_frame_with_the_quads_of_the_model() {
    let (dir, small) = Dir::with_encoded();
    dir.cager("decode out.cager -o poses").succeeds();
    let names = dir.names("poses");
    assert_eq!(names.len(), 20);
    assert_eq!((names[0].as_str(), names[19].as_str()), ("frame_0000.obj", "frame_0019.obj"));
    assert!(small.rest.faces.arities().contains(&4));
    for name in names {
        let pose = read_model(&dir.path(&format!("poses/{name}"))).expect("a pose");
        assert!(pose.faces == small.rest.faces, "{name} has other faces than the model");
    }
}

#[test]
fn decoding_is_identical_each_time_and_for_any_number_of_threads() {
    let (dir, _) = Dir::with_encoded();
    dir.cager("decode out.cager -o back.npy").succeeds();
    let first = dir.read("back.npy");
    for threads in ["1", "2", "5"] {
        dir.cager("decode out.cager -o back.npy --overwrite").env("RAYON_NUM_THREADS", threads).succeeds();
        assert!(dir.read("back.npy") == first, "{threads} threads give other positions");
    }
}

#[test]
fn a_capture_needs_nothing_but_its_container() {
    let (dir, _) = Dir::with_encoded();
    let alone = Dir::new();
    alone.write("moved.cager", dir.read("out.cager"));
    alone.cager("decode moved.cager -o back.npy").succeeds();
    dir.cager("decode out.cager -o back.npy").succeeds();
    assert!(alone.read("back.npy") == dir.read("back.npy"));
    assert_eq!(alone.names(""), ["back.npy", "moved.cager"]);
}

#[test]
fn decoded_frames_encode_to_the_same_cages_again() {
    let (dir, _) = Dir::with_encoded();
    dir.cager("decode out.cager -o back.npy").succeeds();
    dir.cager("encode --rest rest.obj --cage cage.obj --frames back.npy -o again.cager --report again.json").succeeds();
    let worst = dir.json("again.json")["error"]["linf_max"].as_f64().expect("a number");
    // Both times the last directions are smoothed, so the second time little is left to lose.
    let first = dir.json("report.json")["error"]["linf_max"].as_f64().expect("a number");
    assert!(worst < first, "{worst} the second time, {first} the first");
}

#[test]
fn frame_rate_of_an_mdd_survives() {
    let (dir, small) = Dir::with_encoded();
    let mut mdd: Vec<u8> = Vec::new();
    mdd.extend((small.frames.len() as i32).to_be_bytes());
    mdd.extend((small.rest.points.len() as i32).to_be_bytes());
    mdd.extend((0..small.frames.len()).flat_map(|t| (t as f32 / 60.0).to_be_bytes()));
    mdd.extend(small.frames.iter().flatten().flat_map(|&x| (x as f32).to_be_bytes()));
    dir.write("walk.mdd", &mdd);
    dir.cager("encode --rest rest.obj --cage cage.obj --frames walk.mdd -o walk.cager").succeeds();
    dir.cager("decode walk.cager -o back.mdd").succeeds();
    let times = 8..8 + 4 * small.frames.len();
    assert_eq!(dir.read("back.mdd")[times.clone()], mdd[times]);
}

#[test]
fn morph_targets_are_decoded_and_encoded_again() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    dir.cager("decode out.cager -o back.npy").succeeds();
    let truth = read_frames(&dir.path("back.npy"), points);
    let told = dir.cager("decode out.cager -o walk.glb --targets 19").succeeds();
    assert!(told.stdout.contains("walk.glb: its 19 morph targets are"), "{}", told.stdout);
    // Of the quads of the rest pose it has the triangles.
    let line = "encode --rest rest.obj --cage cage.obj --frames walk.glb -o again.cager --force";
    dir.cager(line).succeeds();
    dir.cager("decode again.cager -o again.glb --max-error 1e-4 --float").succeeds();
    for name in ["walk.glb", "again.glb"] {
        let found = read_frames(&dir.path(name), points);
        assert_eq!(found.len(), 20);
        let errors = measure(&small.rest.points, &truth, &found);
        let limit = if name == "walk.glb" { 1e-4 } else { 0.02 };
        assert!(errors.l2.iter().all(|&l2| l2 < limit), "{name}: {:?}", errors.l2);
    }
    let refused = dir.cager("decode out.cager -o none.glb --max-error 1e-12").run();
    assert_eq!(refused.status, Some(1));
    assert!(refused.stderr.contains("cannot hold --max-error 0.000000000001"), "{}", refused.stderr);
}
