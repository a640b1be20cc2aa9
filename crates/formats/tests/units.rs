//! What users rely on when files say what their coordinates mean: a mesh is as large in one program
//! as in the other, and stands as upright.

mod support;

use std::path::Path;

use cager_formats::{
    FrameOptions, MeshFormat, MorphOptions, ReadModel, Units, Up, create_frames, open_frames, read_mesh,
    read_mesh_bytes,
};
use support::polygons;
use tempfile::tempdir;

const NAMES: [&str; 5] = ["a.usdc", "a.usdz", "a.usd", "a.glb", "a.gltf"];
const SAID: [Units; 4] = [Units::METRES, Units::new(Up::Z, 0.01), Units::new(Up::Y, 0.0254), Units::new(Up::Z, 1.0)];

fn write(path: &Path, frames: &[Vec<f64>], units: Units, origin: Option<[f64; 3]>) {
    let morphs = MorphOptions { floats: true, ..MorphOptions::default() };
    let options = FrameOptions { units, origin, rounding: 1.0, morphs, ..FrameOptions::default() };
    let faces = polygons(&[&[0, 1, 2]]);
    let mut writer = create_frames(path, 3, frames.len(), &faces, &options).unwrap();
    for frame in frames {
        let singles: Vec<f32> = frame.iter().map(|&x| x as f32).collect();
        writer.write_frame(&singles).unwrap();
    }
    writer.finish().unwrap();
}

fn read(path: &Path) -> (Vec<Vec<f64>>, Units) {
    let mut reader = open_frames(path, 3).unwrap();
    let (mut frames, mut values) = (Vec::new(), Vec::new());
    while reader.read_next(&mut values).unwrap() {
        frames.push(values.clone());
    }
    let ReadModel { model, units, .. } = read_mesh(path, &[]).unwrap();
    assert_eq!(reader.units(), units, "{}", path.display());
    let [model, first]: [&[f64]; 2] = [model.points.as_flattened(), &frames[0]];
    assert!(model.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-5 * b.abs().max(1.0)));
    (frames, units)
}

/// In metres with Y up.
fn in_metres(frames: &[Vec<f64>], units: Units) -> Vec<[f64; 3]> {
    let change = units.change_to(Units::METRES);
    frames.concat().as_chunks().0.iter().map(|&point| change.apply(point)).collect()
}

#[test]
fn every_file_means_the_same_as_the_one_it_was_made_of() {
    let folder = tempdir().unwrap();
    let frames: Vec<Vec<f64>> =
        (0..3).map(|t| vec![0.0, f64::from(t), 0.0, 100.0, 0.0, 1.5, 0.0, 25.0, 50.0 + f64::from(t)]).collect();
    for (name, units) in NAMES.iter().flat_map(|name| SAID.map(|units| (name, units))) {
        let first = folder.path().join("from").join(name);
        std::fs::create_dir_all(first.parent().unwrap()).unwrap();
        write(&first, &frames, units, None);
        let (taken, said) = read(&first);
        let is_gltf = |name: &str| name.contains(".gl");
        assert_eq!(said, if is_gltf(name) { Units::METRES } else { units }, "{name}");
        for other in NAMES {
            let second = folder.path().join("to").join(other);
            std::fs::create_dir_all(second.parent().unwrap()).unwrap();
            write(&second, &taken, said, None);
            let (found, told) = read(&second);
            assert_eq!(told, if is_gltf(other) { Units::METRES } else { said }, "{name} to {other}");
            let pairs = [in_metres(&found, told), in_metres(&frames, units)];
            let farthest = pairs[0].iter().zip(&pairs[1]).flat_map(|(a, b)| (0..3).map(move |k| (a[k] - b[k]).abs()));
            let farthest = farthest.fold(0.0, f64::max);
            let size = 100.0 * units.metres_per_unit.unwrap();
            assert!(farthest <= 1e-6 * size, "{name} to {other}, {units:?}: {farthest}");
        }
    }
}

#[test]
fn what_nobody_said_is_written_as_before_and_an_origin_is_changed_with_the_rest() {
    let folder = tempdir().unwrap();
    let frames = [vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]];
    for name in NAMES {
        let path = folder.path().join(name);
        write(&path, &frames, Units::UNKNOWN, None);
        assert_eq!(read(&path), (frames.to_vec(), Units::METRES), "{name}");
    }
    let path = folder.path().join("far.glb");
    write(&path, &frames, Units::new(Up::Z, 0.01), Some([500.0, 200.0, 800.0]));
    let expected = [5.0, 8.0, -2.0, 5.01, 8.0, -2.0, 5.0, 8.0, -2.01];
    assert!(read(&path).0[0].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{:?}", read(&path));
}

#[test]
fn files_that_say_nothing_say_nothing() {
    let folder = tempdir().unwrap();
    let frames = [vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]];
    for name in ["a.abc", "a.npy", "a.pc2", "a.mdd"] {
        let path = folder.path().join(name);
        write(&path, &frames, Units::new(Up::Z, 0.01), None);
        let mut reader = open_frames(&path, 3).unwrap();
        let mut values = Vec::new();
        assert!(reader.read_next(&mut values).unwrap());
        assert_eq!((reader.units(), &values), (Units::UNKNOWN, &frames[0]), "{name}");
    }
    let text =
        b"#usda 1.0\n(upAxis = \"Z\")\ndef Mesh \"m\" { point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }\n";
    let said = |text: &[u8]| read_mesh_bytes(MeshFormat::Usda, Path::new("a.usda"), text).unwrap().units;
    assert_eq!(said(text), Units::new(Up::Z, 0.01), "a centimetre, as USD has it where only the axis is said");
    let none = text.iter().copied().skip(25).collect::<Vec<u8>>();
    assert_eq!(said(&[b"#usda 1.0\n".as_slice(), &none].concat()), Units::UNKNOWN);
    let absurd = b"#usda 1.0\n(metersPerUnit = 1e300)\ndef Mesh \"m\" { point3f[] points = [(0, 0, 0)] }\n";
    assert_eq!(said(absurd), Units::UNKNOWN);
}
