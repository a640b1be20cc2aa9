//! Case 32: rest pose and capture of different handedness.

use super::belonging::refused_unless_forced;
use crate::refused::assert_sentence;
use crate::support::{Dir, Small, npy_f64, read_frames};

const CASE: &str = "32-mirrored-capture";

#[test]
fn a_mirrored_capture_is_refused_with_what_mirrors_it_and_what_to_do() {
    let dir = Dir::with_case(CASE);
    let frames = read_frames(&dir.path("same_hand.npy"), 82);
    type Change = fn([f64; 3]) -> [f64; 3];
    let changes: [(Change, &str, &str); 5] = [
        (|[x, y, z]| [-x, y, z], "x of the rest pose is -x in all of them", "negate x in one of them"),
        (|[x, y, z]| [x, -y, z], "y of the rest pose is -y in all of them", "negate y in one of them"),
        (|[x, y, z]| [x, y, -z], "z of the rest pose is -z in all of them", "negate z in one of them"),
        (
            |[x, y, z]| [z, y, x],
            "x and z of the rest pose are z and x in all of them",
            "exchange x and z in one of them",
        ),
        (
            |[x, y, z]| [x, z, y],
            "y and z of the rest pose are z and y in all of them",
            "exchange y and z in one of them",
        ),
    ];
    for (change, what, advice) in changes {
        let changed: Vec<Vec<f64>> =
            frames.iter().map(|frame| frame.as_chunks().0.iter().flat_map(|&p| change(p)).collect()).collect();
        dir.write("changed.npy", npy_f64(&changed));
        let line = "encode --rest rest.obj --frames changed.npy -o a.cager --max-error 0.0005 --overwrite";
        refused_unless_forced(&dir, line, &["changed.npy", "its frames are mirrored", what]);
        assert!(dir.cager(line).run().stderr.contains(advice), "{advice}");
    }
    let other = "--rest rest.obj --frames other_hand.npy";
    for line in [
        format!("cage {other} -o cage.obj"),
        format!("encode {other} -o b.cager --dry-run"),
        "transfer --source-rest rest.obj --source-frames other_hand.npy --target rest.obj --align none -o b.cager"
            .to_owned(),
    ] {
        assert_sentence(&line, &dir.cager(&line).run().stderr, &["other_hand.npy", "its frames are mirrored"]);
    }
    let done = dir.cager("encode --rest rest.obj --frames same_hand.npy -o b.cager --max-error 0.0005").succeeds();
    assert!(!done.stderr.contains("mirrored"), "{}", done.stderr);
}

#[test]
fn the_first_frame_that_is_mirrored_is_named() {
    let dir = Dir::with_case(CASE);
    let line = "encode --rest rest.obj --frames from_frame_4.npy -o a.cager --max-error 0.0005 --overwrite";
    let words = ["from_frame_4.npy: frame 4 ", "it is mirrored (x of the rest pose is -x in it)"];
    refused_unless_forced(&dir, line, &words);
}

#[test]
fn point_clouds_and_open_meshes_are_found_mirrored_and_flat_ones_are_not_judged() {
    let (dir, small) = Dir::with_capture();
    let mirrored = |small: &Small| -> Vec<Vec<f64>> {
        let flip = |frame: &Vec<f64>| frame.as_chunks().0.iter().flat_map(|&[x, y, z]| [x, -y, z]).collect();
        small.frames.iter().map(flip).collect()
    };
    dir.frames("frames.npy", &mirrored(&small));
    let cloud = cager_geometry::mesh::Model { points: small.rest.points.clone(), ..Default::default() };
    dir.model("cloud.obj", &cloud);
    let line = "encode --rest cloud.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite";
    refused_unless_forced(&dir, line, &["frames.npy", "its frames are mirrored"]);
    // A flat grid that waves has no hand.
    let grid: Vec<[f64; 3]> = (0..400).map(|k| [f64::from(k % 20), f64::from(k / 20), 0.0]).collect();
    let faces = (0..19)
        .flat_map(|j| (0..19).map(move |i| [20 * j + i, 20 * j + i + 1, 20 * j + i + 21, 20 * j + i + 20].to_vec()));
    let flat = cager_geometry::mesh::Model {
        points: grid.clone(),
        faces: crate::support::polygons(faces),
        ..Default::default()
    };
    dir.model("flat.obj", &flat);
    let wave = |t: usize| grid.iter().flat_map(|&[x, y, _]| [x, y, (0.5 * x + t as f64).sin()]).collect::<Vec<f64>>();
    dir.frames("waves.npy", &(0..6).map(wave).collect::<Vec<_>>());
    dir.cager("encode --rest flat.obj --frames waves.npy -o waves.cager").succeeds();
}

#[test]
fn a_mirrored_pose_is_refused() {
    let (dir, small) = Dir::with_capture();
    let mut pose = small.posed(3);
    pose.points.iter_mut().for_each(|p| p[0] = -p[0]);
    dir.model("pose.obj", &pose);
    let line = "explore rest.obj pose.obj --steps 3 -o shapes.npy";
    let done = dir.cager(line).run();
    assert_eq!(done.status, Some(1), "{done:?}");
    assert_sentence(line, &done.stderr, &["pose.obj: does not look like a pose of rest.obj", "it is mirrored"]);
}
