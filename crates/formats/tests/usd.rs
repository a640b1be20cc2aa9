//! What users rely on when files of USD are read and written.

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use cager_formats::{
    CacheFormat, CageMesh, Error, FrameOptions, FrameReader, FrameSelection, MeshFormat, ReadModel, Units, Up,
    create_frames, open_frames, open_frames_bytes, open_selected_frames, read_mesh, read_model, read_model_bytes,
};
use cager_geometry::mesh::Polygons;
use support::{all, data, message, numbers, polygons, wide};
use tempfile::{TempDir, tempdir};

const CENTIMETRES: Units = Units::new(Up::Z, 0.01);

fn open(bytes: &[u8], points: usize) -> Result<Box<dyn FrameReader + '_>, Error> {
    open_frames_bytes(CacheFormat::Usd, Path::new("a.usd"), bytes, points)
}

/// So many frames of four points.
fn moving(frames: u16) -> Vec<Vec<f32>> {
    (0..frames).map(|k| (0..12).map(|i| (f32::from(k) + 0.1) * i as f32).collect()).collect()
}

fn faces() -> Polygons {
    polygons(&[&[0, 1, 2], &[3, 2, 1, 0], &[0, 1, 2, 3, 1], &[0, 1, 2], &[1, 2, 3], &[2, 3, 0]])
}

/// Writes frames and gives the file.
fn written(name: &str, frames: &[Vec<f32>], faces: &Polygons, options: &FrameOptions) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join(name);
    let mut writer = create_frames(&path, frames[0].len() / 3, frames.len(), faces, options).unwrap();
    frames.iter().for_each(|frame| writer.write_frame(frame).unwrap());
    writer.finish().unwrap();
    (folder, path)
}

#[test]
fn files_come_back_as_they_were_written() {
    let frames = moving(300);
    let units = CENTIMETRES;
    for (name, fps, first, step) in
        [("my walk.usdc", 24.0, 0.0, 1.0), ("1.usdz", 25.0, 1001.0, 1.0), ("a.usd", 30000.0 / 1001.0, -3.0, 0.5)]
    {
        let told: Vec<f64> = (0..300).map(|k| first + step * f64::from(k)).collect();
        let options = FrameOptions { fps, numbers: told.clone(), units, ..FrameOptions::default() };
        let (_folder, path) = written(name, &frames, &faces(), &options);
        let mut reader = open_frames(&path, 4).unwrap();
        assert_eq!((reader.frames(), reader.frame_rate(), reader.units()), (300, Some(fps), units));
        assert_eq!(numbers(&*reader), told);
        assert_eq!(reader.notes(), Vec::<String>::new());
        assert!(!reader.numbers_are_times());
        assert_eq!(all(&mut *reader), wide(&frames));
        assert_eq!(reader.mesh().unwrap(), (path.as_path(), &faces()));
        let ReadModel { model, units: found, .. } = read_mesh(&path, &[]).unwrap();
        assert_eq!((model.points.as_flattened(), model.faces), (&wide(&frames)[0][..], faces()));
        assert_eq!(found, units);
    }
}

#[test]
fn what_lies_far_away_keeps_its_place_exactly() {
    let origin = [1e7 + 0.125, -3.5e6, 1.0 / 3.0];
    let options = FrameOptions { origin: Some(origin), ..FrameOptions::default() };
    let frames = vec![vec![0.1, 0.2, 0.3, -1e-6, 5.0, 7.0]];
    let (_folder, path) = written("a.usdc", &frames, &Polygons::new(), &options);
    let expected: Vec<f64> = wide(&frames)[0].iter().zip(origin.iter().cycle()).map(|(x, o)| x + o).collect();
    let mut reader = open_frames(&path, 2).unwrap();
    assert_eq!(reader.units(), Units::METRES);
    assert_eq!(all(&mut *reader), [expected]);
}

