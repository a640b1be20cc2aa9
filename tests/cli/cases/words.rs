//! What is said about files that are not read and arguments that do not fit.

use crate::refused::assert_sentence;
use crate::support::{Dir, read_frames};
use cager_formats::read_model;

const CASE: &str = "19-words";

#[track_caller]
fn refused(dir: &Dir, line: &str, words: &[&str]) {
    let before = dir.contents();
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1), "{line}: {}{}", done.stdout, done.stderr);
    assert_sentence(line, &done.stderr, words);
    assert!(dir.contents() == before, "{line}: the folder was changed");
}

#[test]
fn scenes_that_are_not_read_name_the_way_out() {
    let dir = Dir::with_case(CASE);
    dir.write("scene.blend", "BLENDER");
    dir.write("walk.dae", "<COLLADA");
    dir.write("scenes/f1.dae", "<COLLADA");
    dir.write("scenes/f2.dae", "<COLLADA");
    for frames in ["walk.dae", "scene.blend", "scenes", "scenes/*.dae"] {
        let line = format!("encode --rest rest.obj --cage cage.obj --frames {frames} -o out.cager");
        refused(&dir, &line, &["not read", ".abc, .usdc, .pc2 or .mdd", "docs/BLENDER.md"]);
    }
}

#[test]
fn alembic_archives_go_in_and_out() {
    let dir = Dir::with_case(CASE);
    let points = read_model(&dir.path("rest.obj")).expect("the rest pose").points.len();
    dir.cager("decode walk.cager -o out.abc").succeeds();
    dir.cager("decode walk.cager -o out.npy").succeeds();
    assert_eq!(read_frames(&dir.path("out.abc"), points), read_frames(&dir.path("out.npy"), points));
    // The only mesh, whatever it is called.
    dir.cager("encode --rest out.abc --cage cage.obj --frames out.abc --prim hat -o again.cager").succeeds();
    dir.cager("decode again.cager -o again.abc").succeeds();
    let line = "encode --rest rest.obj --cage cage.obj --frames";
    refused(&dir, &format!("{line} walk.abc -o no.cager"), &["walk.abc", "export it again"]);
}

#[test]
fn one_frame_becomes_one_mesh_file() {
    let dir = Dir::with_case(CASE);
    let rest = read_model(&dir.path("rest.obj")).expect("the rest pose");
    dir.cager("decode walk.cager -o all.npy").succeeds();
    let wanted = &read_frames(&dir.path("all.npy"), rest.points.len())[2];
    for name in ["pose.obj", "pose.ply", "pose.off"] {
        dir.cager(&format!("decode walk.cager --frame 2 -o {name}")).succeeds();
        let pose = read_model(&dir.path(name)).expect(name);
        let single = |values: &[f64]| values.iter().map(|&x| x as f32).collect::<Vec<_>>();
        assert_eq!(single(pose.points.as_flattened()), single(wanted), "{name}");
        assert_eq!(pose.faces.len(), rest.faces.len(), "{name}");
    }
    dir.cager("decode walk.cager --range 2-2 -o pose.stl").succeeds();
    let pose = read_model(&dir.path("pose.stl")).expect("a mesh");
    assert_eq!((pose.points.len(), pose.faces.len()), (rest.points.len(), rest.faces.triangulated().len()));
    dir.cager("decode walk.cager --frame 2 --cages -o cage2.obj").succeeds();
    assert_eq!(
        read_model(&dir.path("cage2.obj")).expect("a cage").faces,
        read_model(&dir.path("cage2.cage.obj")).expect("the rest cage").faces
    );
    dir.cager("decode walk.cager --frame 2 --model rest.obj -o moved.obj").succeeds();
    refused(&dir, "decode walk.cager --frame 2 -o pose.obj", &["pose.obj", "is there already", "--overwrite"]);
    dir.cager("decode walk.cager --frame 1 -o pose.obj --overwrite").succeeds();
}

#[test]
fn several_frames_in_one_mesh_file_are_refused_with_a_folder_for_them() {
    let dir = Dir::with_case(CASE);
    for line in [
        "decode walk.cager -o pose.obj",
        "decode walk.cager --cages -o pose.obj",
        "decode walk.cager --range 0-1 -o pose.obj",
    ] {
        refused(&dir, line, &["pose.obj", "holds one mesh", "--frame K", "pose/", "'pose/*.obj'"]);
    }
}

#[test]
fn frames_are_counted_from_0_and_not_from_the_end() {
    let dir = Dir::with_case(CASE);
    refused(
        &dir,
        "decode walk.cager --frame -1 -o pose.npy",
        &["walk.cager", "--frame -1", "counted from 0", "give that number"],
    );
    for line in [
        "decode walk.cager --range -3--1 -o pose.npy",
        "encode --rest rest.obj --cage cage.obj --frames frames.npy --frames-range -2--1 -o out.cager",
    ] {
        let done = dir.cager(line).run();
        assert_eq!(done.status, Some(2), "{line}");
        assert!(done.stderr.contains("write it as A-B or A-BxSTEP"), "{line}: {}", done.stderr);
    }
}
