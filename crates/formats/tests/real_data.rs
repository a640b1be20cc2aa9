//! Real captures, where they are at hand: `CAGER_CAPTURES` or `shared/data` beside the repository.

use std::fs;
use std::path::{Path, PathBuf};

use cager_formats::{FrameOptions, create_frames, open_frames, read_model, write_model};

fn data() -> PathBuf {
    std::env::var_os("CAGER_CAPTURES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from)
}

fn obj_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            obj_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "obj") {
            found.push(path);
        }
    }
}

#[test]
#[ignore = "needs the captures: make captures"]
fn every_capture_is_read_to_its_last_frame() {
    let data = data();
    let captures = [
        ("horse-gallop", 8431, 48),
        ("samba", 9971, 175),
        ("chickenCrossing", 3030, 400),
        ("makehuman-cmu-walk", 10692, 73),
        ("supercages-arm", 2089, 121),
    ];
    for (name, points, frames) in captures {
        let rest = read_model(&data.join(name).join("rest.obj")).unwrap();
        assert_eq!(rest.points.len(), points, "{name}");
        let mut reader = open_frames(data.join(name).join("frames.npy"), points).unwrap();
        assert_eq!(reader.frames(), frames, "{name}");
        let mut frame = Vec::new();
        for _ in 0..frames {
            assert!(reader.read_next(&mut frame).unwrap());
            assert_eq!(frame.len(), 3 * points);
        }
        assert!(!reader.read_next(&mut frame).unwrap());
    }
}

#[test]
#[ignore = "needs the captures: make captures"]
fn every_mesh_keeps_its_counts_and_survives_every_format() {
    let data = data();
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    obj_files(&data, &mut files);
    assert!(!files.is_empty());
    for path in files {
        let model = read_model(&path).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let count = |key: &str| text.lines().filter(|line| line.starts_with(key)).count();
        assert_eq!((model.points.len(), model.faces.len()), (count("v "), count("f ")), "{}", path.display());
        for name in ["a.obj", "a.ply", "a.off"] {
            let copy = folder.path().join(name);
            write_model(&copy, &model).unwrap();
            assert!(read_model(&copy).unwrap() == model, "{} as {name}", path.display());
        }
    }
}

#[test]
#[ignore = "needs the captures: make captures"]
fn captures_survive_every_format_of_frames() {
    let data = data();
    let folder = tempfile::tempdir().unwrap();
    let rest = read_model(&data.join("supercages-arm/rest.obj")).unwrap();
    let source = data.join("supercages-arm/frames.npy");
    let points = rest.points.len();
    let (mut frame, mut copied) = (Vec::new(), Vec::new());
    for name in ["a.npy", "a.pc2", "a.mdd", "frames"] {
        let path = folder.path().join(name);
        let mut reader = open_frames(&source, points).unwrap();
        let mut writer = create_frames(&path, points, reader.frames(), &rest.faces, &FrameOptions::default()).unwrap();
        while reader.read_next(&mut frame).unwrap() {
            writer.write_frame(&frame.iter().map(|&x| x as f32).collect::<Vec<_>>()).unwrap();
        }
        writer.finish().unwrap();
        let (mut reader, mut copy) = (open_frames(&source, points).unwrap(), open_frames(&path, points).unwrap());
        assert_eq!(copy.frames(), reader.frames());
        while reader.read_next(&mut frame).unwrap() {
            assert!(copy.read_next(&mut copied).unwrap());
            assert!(copied.iter().zip(&frame).all(|(a, b)| *a as f32 == *b as f32), "{name}");
        }
    }
}
