//! The examples run as a newcomer runs them: a folder of frames in, a frame out, and frames from
//! memory.

use cager_capture::{Animation, read_model, write_model};
use cager_demo::{Capture, Options};
use cager_formats::{FrameOptions, ScratchDir, create_frames};
use std::path::Path;
use std::process::Command;

/// Runs an example; what it writes to standard error.
fn run(name: &str, args: &[&Path], frame: Option<&str>) -> String {
    let test = std::env::current_exe().expect("a path");
    let program = test.parent().and_then(Path::parent).expect("a folder").join("examples").join(name);
    let (last, first) = args.split_last().expect("arguments");
    let found = Command::new(&program).args(first).args(frame).arg(last).output().expect("the example is built");
    let told = String::from_utf8_lossy(&found.stderr).into_owned();
    assert!(found.status.success(), "{}: {told}", program.display());
    told
}

#[test]
fn examples_encode_a_folder_decode_a_frame_and_encode_frames_from_memory() {
    let demo = Capture::new(&Options { points: 400, frames: 8, cage_vertices: 42 });
    let folder = ScratchDir::create(std::env::temp_dir()).expect("a folder");
    let at = |name: &str| folder.path().join(name);
    write_model(&at("rest.obj"), &demo.rest).expect("a rest pose");
    write_model(&at("cage.obj"), &demo.cage.clone().into()).expect("a cage");
    let (points, faces) = (demo.rest.points.len(), &demo.rest.faces);
    let mut writer = create_frames(at("frames/*.ply"), points, 8, faces, &FrameOptions::default()).expect("a folder");
    let (mut wide, mut last) = (Vec::new(), Vec::new());
    for frame in 0..8 {
        demo.frame(frame, &mut wide);
        last = wide.iter().map(|&x| x as f32).collect();
        writer.write_frame(&last).expect("a frame");
    }
    writer.finish().expect("frames");

    let told = run("encode_folder", &[&at("rest.obj"), &at("cage.obj"), &at("frames"), &at("walk.cager")], None);
    assert!(told.starts_with("8 frames, "), "{told}");
    run("decode_frame", &[&at("walk.cager"), &at("frame.obj")], Some("7"));
    let decoded = read_model(&at("frame.obj")).expect("a frame");
    let farthest = decoded.points.as_flattened().iter().zip(&last).map(|(a, b)| (a - f64::from(*b)).abs());
    let diagonal = cager_geometry::mesh::diagonal(&demo.rest.points);
    assert!(farthest.fold(0.0, f64::max) <= 1.01e-3 * diagonal);
    // Faces may begin at another corner.
    assert_eq!(decoded.faces.arities().len(), demo.rest.faces.arities().len());

    let told = run("encode_live", &[&at("rest.obj"), &at("cage.obj"), &at("live.cager")], None);
    assert!(told.ends_with("24 frames\n"), "{told}");
    assert_eq!(Animation::open(at("live.cager")).expect("a container").frames(), 24);
}