#[test]
fn frames_at_uneven_times_keep_their_numbers() {
    let told = vec![1.0, 2.5, 5.25, 9.0];
    let options = FrameOptions { fps: 25.0, numbers: told.clone(), ..FrameOptions::default() };
    let (_folder, path) = written("a.usdc", &moving(4), &Polygons::new(), &options);
    let reader = open_frames(&path, 4).unwrap();
    assert_eq!((numbers(&*reader), reader.frame_rate(), reader.numbers_are_times()), (told, Some(25.0), true));
    assert!(reader.notes()[0].contains("its times are not evenly spaced"));
}

#[test]
fn frames_between_samples_are_interpolated() {
    let options = FrameOptions { numbers: vec![1.0, 2.0, 4.0], ..FrameOptions::default() };
    let (_folder, path) = written("a.usdc", &moving(3), &Polygons::new(), &options);
    let mut reader = open_frames(&path, 4).unwrap();
    assert_eq!(numbers(&*reader), [1.0, 2.0, 3.0, 4.0]);
    assert!(reader.notes()[0].contains("it stores 3 of its 4 frames; those between are interpolated"));
    let (read, stored) = (all(&mut *reader), wide(&moving(3)));
    let between: Vec<f64> = stored[1].iter().zip(&stored[2]).map(|(a, b)| a + 0.5 * (b - a)).collect();
    assert_eq!(read, [stored[0].clone(), stored[1].clone(), between, stored[2].clone()]);
}

/// A cage of one triangle.
fn cage() -> CageMesh {
    CageMesh { points: 3, faces: polygons(&[&[0, 1, 2]]) }
}

/// The triangle in so many frames.
fn cage_frames(frames: u16) -> Vec<Vec<f32>> {
    (0..frames).map(|k| [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(|x| x + f32::from(k)).to_vec()).collect()
}

fn with_cage(name: &str, frames: u16, origin: Option<[f64; 3]>) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join(name);
    let options = FrameOptions { cage: Some(cage()), origin, ..FrameOptions::default() };
    let mut writer = create_frames(&path, 4, frames.into(), &faces(), &options).unwrap();
    for (frame, cage) in moving(frames).iter().zip(&cage_frames(frames)) {
        writer.write_frame(frame).unwrap();
        writer.write_cage(cage).unwrap();
    }
    writer.finish().unwrap();
    (folder, path)
}

#[test]
fn a_cage_is_kept_beside_the_mesh_and_read_where_it_is_asked_for() {
    for name in ["a.usdc", "a.usdz"] {
        let (_folder, path) = with_cage(name, 5, None);
        let mut reader = open_frames(&path, 4).unwrap();
        assert_eq!(reader.mesh().unwrap().1, &faces());
        assert_eq!(all(&mut *reader), wide(&moving(5)));
        let selection = FrameSelection { prims: vec!["cage".to_owned()], ..FrameSelection::default() };
        let mut reader = open_selected_frames(&path, 3, &selection).unwrap();
        assert_eq!(reader.mesh().unwrap().1, &cage().faces);
        assert_eq!(all(&mut *reader), wide(&cage_frames(5)));
        assert_eq!(read_model(&path).unwrap().faces, faces());
    }
}

#[test]
fn cages_that_are_missing_or_cannot_be_written_are_refused() {
    let folder = tempdir().unwrap();
    let options = FrameOptions { cage: Some(cage()), ..FrameOptions::default() };
    let path = folder.path().join("a.usdc");
    let mut writer = create_frames(&path, 4, 2, &faces(), &options).unwrap();
    moving(2).iter().for_each(|frame| writer.write_frame(frame).unwrap());
    assert!(message(writer.write_cage(&[0.0; 6])).contains("frame 0 has 2 points where 3 are expected"));
    writer.write_cage(&[0.0; 9]).unwrap();
    assert!(message(writer.finish()).contains("was announced with 2 frames but given 1"));
    assert!(!path.exists());
    let mut without = create_frames(&path, 4, 2, &faces(), &FrameOptions::default()).unwrap();
    assert!(message(without.write_cage(&[0.0; 9])).contains("has no cage that was announced"));
    for name in ["a.abc", "a.glb", "a.npy", "a.obj", "folder/"] {
        let error = message(create_frames(folder.path().join(name), 4, 1, &faces(), &options));
        assert!(error.contains("is not written with a cage; write .usdc or .usdz"), "{error}");
    }
    let wrong = FrameOptions { cage: Some(CageMesh { points: 2, ..cage() }), ..FrameOptions::default() };
    assert!(message(create_frames(&path, 4, 1, &faces(), &wrong)).contains("face 0 of the cage"));
}

