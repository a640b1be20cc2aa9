//! Captures opened from files, as the command line opens them.

use cager_capture::{Capture, CaptureFiles, EncodeError, OpenOptions, TriMesh, Up, read_model, write_model};
use cager_demo::{Capture as Demo, Options};
use cager_formats::{FrameOptions, ScratchDir, create_frames};
use std::path::PathBuf;

/// A folder with `rest.obj`, `cage.obj`, `inward.obj` and `frames.npy`, whose points are changed by
/// `change`.
fn folder(change: impl Fn([f64; 3]) -> [f64; 3]) -> (ScratchDir, impl Fn(&str) -> PathBuf) {
    let demo = Demo::new(&Options { points: 400, frames: 8, cage_vertices: 42 });
    let folder = ScratchDir::create(std::env::temp_dir()).expect("a folder");
    let path = folder.path().to_owned();
    let at = move |name: &str| path.join(name);
    write_model(&at("rest.obj"), &demo.rest).expect("a rest pose");
    write_model(&at("cage.obj"), &demo.cage.clone().into()).expect("a cage");
    write_model(&at("inward.obj"), &demo.cage.clone().flipped().into()).expect("a cage");
    let points = demo.rest.points.len();
    let mut writer =
        create_frames(at("frames.npy"), points, 8, &demo.rest.faces, &FrameOptions::default()).expect("frames");
    let mut frame = Vec::new();
    for t in 0..8 {
        demo.frame(t, &mut frame);
        let changed = frame.as_chunks().0.iter().flat_map(|&p| change(p)).map(|x| x as f32);
        writer.write_frame(&changed.collect::<Vec<f32>>()).expect("a frame");
    }
    writer.finish().expect("frames");
    (folder, at)
}

#[test]
fn frames_of_other_axes_are_refused_unless_they_are_turned_or_allowed() {
    let (_folder, at) = folder(|[x, y, z]| [x, z, -y]);
    let open = |options: OpenOptions| options.open(at("rest.obj"), at("cage.obj"), at("frames.npy"));
    let refused = Capture::open(at("rest.obj"), at("cage.obj"), at("frames.npy")).expect_err("other axes");
    assert!(matches!(&refused, EncodeError::Mismatch { found, .. } if found.len() == 1), "{refused}");
    let said = refused.to_string();
    assert!(said.ends_with("y is up where z is in the rest pose; export both with the same axes"), "{said}");
    let allowed = open(OpenOptions { allow_mismatch: true, ..OpenOptions::default() }).expect("a capture");
    assert!(allowed.warnings().concat().contains("does not look like a capture of"), "{:?}", allowed.warnings());
    let files = CaptureFiles { up: Some(Up::Y), ..CaptureFiles::default() };
    let turned = open(OpenOptions { files, ..OpenOptions::default() }).expect("a capture");
    assert_eq!(turned.warnings(), Vec::<String>::new());
}

#[test]
fn a_cage_that_is_inside_out_is_refused_unless_it_is_turned_around() {
    let (_folder, at) = folder(|p| p);
    let refused = Capture::open(at("rest.obj"), at("inward.obj"), at("frames.npy")).expect_err("inside out");
    assert!(matches!(refused, EncodeError::Cage { .. }), "{refused}");
    assert!(!refused.to_string().contains("--"), "{refused}");
    let options = OpenOptions { flip_cage: true, ..OpenOptions::default() };
    let capture = options.open(at("rest.obj"), at("inward.obj"), at("frames.npy")).expect("a capture");
    let cage = read_model(&at("cage.obj")).expect("a cage");
    assert_eq!(capture.cage.vertices(), cage.points);
}

#[test]
fn a_cage_that_seams_split_is_merged_and_said() {
    let (_folder, at) = folder(|p| p);
    let cage = TriMesh::from(&read_model(&at("cage.obj")).expect("a cage"));
    let vertices = cage.triangles.iter().flatten().map(|&v| cage.vertices[v as usize]).collect::<Vec<_>>();
    let triangles = (0..cage.triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    write_model(&at("split.obj"), &TriMesh { vertices, triangles }.into()).expect("a cage");
    let capture = Capture::open(at("rest.obj"), at("split.obj"), at("frames.npy")).expect("a capture");
    assert_eq!(capture.cage.vertices().len(), cage.vertices.len());
    let merged = format!("merged {} vertices", 3 * cage.triangles.len() - cage.vertices.len());
    assert!(capture.warnings()[0].contains(&merged), "{:?}", capture.warnings());
}
