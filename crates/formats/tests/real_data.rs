//! Real captures, where they are at hand: `CAGER_CAPTURES` or `shared/data` beside the repository.

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use cager_formats::{
    CacheFormat, FrameOptions, MorphOptions, create_frames, open_frames, open_frames_bytes, read_model, write_model,
};
use cager_geometry::mesh::{Model, Polygons};
use support::data;

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
fn a_character_of_gltf_has_its_parts_and_the_points_it_was_made_of() {
    let folder = data().join("character");
    // Each with its points, and faces of three corners.
    let wanted = [
        ("body", 436, 868),
        ("buckle", 72, 144),
        ("eye.L", 42, 80),
        ("eye.R", 42, 80),
        ("hair", 160, 128),
        ("jacket", 267, 440),
        ("lantern", 36, 60),
        ("teeth", 128, 192),
    ];
    let of = |name: &str| {
        let path = folder.join(name);
        let model = read_model(&path).unwrap();
        model.surface.check(model.points.len(), &model.faces).unwrap();
        let mut frames = open_frames(&path, model.points.len()).unwrap();
        let (mut frame, mut last) = (Vec::new(), Vec::new());
        while frames.read_next(&mut frame).unwrap() {
            last.clone_from(&frame);
        }
        assert_eq!((frames.frames(), last.len()), (24, 3 * model.points.len()));
        let parts = model.surface.parts.iter();
        let mut parts: Vec<_> =
            parts.map(|part| (part.path.rsplit('/').next().unwrap().to_owned(), part.points, part.faces)).collect();
        parts.sort();
        parts
    };
    let parts = of("robin.glb");
    assert!(parts.iter().map(|(name, points, faces)| (name.as_str(), *points, *faces)).eq(wanted));
    // Each material of a mesh is quantised apart, so that its points are not quite where the others' are.
    let packed = of("robin_draco.glb");
    for ((name, points, faces), (wanted, fewest, all)) in packed.into_iter().zip(wanted) {
        assert!(name == wanted && faces == all && (fewest..fewest + 33).contains(&points), "{name}: {points}");
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
            let read = read_model(&copy).unwrap();
            let bare = |model: &Model| Model { surface: Default::default(), ..model.clone() };
            assert!(bare(&read) == bare(&model), "{} as {name}", path.display());
            let on_faces = |model: &Model| {
                let parts = model.surface.parts.iter();
                parts.map(|part| (part.path.clone(), part.uv_sets.clone(), part.materials.clone())).collect::<Vec<_>>()
            };
            assert!(name != "a.obj" || on_faces(&read) == on_faces(&model), "{} as {name}", path.display());
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
    for name in ["a.npy", "a.pc2", "a.mdd", "a.abc", "frames"] {
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

/// Archives that Blender wrote, frame k of which is frame `step` × k of a capture.
const ARCHIVES: [(&str, &str, usize, usize); 2] = [("arm", "supercages-arm", 13, 10), ("horse", "horse-gallop", 12, 1)];

#[test]
#[ignore = "needs the captures: make captures"]
fn archives_of_blender_hold_what_they_were_made_from() {
    let data = data();
    for ((name, capture, frames, step), kind) in
        ARCHIVES.iter().flat_map(|&archive| [(archive, "abc"), (archive, "glb")])
    {
        let rest = read_model(&data.join(capture).join("rest.obj")).unwrap();
        let path = data.join("studio").join(format!("{name}.{kind}"));
        let mut truth = open_frames(data.join(capture).join("frames.npy"), rest.points.len()).unwrap();
        let mut reader = open_frames(&path, rest.points.len()).unwrap();
        assert_eq!((reader.frames(), reader.frame_rate(), reader.number(0)), (frames, Some(24.0), 1.0), "{name}");
        let extent = cager_geometry::mesh::diagonal(&rest.points);
        let (mut frame, mut expected) = (Vec::new(), Vec::new());
        for k in 0..frames {
            assert!(reader.read_next(&mut frame).unwrap() && truth.read_next(&mut expected).unwrap());
            let far = frame.iter().zip(&expected).fold(0.0, |far: f64, (a, b)| far.max((a - b).abs()));
            assert!(far <= 4e-8 * extent, "{name}: frame {k} is off by {far}");
            for _ in 1..step {
                truth.skip().unwrap();
            }
        }
        assert!(!reader.read_next(&mut frame).unwrap());
        let model = read_model(&path).unwrap();
        // glTF may begin a triangle with another corner.
        let sorted = |faces: &Polygons| -> Vec<Vec<u32>> {
            let turned = |face: &[u32]| {
                let first = (0..face.len()).min_by_key(|&k| face[k]).unwrap_or(0);
                [&face[first..], &face[..first]].concat()
            };
            faces.iter().map(turned).collect()
        };
        assert_eq!(sorted(&model.faces), sorted(&rest.faces), "{name}.{kind}");
    }
}

#[test]
#[ignore = "needs the captures: make captures"]
fn morph_targets_of_captures_lose_what_is_told() {
    let data = data();
    for (capture, targets, most) in [("samba", 64, 0.0085), ("supercages-arm", 64, 1e-3)] {
        let rest = read_model(&data.join(capture).join("rest.obj")).unwrap();
        let diagonal = cager_geometry::mesh::diagonal(&rest.points);
        let mut source = open_frames(data.join(capture).join("frames.npy"), rest.points.len()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let morphs = MorphOptions { targets: Some(targets), diagonal: Some(diagonal), ..MorphOptions::default() };
        let options = FrameOptions { morphs, ..FrameOptions::default() };
        let mut writer = create_frames(&path, rest.points.len(), source.frames(), &rest.faces, &options).unwrap();
        let (mut frame, mut all) = (Vec::new(), Vec::new());
        while source.read_next(&mut frame).unwrap() {
            writer.write_frame(&frame.iter().map(|&x| x as f32).collect::<Vec<_>>()).unwrap();
            all.push(frame.clone());
        }
        let notes = writer.notes();
        writer.finish().unwrap();
        let (mut reader, mut far) = (open_frames(&path, rest.points.len()).unwrap(), 0.0_f64);
        for wanted in &all {
            assert!(reader.read_next(&mut frame).unwrap());
            let (found, wanted): (&[[f64; 3]], &[[f64; 3]]) = (frame.as_chunks().0, wanted.as_chunks().0);
            let apart = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
            far = found.iter().zip(wanted).map(apart).fold(far, f64::max);
        }
        assert!(far / diagonal < most, "{capture}: {}", far / diagonal);
        assert!(
            notes[0].contains(&format!("are {:.1e} of the diagonal", far / diagonal)),
            "{notes:?} but {}",
            far / diagonal
        );
    }
}

#[test]
#[ignore = "needs the captures: make captures"]
fn damaged_archives_of_blender_are_answered() {
    let bytes = fs::read(data().join("studio/arm.abc")).unwrap();
    let mut next = support::random(1);
    let mut random = |below: usize| next() % below;
    let mut answered = [0, 0];
    for _ in 0..500 {
        let mut bytes = bytes.clone();
        for _ in 0..=random(8) {
            // Half of the damage in the tables, which lie at the end.
            let from = if random(2) == 0 { bytes.len() - 4096 } else { 0 };
            let at = from + random(bytes.len() - from);
            bytes[at] = random(256) as u8;
        }
        let opened = open_frames_bytes(CacheFormat::Abc, Path::new("a.abc"), &bytes, 2089);
        let mut frame = Vec::new();
        let read = opened.and_then(|mut reader| {
            while reader.read_next(&mut frame)? {}
            Ok(())
        });
        if let Err(error) = &read {
            assert!(error.to_string().starts_with("a.abc: ") && error.to_string().len() < 500, "{error}");
        }
        answered[usize::from(read.is_err())] += 1;
    }
    assert!(answered[0] > 50 && answered[1] > 50, "{answered:?}");
}