/// Reads all that there is; gives whether it was good.
fn try_all(name: &str, bytes: &[u8]) -> bool {
    let path = Path::new(name);
    let model = read_model_bytes(MeshFormat::from_path(path).unwrap(), path, bytes);
    let opened = open_frames_bytes(CacheFormat::from_path(path).unwrap(), path, bytes, 4);
    let told = [model.as_ref().err(), opened.as_ref().err()].into_iter().flatten().map(ToString::to_string);
    assert!(told.into_iter().all(|text| text.starts_with(&format!("{name}: ")) && text.len() < 600));
    let Ok(mut reader) = opened else { return false };
    let mut frame = Vec::new();
    for _ in 0..reader.frames().min(64) {
        match reader.read_next(&mut frame) {
            Ok(more) => assert!(more && frame.len() == 12 && frame.iter().all(|x| x.is_finite())),
            Err(error) => {
                assert!(error.to_string().starts_with(&format!("{name}: ")), "{error}");
                return false;
            }
        }
    }
    true
}

#[test]
fn files_that_end_early_or_are_changed_are_errors_at_the_most() {
    for name in ["a.usdc", "a.usdz"] {
        let far = FrameOptions { origin: Some([1e6, 0.0, 0.0]), ..FrameOptions::default() };
        let (_folder, path) = written(name, &moving(3), &faces(), &far);
        let whole = fs::read(path).unwrap();
        assert!(try_all(name, &whole));
        assert!((0..64).all(|k| !try_all(name, &whole[..whole.len() * k / 64])));
        let mut random = support::random(1);
        let mut good = 0;
        for _ in 0..500 {
            let mut bytes = whole.clone();
            for _ in 0..=random() % 4 {
                let at = random() % bytes.len();
                bytes[at] = [0, 0xff, 0x7f, random() as u8][random() % 4];
            }
            good += usize::from(try_all(name, &bytes));
        }
        assert!(good < 500);
    }
}

#[test]
fn what_is_no_layer_says_what_it_is() {
    let of = |bytes: &[u8]| message(open(bytes, 4));
    assert!(of(&support::npy_f4()).contains("is not a .usd file but a file of the kind .npy"));
    assert!(of(b"#usda 1.0\n").contains("holds no polygon mesh"));
    assert!(of(b"PXR-USDC\0\x03\0").contains("is of version 0.3.0 of USD's binary format, where 0.4.0 to 0.13.0 are"));
    assert!(of(b"what").contains("does not begin as a file of USD does"));
}

/// Both kinds of layers.
const KINDS: [&str; 2] = ["usdc", "usda"];

/// Files of OpenUSD, written by `tests/peers/usd.py make`.
fn made(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/usd").join(name)
}

fn take(name: &str, kind: &str, prim: Option<&str>) -> Result<Box<dyn FrameReader>, Error> {
    let selection =
        FrameSelection { prims: prim.map(str::to_owned).into_iter().collect(), ..FrameSelection::default() };
    open_selected_frames(made(name).with_extension(kind), 3, &selection)
}

/// What the library says that a file holds.
fn told(name: &str) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(made(name).with_extension("txt")).unwrap();
    text.lines().map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect()
}

#[test]
fn transforms_above_a_mesh_move_it_as_the_library_does() {
    let all_kinds = |name, largest| KINDS.map(|kind| (name, kind, largest));
    for (name, kind, largest) in [("operations", 1e-5), ("reset", 0.0), ("doubles", 0.0), ("single", 0.0)]
        .into_iter()
        .flat_map(|(name, largest)| all_kinds(name, largest))
    {
        let (read, told) = (all(&mut *take(name, kind, None).unwrap()), told(name));
        assert_eq!(read.len(), told.len(), "{name}.{kind}");
        for (frame, (read, told)) in read.iter().zip(&told).enumerate() {
            let off = read.iter().zip(told).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off <= largest, "{name}.{kind}: frame {frame} is off by {off}");
        }
    }
    for kind in KINDS {
        let reader = take("reset", kind, None).unwrap();
        assert_eq!((reader.frame_rate(), numbers(&*reader)), (Some(25.0), vec![1.0, 2.0, 3.0, 4.0]));
    }
}

#[test]
fn faces_are_wound_counterclockwise() {
    for kind in KINDS {
        assert_eq!(take("left", kind, None).unwrap().mesh().unwrap().1, &polygons(&[&[2, 1, 0]]));
        // One of its transforms mirrors.
        assert_eq!(take("operations", kind, None).unwrap().mesh().unwrap().1, &polygons(&[&[2, 1, 0]]));
    }
}

#[test]
fn topology_that_changes_names_the_frame() {
    for kind in KINDS {
        let (mut reader, mut frame) = (take("faces", kind, None).unwrap(), Vec::new());
        assert!(reader.read_next(&mut frame).unwrap() && reader.read_next(&mut frame).unwrap());
        let error = message(reader.read_next(&mut frame));
        assert!(error.contains("frame 2: its topology changes: its faces are not those of frame 0; "), "{error}");
    }
}

#[test]
fn one_of_several_meshes_is_chosen_by_path_or_name() {
    for kind in KINDS {
        let error = message(take("several", kind, None));
        for path in
            ["holds 3 meshes", "/coat/body (3 points)", "/skin/body (3 points)", "/hat (3 points)", "with --prim"]
        {
            assert!(error.contains(path), "{error}");
        }
        for prim in ["/skin/body", "skin/body/", "skin"] {
            assert_eq!(all(&mut *take("several", kind, Some(prim)).unwrap())[0], told("several")[0]);
        }
        assert!(message(take("several", kind, Some("body"))).contains("holds 2 meshes, "));
        assert!(message(take("several", kind, Some("gone"))).contains("holds no mesh gone, but "));
    }
}

#[test]
fn what_a_layer_is_composed_of_is_named() {
    for (name, what) in [
        ("references", "/group has references"),
        ("payloads", "/group has payloads"),
        ("inherited", "/group has inherited prims"),
        ("sublayers", "the layer has sublayers"),
    ] {
        for kind in KINDS {
            // As uploads have no files beside them.
            let bytes = fs::read(made(name).with_extension(kind)).unwrap();
            let error = message(open_frames_bytes(CacheFormat::Usd, Path::new("a.usd"), &bytes, 3));
            let cure =
                ", which are not read; write all into one file in Python (pip install usd-core): from pxr import Usd";
            assert!(error.contains(&format!("{what}{cure}")) && error.contains("SetInstanceable(False)"), "{error}");
        }
    }
}

/// `make usd` installs it.
#[test]
fn the_library_of_usd_reads_what_is_written() {
    let Ok(python) = std::env::var("CAGER_USD_PYTHON") else {
        eprintln!("skipped: CAGER_USD_PYTHON is not set; `make usd` installs the library and runs this test");
        return;
    };
    let uneven = FrameOptions { fps: 25.0, numbers: vec![1.0, 2.0, 5.0, 9.0], ..FrameOptions::default() };
    let far = FrameOptions { origin: Some([1e7 + 0.125, -3.5e6, 1.0 / 3.0]), ..FrameOptions::default() };
    let units = FrameOptions { units: CENTIMETRES, ..FrameOptions::default() };
    for (name, options, count) in [("my walk.usdc", units, 300), ("a.usdz", uneven, 4), ("7.usd", far, 1)] {
        let (_folder, path) = written(name, &moving(count), &faces(), &options);
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/usd.py");
        let done = Command::new(&python).arg(script).arg("read").arg(&path).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = String::from_utf8(done.stdout).unwrap();
        let mut lines = text.lines();
        let head = match name {
            "my walk.usdc" => "Z 0.01 24.0 0.0 299.0 /my_walk/mesh /my_walk none",
            "a.usdz" => "Y 1.0 25.0 1.0 9.0 /a/mesh /a none",
            _ => "Y 1.0 24.0 0.0 0.0 /mesh_7/mesh /mesh_7 none",
        };
        assert_eq!(lines.next(), Some(head));
        assert_eq!(lines.next(), Some("3 4 5 3 3 3"));
        assert_eq!(lines.next(), Some("0 1 2 3 2 1 0 0 1 2 3 1 0 1 2 1 2 3 2 3 0"));
        let own = all(&mut *open_frames(&path, 4).unwrap());
        assert_eq!(lines.clone().count(), usize::from(count));
        for (frame, line) in lines.enumerate() {
            let values: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
            assert_eq!(values[0], options.numbers.get(frame).copied().unwrap_or(frame as f64));
            if name == "my walk.usdc" || frame == 0 {
                assert_eq!(values[1..], own[frame], "{name}: frame {frame}");
            }
        }
    }
}

/// `make usd` installs it.
#[test]
fn the_library_of_usd_reads_cages_as_guides() {
    let Ok(python) = std::env::var("CAGER_USD_PYTHON") else {
        eprintln!("skipped: CAGER_USD_PYTHON is not set; `make usd` installs the library and runs this test");
        return;
    };
    for (name, origin) in [("a.usdc", None), ("a.usdz", Some([10.0, 0.0, 0.0]))] {
        let (_folder, path) = with_cage(name, 3, origin);
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/usd.py");
        let done = Command::new(&python).arg(script).arg("cages").arg(&path).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = String::from_utf8(done.stdout).unwrap();
        let mut lines = text.lines();
        for (kind, frames) in [("/a/mesh default 4", moving(3)), ("/a/cage guide 3", cage_frames(3))] {
            assert_eq!(lines.next(), Some(kind));
            for frame in wide(&frames) {
                let moved: Vec<f64> =
                    frame.iter().zip(origin.unwrap_or_default().iter().cycle()).map(|(x, o)| x + o).collect();
                let read: Vec<f64> = lines.next().unwrap().split(' ').map(|word| word.parse().unwrap()).collect();
                assert_eq!(read, moved);
            }
        }
        assert_eq!(lines.next(), None);
    }
}

/// Files of usd-core; their points are those of the arrays, turned so that z is up. The rest pose
/// is the first frame, whatever stands there by default.
#[test]
#[ignore = "needs the captures: make captures"]
fn files_of_the_library_read_back_to_their_truth() {
    let data = data();
    for (name, capture, every, count) in [("arm", "supercages-arm", 10, 13), ("horse", "horse-gallop", 1, 12)] {
        let path = data.join("studio").join(name).with_extension("usdc");
        let ReadModel { model: rest, units, .. } = read_mesh(&path, &[]).unwrap();
        let turned = |points: &[f64]| {
            points
                .as_chunks()
                .0
                .iter()
                .flat_map(|&[x, y, z]| [x, -z, y].map(|x| f64::from(x as f32)))
                .collect::<Vec<_>>()
        };
        let own = read_model(&data.join(capture).join("rest.obj")).unwrap();
        let mut reader = open_frames(&path, own.points.len()).unwrap();
        let truth = all(&mut *open_frames(data.join(capture).join("frames.npy"), own.points.len()).unwrap());
        assert_eq!((reader.frame_rate(), reader.number(0)), (Some(24.0), 1.0));
        assert_eq!((reader.units(), units), (CENTIMETRES, CENTIMETRES));
        let read = all(&mut *reader);
        assert_eq!((read.len(), rest.points.as_flattened(), &rest.faces), (count, &read[0][..], &own.faces));
        assert!(read.iter().enumerate().all(|(k, frame)| *frame == turned(&truth[every * k])), "{name}");
    }
}
