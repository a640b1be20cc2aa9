//! What users rely on when Alembic archives are read and written.

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use cager_formats::{
    CacheFormat, Error, FrameOptions, FrameReader, FrameSelection, ReadModel, create_frames, frame_files,
    mesh_sequence, open_frames, open_frames_bytes, open_selected_frames, read_mesh, read_model,
};
use cager_geometry::mesh::Polygons;
use support::archive::*;
use support::{all, message, numbers, polygons, read, wide};
use tempfile::{TempDir, tempdir};

/// Samples at 24 frames per second from frame 1 on.
const EVEN: (f64, &[f64]) = (1.0 / 24.0, &[1.0 / 24.0]);
/// What no cycle is written as.
const ACYCLIC: f64 = f64::MAX / 32.0;
const IDENTITY: [f64; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

fn open(bytes: &[u8], points: usize) -> Result<Box<dyn FrameReader + '_>, Error> {
    open_frames_bytes(CacheFormat::Abc, Path::new("a.abc"), bytes, points)
}

/// So many frames of a triangle that rises.
fn rising(frames: u8) -> Vec<Vec<f32>> {
    (0..frames).map(|k| vec![0.0, f32::from(k), 0.0, 1.0, f32::from(k), 0.0, 0.0, f32::from(k), 1.0]).collect()
}

fn triangle(frames: u8) -> Node {
    mesh("triangle", positions(&rising(frames)), &[&[2, 1, 0]])
}

fn saved(bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.abc");
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// Writes frames and gives the file.
fn written(frames: &[Vec<f32>], faces: &Polygons, options: &FrameOptions) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("my walk.abc");
    let mut writer = create_frames(&path, frames[0].len() / 3, frames.len(), faces, options).unwrap();
    frames.iter().for_each(|frame| writer.write_frame(frame).unwrap());
    writer.finish().unwrap();
    (folder, path)
}

#[test]
fn archives_come_back_as_they_were_written() {
    let faces = polygons(&[&[0, 1, 2], &[3, 2, 1, 0], &[0, 1, 2, 3, 1]]);
    let frames: Vec<Vec<f32>> =
        (0..300_u16).map(|k| (0..12).map(|i| (f32::from(k) + 0.1) * i as f32).collect()).collect();
    for (fps, first, step) in [(24.0, 0.0, 1.0), (25.0, 1001.0, 1.0), (30000.0 / 1001.0, -3.0, 1.0), (60.0, 10.0, 2.0)]
    {
        let told: Vec<f64> = (0..300).map(|k| first + step * f64::from(k)).collect();
        let options = FrameOptions { fps, numbers: told.clone(), ..FrameOptions::default() };
        let (_folder, path) = written(&frames, &faces, &options);
        let mut reader = open_frames(&path, 4).unwrap();
        assert_eq!((reader.frames(), reader.frame_rate()), (300, Some(fps)));
        assert_eq!(numbers(&*reader), told);
        assert!(reader.notes().is_empty() && !reader.numbers_are_times());
        assert_eq!(all(&mut *reader), wide(&frames));
        assert_eq!(reader.mesh().unwrap(), (path.as_path(), &faces));
        let model = read_model(&path).unwrap();
        assert_eq!((model.points.as_flattened(), model.faces), (&wide(&frames)[0][..], faces.clone()));
    }
}

#[test]
fn the_mesh_is_called_as_the_file_and_lies_below_a_transform() {
    let (_folder, path) = written(&rising(1), &polygons(&[&[0, 1, 2]]), &FrameOptions::default());
    for prim in ["/my_walk/my_walkShape", "my_walk", "my_walkShape", "/my_walk"] {
        assert_eq!(read_mesh(&path, &[prim.to_owned()]).unwrap().model.points.len(), 3, "{prim}");
    }
}

#[test]
fn what_lies_far_away_keeps_its_place_exactly() {
    let origin = [1e7 + 0.125, -3.5e6, 1.0 / 3.0];
    let options = FrameOptions { origin: Some(origin), ..FrameOptions::default() };
    let frames = vec![vec![0.1, 0.2, 0.3, -1e-6, 5.0, 7.0]];
    let (_folder, path) = written(&frames, &Polygons::new(), &options);
    let expected: Vec<f64> = wide(&frames)[0].iter().zip(origin.iter().cycle()).map(|(x, o)| x + o).collect();
    assert_eq!(all(&mut *open_frames(&path, 2).unwrap()), [expected]);
}

#[test]
fn frames_at_uneven_times_keep_their_numbers() {
    let told = vec![1.0, 2.0, 5.0, 9.0];
    let options = FrameOptions { fps: 25.0, numbers: told.clone(), ..FrameOptions::default() };
    let (_folder, path) = written(&rising(4), &Polygons::new(), &options);
    let reader = open_frames(&path, 3).unwrap();
    assert_eq!((numbers(&*reader), reader.frame_rate(), reader.numbers_are_times()), (told, Some(25.0), true));
    assert!(reader.notes()[0].contains("its times are not evenly spaced"));
}

#[test]
fn a_file_that_is_not_finished_is_not_there() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.abc");
    let faces = polygons(&[&[0, 1, 2]]);
    let mut writer = create_frames(&path, 3, 2, &faces, &FrameOptions::default()).unwrap();
    writer.write_frame(&[0.0; 9]).unwrap();
    assert!(matches!(writer.write_frame(&[f32::NAN; 9]), Err(Error::NonFinite { frame: 1, point: 0, .. })));
    assert!(matches!(writer.finish(), Err(Error::FrameCount { announced: 2, written: 1, .. })));
    let error = message(create_frames(&path, 2, 2, &faces, &FrameOptions::default()));
    assert!(error.contains("face 0: the face names vertex 2, but there are 2 vertices"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn double_precision_and_subdivision_surfaces_are_read() {
    let mut node = triangle(1);
    node.metadata = SUBDIVISION;
    node.properties[0] = array("P", (F64, 3), 1, &[vec![0.1, 0.2, 0.3], vec![1.0 / 3.0, 1e300, 0.0]], f64::to_le_bytes);
    node.properties[1].samples = vec![vec![]];
    node.properties[2].samples = vec![vec![]];
    let bytes = archive("", &[EVEN], &[node]);
    assert_eq!(all(&mut *open(&bytes, 1).unwrap()), [vec![0.1, 0.2, 0.3], vec![1.0 / 3.0, 1e300, 0.0]]);
}

#[test]
fn faces_are_turned_counterclockwise_and_edges_left_out() {
    let faces: &[&[i32]] = &[&[2, 1, 0], &[0, 1], &[0, 1, 2, 1], &[]];
    let (_folder, path) = saved(&archive("", &[EVEN], &[mesh("m", positions(&rising(1)), faces)]));
    let ReadModel { model, note, .. } = read_mesh(&path, &[]).unwrap();
    assert_eq!(model.faces, polygons(&[&[0, 1, 2], &[1, 2, 1, 0]]));
    assert!(note.unwrap().contains("left out 2 faces"));
    let mirror = transform("mirror", &[0x00], 0, &[vec![-1.0, 1.0, 1.0]], vec![triangle(1)]);
    assert_eq!(read("a.abc", archive("", &[EVEN], &[mirror])).unwrap().faces, polygons(&[&[2, 1, 0]]));
}

#[test]
fn transforms_above_a_mesh_move_it_even_where_they_are_animated() {
    // The outer one is animated at half the rate of the points, so that it is interpolated; the inner one turns y to z.
    let turn = |child| transform("turn", &[0x40], 0, &[vec![90.0]], vec![child]);
    let slow = (1.0 / 12.0, &[1.0 / 24.0][..]);
    let moved = |child| {
        transform(
            "move",
            &[0x10, 0x00],
            2,
            &[vec![0.0, 0.0, 0.0, 2.0, 2.0, 2.0], vec![10.0, 0.0, 0.0, 2.0, 2.0, 2.0]],
            vec![child],
        )
    };
    let bytes = archive("", &[EVEN, slow], &[moved(turn(triangle(3)))]);
    let frames = all(&mut *open(&bytes, 3).unwrap());
    let rounded: Vec<Vec<f64>> = frames.iter().map(|frame| frame.iter().map(|x| x.round()).collect()).collect();
    assert_eq!(rounded[0], [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, -2.0, 0.0]);
    assert_eq!(rounded[1], [5.0, 0.0, 2.0, 7.0, 0.0, 2.0, 5.0, -2.0, 2.0]);
    assert_eq!(rounded[2], [10.0, 0.0, 4.0, 12.0, 0.0, 4.0, 10.0, -2.0, 4.0]);

    // A still mesh is animated by what is above it; what does not inherit ends the chain.
    let ride = transform("ride", &[0x10], 1, &[vec![0.0, 0.0, 1.0], vec![0.0, 0.0, 2.0]], vec![triangle(1)]);
    let mut stand = ride.clone();
    stand.properties[2].samples = vec![vec![0]];
    for (node, lift) in [(ride, 2.0), (stand, 0.0)] {
        let bytes = archive("", &[EVEN], &[transform("lift", &[0x30], 0, &[matrix(lift)], vec![node])]);
        let mut reader = open(&bytes, 3).unwrap();
        assert_eq!((reader.frame_rate(), numbers(&*reader)), (Some(24.0), vec![1.0, 2.0]));
        let heights: Vec<[f64; 2]> = all(&mut *reader).iter().map(|frame| [frame[1], frame[2]]).collect();
        assert_eq!(heights, [[lift, 1.0], [lift, 2.0]]);
    }
}

fn matrix(lift: f64) -> Vec<f64> {
    let mut matrix = IDENTITY.to_vec();
    matrix[13] = lift;
    matrix
}

#[test]
fn frame_numbers_follow_the_times_of_samples() {
    let read = |information: &str, times: (f64, &[f64]), frames: u8| {
        let bytes = archive(information, &[times], &[triangle(frames)]);
        let reader = open(&bytes, 3).unwrap();
        (reader.frame_rate(), numbers(&*reader))
    };
    assert_eq!(read("", (1.0 / 30.0, &[0.0]), 2), (Some(30.0), vec![0.0, 1.0]));
    assert_eq!(read("_ai_DCC_FPS=24", (1.0 / 30.0, &[0.1]), 2), (Some(30.0), vec![3.0, 4.0]));
    // Two samples a frame, and one for two frames.
    assert_eq!(read("a=b;_ai_DCC_FPS=24.0", (1.0 / 48.0, &[1.0 / 24.0]), 3), (Some(24.0), vec![1.0, 1.5, 2.0]));
    assert_eq!(read("FramesPerTimeUnit=25", (0.08, &[0.04]), 3), (Some(25.0), vec![1.0, 3.0, 5.0]));
    assert_eq!(read("FramesPerTimeUnit=30", (1.0 / 30.0, &[0.0, 1.0 / 60.0]), 3), (Some(30.0), vec![0.0, 0.5, 1.0]));
    // A cycle of an open and a closed shutter; times of their own.
    let (rate, found) = read("", (0.1, &[0.0, 0.025]), 4);
    assert!(rate.is_some() && found.windows(2).all(|pair| pair[0] < pair[1]), "{rate:?} {found:?}");
    assert_eq!(read("", (ACYCLIC, &[0.0, 0.5, 1.0, 2.5]), 4), (Some(2.0), vec![0.0, 1.0, 2.0, 5.0]));
    assert_eq!(read("", (0.0, &[3.0]), 1), (None, vec![0.0]));
    let bytes = archive("", &[(ACYCLIC, &[0.0, 1.0])], &[triangle(3)]);
    assert!(message(open(&bytes, 3)).contains("it promises 3 frames, of which not all can be there"));
    let bytes = archive("", &[(0.0, &[3.0])], &[triangle(3)]);
    assert!(message(open(&bytes, 3)).contains("export it again with times in seconds"));
}

#[test]
fn samples_of_transforms_between_and_behind_those_of_points_are_frames() {
    // As Blender writes them with five samples of transforms and one of points.
    let fine = (1.0 / 120.0, &[1.0 / 24.0][..]);
    let values: Vec<Vec<f64>> = (0..16).map(|k| vec![f64::from(k * k), 0.0, 0.0]).collect();
    let bytes = archive("_ai_DCC_FPS=24", &[EVEN, fine], &[transform("move", &[0x10], 2, &values, vec![triangle(3)])]);
    let mut reader = open(&bytes, 3).unwrap();
    assert_eq!((reader.frame_rate(), reader.frames(), reader.number(5), reader.number(15)), (Some(24.0), 16, 2.0, 4.0));
    for (k, frame) in all(&mut *reader).iter().enumerate() {
        let (x, y) = ((k * k) as f64, (k as f64 / 5.0).min(2.0));
        assert!((frame[0] - x).abs() < 1e-9 && (frame[1] - y).abs() < 1e-5, "{k}: {frame:?}");
    }
    // At times that are no even part of a frame.
    let own = (ACYCLIC, &[1.0 / 24.0, 2.5 / 24.0][..]);
    let still = [vec![0.0; 3], vec![3.0, 0.0, 0.0]];
    let bytes = archive("_ai_DCC_FPS=24", &[EVEN, own], &[transform("move", &[0x10], 2, &still, vec![triangle(3)])]);
    let mut reader = open(&bytes, 3).unwrap();
    assert_eq!(numbers(&*reader), [1.0, 2.0, 2.5, 3.0]);
    let places: Vec<[f64; 2]> = all(&mut *reader).iter().map(|frame| [frame[0], frame[1]]).collect();
    assert!(
        places
            .iter()
            .zip([[0.0, 0.0], [2.0, 1.0], [3.0, 1.5], [3.0, 2.0]])
            .all(|(found, wanted)| { (found[0] - wanted[0]).abs() < 1e-9 && (found[1] - wanted[1]).abs() < 1e-9 })
    );
    // Samples that no file of this size holds take no memory.
    let mut long = transform("move", &[0x10], 2, &still, vec![triangle(3)]);
    long.properties[1].changes = Some([1 << 30, 1, 2]);
    assert!(message(open(&archive("", &[EVEN, fine], &[long]), 3)).contains("promises 1073741824 frames"));
}

#[test]
fn transforms_turn_between_their_samples_and_say_where_these_are_sparse() {
    // Half a turn but for 8 degrees, as a matrix: half of it is in the middle.
    let turned = |degrees: f64| {
        let (s, c) = degrees.to_radians().sin_cos();
        let mut matrix = IDENTITY.to_vec();
        (matrix[0], matrix[1], matrix[4], matrix[5]) = (c, s, -s, c);
        matrix
    };
    let slow = (1.0 / 12.0, &[1.0 / 24.0][..]);
    let turn = |sampling| transform("turn", &[0x30], sampling, &[turned(0.0), turned(172.0)], vec![triangle(3)]);
    let bytes = archive("", &[EVEN, slow], &[turn(2)]);
    let mut reader = open(&bytes, 3).unwrap();
    assert_eq!(reader.notes(), Vec::<String>::new());
    let frame = &all(&mut *reader)[1];
    let edge = [frame[3] - frame[0], frame[4] - frame[1]];
    let (s, c) = 86_f64.to_radians().sin_cos();
    assert!((edge[0] - c).abs() < 1e-9 && (edge[1] - s).abs() < 1e-9, "{edge:?}");
    // Two samples a second apart.
    let bytes = archive("", &[(1.0, &[0.0])], &[turn(1)]);
    assert!(open(&bytes, 3).unwrap().notes()[0].contains("its transforms have samples up to 1.0000 s apart"));
}

#[test]
fn what_is_not_read_of_a_mesh_is_named() {
    let mut node = triangle(1);
    for (name, extent) in [("uv", 2), ("N", 3), (".velocities", 3)] {
        node.properties.push(array(name, (F32, extent), 0, &[vec![0.5_f32; 6]], f32::to_le_bytes));
    }
    // With indices, as Blender writes texture coordinates.
    let uv = node.properties.iter_mut().find(|property| property.name == "uv").unwrap();
    *uv = Property { kind: 0, number: 0, extent: 0, samples: vec![], ..uv.clone() };
    let set = Node {
        name: "skin",
        metadata: "schema=AbcGeom_FaceSet_v1",
        compound: ".faceset",
        properties: vec![],
        children: vec![],
    };
    node.children = vec![set];
    let (_folder, path) = saved(&archive("", &[EVEN], &[node]));
    let sentence = read_mesh(&path, &[]).unwrap().dropped.sentence(&path, false).unwrap();
    let what = "texture coordinates (uv), normals (N) and velocities are not kept";
    assert!(sentence.ends_with(what), "{sentence}");
    let (_folder, path) = written(&rising(1), &polygons(&[&[0, 1, 2]]), &FrameOptions::default());
    assert_eq!(read_mesh(&path, &[]).unwrap().dropped.sentence(&path, false), None);
}

#[test]
fn rates_of_television_stay_fractions() {
    let fps = 24_000.0 / 1001.0;
    for (information, step) in
        [("", 1001.0 / 24_000.0), ("_ai_DCC_FPS=23.976", 1001.0 / 24_000.0), ("FramesPerTimeUnit=23.976", 1.0 / 23.976)]
    {
        let bytes = archive(information, &[(step, &[0.0])], &[triangle(3)]);
        let reader = open(&bytes, 3).unwrap();
        assert_eq!((reader.frame_rate(), numbers(&*reader)), (Some(fps), vec![0.0, 1.0, 2.0]), "{information}");
    }
}

#[test]
fn repeated_samples_are_frames() {
    let mut node = triangle(3);
    // Of seven samples the first two are the same, and the last three.
    node.properties[0].changes = Some([7, 2, 3]);
    let bytes = archive("", &[EVEN], &[node.clone()]);
    let heights: Vec<f64> = all(&mut *open(&bytes, 3).unwrap()).iter().map(|frame| frame[1]).collect();
    assert_eq!(heights, [0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 2.0]);
    node.properties[0].changes = Some([1 << 30, 0, 0]);
    assert!(message(open(&archive("", &[EVEN], &[node]), 3)).contains("promises 1073741824 frames"));
}

#[test]
fn frames_that_the_archive_does_not_hold_are_bounded() {
    // So many frames of a triangle, of which some are stored, the last one from then on.
    let held = |frames: u32, stored: u32| {
        let of = |k: u32| vec![0.0, k as f32, 0.0, 1.0, k as f32, 0.0, 0.0, k as f32, 1.0];
        let mut node = mesh("m", positions(&(0..stored).map(of).collect::<Vec<_>>()), &[&[2, 1, 0]]);
        node.properties[0].changes = Some([frames, 1, stored - 1]);
        archive("", &[EVEN], &[node])
    };
    let bytes = held(1 << 14, 3);
    assert_eq!(all(&mut *open(&bytes, 3).unwrap()).last().unwrap()[1], 2.0);
    let error = message(open(&held((1 << 14) + 1, 3), 3));
    assert!(error.contains("promises 16385 frames, of which it holds fewer than half; export 16384 frames"), "{error}");
    let mut empty = mesh("m", positions(&[vec![]]), &[]);
    empty.properties[0].changes = Some([u32::MAX, 0, 0]);
    // Of times that would take memory for every frame.
    let bytes = archive("", &[(1.0, &[0.0, 0.7])], &[empty]);
    assert!(message(open(&bytes, 3)).contains("has a mesh without points in its first frame"));
    let bytes = held(20_000, 12_000);
    assert_eq!(all(&mut *open(&bytes, 3).unwrap()).last().unwrap()[1], 11_999.0);
}

#[test]
fn faces_that_are_stored_twice_are_compared_once() {
    // Long tables, which differ in edges alone, so that the faces are the same.
    let faces = |edge: [i32; 2]| [vec![2, 1, 0], edge.repeat(1000)].concat();
    let counts = [vec![3], vec![2; 1000]].concat();
    let of = |kinds: &[[i32; 2]]| {
        let mut node = triangle(255);
        let indices: Vec<Vec<i32>> = kinds.iter().cycle().take(255).map(|&edge| faces(edge)).collect();
        node.properties[1] = array(".faceIndices", (I32, 1), 1, &indices, i32::to_le_bytes);
        node.properties[2] = array(".faceCounts", (I32, 1), 0, std::slice::from_ref(&counts), i32::to_le_bytes);
        archive("", &[EVEN], &[node])
    };
    assert_eq!(all(&mut *open(&of(&[[0, 1], [1, 2]]), 3).unwrap()).len(), 255);
    let bytes = of(&[[0, 1], [1, 2], [2, 0]]);
    let (mut reader, mut frame) = (open(&bytes, 3).unwrap(), Vec::new());
    let failed = (0..255).find_map(|_| reader.read_next(&mut frame).err()).expect("tables are not read again for ever");
    assert!(failed.to_string().contains("its tables overlap"), "{failed}");
}

#[test]
fn a_transform_tells_the_frames_of_equal_positions() {
    let mut still = triangle(1);
    still.properties[0].changes = Some([2, 0, 0]);
    let lifts: Vec<Vec<f64>> = (0..10).map(|k| vec![0.0, f64::from(k), 0.0]).collect();
    let bytes = archive("", &[EVEN], &[transform("lift", &[0x10], 1, &lifts, vec![still])]);
    let heights: Vec<f64> = all(&mut *open(&bytes, 3).unwrap()).iter().map(|frame| frame[1]).collect();
    assert_eq!(heights, (0..10).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn faces_are_wound_by_the_first_transform_that_has_a_volume() {
    // Scaled to nothing at first, mirrored then.
    let scales = [vec![0.0; 3], vec![-1.0, 1.0, 1.0], vec![-2.0, 1.0, 1.0]];
    let bytes = archive("", &[EVEN], &[transform("appears", &[0x00], 1, &scales, vec![triangle(3)])]);
    assert_eq!(open(&bytes, 3).unwrap().mesh().unwrap().1, &polygons(&[&[2, 1, 0]]));
}

#[test]
fn tables_longer_than_any_program_writes_are_refused() {
    let with = |property: usize, sample: Vec<u8>| {
        let mut node = transform("x", &[0x10], 0, &[vec![0.0; 3]], vec![triangle(1)]);
        node.properties[property].samples = vec![sample];
        message(open(&archive("", &[EVEN], &[node]), 3))
    };
    assert!(with(0, vec![0x10; 257]).contains(".ops has 257 bytes where 256 are the most"));
    assert!(with(1, vec![0; 8 * 16 * 256 + 8]).contains(".vals has 32776 bytes where 32768 are the most"));
    assert!(with(2, vec![1; 2]).contains(".inherits has 2 bytes where 1 are the most"));
    let edges = vec![&[0, 1][..]; 300_000];
    let error = message(open(&archive("", &[EVEN], &[mesh("m", positions(&rising(1)), &edges)]), 3));
    assert!(error.contains("numbers of faces where 262144 are the most"), "{error}");
    // Operations that are done for every frame.
    let many = |children| transform("turns", &[0x40; 256], 1, &[vec![0.0; 256], vec![1.0; 256]], children);
    let chain = |links: usize| (0..links).fold(triangle(1), |inner, _| many(vec![inner]));
    let error = message(open(&archive("", &[EVEN], &[chain(17)]), 3));
    assert!(error.contains("the transforms above a mesh have more operations than any program writes"), "{error}");
    assert!(open(&archive("", &[EVEN], &[chain(16)]), 3).is_ok());
}

#[test]
fn objects_that_nest_too_deep_are_refused() {
    let nested = |depth: usize| {
        (1..depth).fold(triangle(1), |inner, _| transform("x", &[0x10], 0, &[vec![1.0, 0.0, 0.0]], vec![inner]))
    };
    let bytes = archive("", &[EVEN], &[nested(256)]);
    assert_eq!(all(&mut *open(&bytes, 3).unwrap())[0][0], 255.0);
    assert!(
        message(open(&archive("", &[EVEN], &[nested(257)]), 3))
            .contains("nests deeper than 256; export the mesh alone")
    );
}

#[test]
fn more_objects_than_programs_write_are_refused() {
    let mut bytes = archive("", &[EVEN], &[triangle(1)]);
    // In place of the top another group, after all else: of no properties, empty objects and no headers.
    let (at, root) = (bytes.len() as u64, u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize);
    bytes[root + 24..root + 32].copy_from_slice(&at.to_le_bytes());
    let objects = (1 << 20) + 1;
    bytes.extend((objects as u64 + 2).to_le_bytes());
    bytes.resize(bytes.len() + 8 * (objects + 1), 0);
    bytes.extend(DATA.to_le_bytes());
    assert!(message(open(&bytes, 3)).contains("has more than 1048576 objects; export the mesh alone"));
}

#[test]
fn the_only_mesh_is_taken_whatever_it_is_called() {
    // As of a rest pose beside a capture of several meshes.
    let (_folder, path) = saved(&archive("", &[EVEN], &[triangle(1)]));
    for prim in ["body", "/walk/body"] {
        assert_eq!(read_mesh(&path, &[prim.to_owned()]).unwrap().model.points.len(), 3, "{prim}");
    }
}

#[test]
fn messages_tell_long_paths_apart() {
    let long: &'static str = "a_name_that_is_as_long_as_programs_make_them_of_the_names_of_all_that_is_above";
    let twins = ["left", "right"].map(|name| {
        let mut node = triangle(1);
        node.name = name;
        node
    });
    let error =
        message(open(&archive("", &[EVEN], &[transform(long, &[0x10], 0, &[vec![0.0; 3]], twins.to_vec())]), 3));
    assert!(error.contains(&format!("/{long}/left (3 points) and /{long}/right (3 points)")), "{error}");
}

#[test]
fn archives_beside_other_captures_are_no_captures() {
    let folder = tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let without = |no_frames: &[PathBuf]| {
        let selection = FrameSelection { no_frames: no_frames.to_vec(), ..FrameSelection::default() };
        open_selected_frames(folder.path(), 3, &selection).map(|reader| reader.frames())
    };
    let scene = put("scene.abc", &archive("", &[EVEN], &[triangle(3)]));
    assert_eq!((without(&[]).unwrap(), without(std::slice::from_ref(&scene)).unwrap()), (3, 3));
    let rest = put("rest.abc", &archive("", &[EVEN], &[triangle(1)]));
    assert!(message(without(&[])).contains("has 2 captures, such as scene.abc of 3 frames; name one of them"));
    assert_eq!(without(&[rest]).unwrap(), 3);
    let mut array = b"\x93NUMPY\x01\0\x76\0".to_vec();
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, 3), }";
    array.extend(format!("{header:<117}\n").bytes().chain([0; 72]));
    let array = put("frames.npy", &array);
    assert_eq!(without(&[]).unwrap(), 2);
    assert_eq!(frame_files(folder.path()), [array]);
}

#[test]
fn a_capture_is_no_sequence_of_surfaces() {
    let (_folder, path) = saved(&archive("", &[EVEN], &[triangle(3)]));
    assert!(message(mesh_sequence(&path, &[])).contains("encode it with cager encode; for surfaces give a folder"));
}

#[test]
fn one_of_several_meshes_is_chosen_by_path_or_name() {
    let other = mesh("body", positions(&[vec![5.0; 6]]), &[]);
    let mut same = triangle(1);
    same.name = "body";
    let place = |name, child| transform(name, &[0x10], 0, &[vec![0.0, 0.0, 0.0]], vec![child]);
    let (_folder, path) = saved(&archive("", &[EVEN], &[place("coat", same), place("skin", other)]));
    let list = "/coat/body (3 points) and /skin/body (2 points)";
    let together = format!("holds 2 meshes, {list}, which together have 5 points, and 7 are expected; choose by paths");
    assert!(message(open_frames(&path, 7)).contains(&together));
    open_frames(&path, 5).unwrap();
    let take = |prim: &str, points| {
        let selection = FrameSelection { prims: vec![prim.to_owned()], ..FrameSelection::default() };
        open_selected_frames(&path, points, &selection).map(|mut reader| all(&mut *reader))
    };
    for prim in ["/skin/body", "skin/body/", "skin", "/skin", "body"] {
        assert_eq!(take(prim, 2).unwrap(), [vec![5.0; 6]], "{prim}");
    }
    for (prim, points) in [("/skin/body", 2), ("skin", 2), ("body", 5)] {
        assert_eq!(read_mesh(&path, &[prim.to_owned()]).unwrap().model.points.len(), points, "{prim}");
    }
    for prim in ["hat", "/hat/body", "/body", "ody", "/coat/body/body"] {
        assert!(message(take(prim, 2)).contains(&format!("holds no mesh {prim}, but {list}; give")), "{prim}");
    }
    assert!(matches!(take("/coat", 2), Err(Error::PointCount { expected: 2, found: 3, .. })));
}

/// An object that is another one once more.
fn instance(name: &'static str, of: &str) -> Node {
    let source = array(".instanceSource", (TEXT, 1), 0, &[of.as_bytes().to_vec()], u8::to_le_bytes);
    let properties = vec![Property { kind: 1, ..source }];
    Node { name, metadata: "isInstance=1", compound: "", properties, children: vec![] }
}

#[test]
fn instances_are_parts_of_their_own() {
    // Written by `tests/peers/make_alembic.py`.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/alembic/instances.abc");
    let read = read_mesh(&path, &[]).unwrap();
    assert_eq!(read.dropped, Default::default());
    let surface = &read.model.surface;
    let paths: Vec<&str> = surface.parts.iter().map(|part| part.path.as_str()).collect();
    assert_eq!(paths, ["/tree/leaf", "/a/leaf_a", "/b/tree_b/leaf"]);
    assert!(surface.materials.len() == 1 && surface.parts.iter().all(|part| part.materials == [0]));
    let mut reader = open_frames(&path, 9).unwrap();
    for (k, frame) in all(&mut *reader).iter().enumerate() {
        let (z, y) = (k as f64, 20.0 + 10.0 * k as f64);
        let firsts = [0, 1, 2].map(|part| [0, 1, 2].map(|axis| frame[9 * part + axis]));
        // An instance of the mesh stays behind what moves the mesh, one of the transform does not.
        assert_eq!(firsts, [[0.0, 0.0, z], [10.0, 0.0, 0.0], [0.0, y, z]], "{k}");
    }
    let selection = FrameSelection { prims: vec!["tree_b".to_owned()], ..FrameSelection::default() };
    assert_eq!(open_selected_frames(&path, 3, &selection).unwrap().frames(), 2);
}

#[test]
fn instances_of_nothing_or_of_themselves_and_too_many_are_told() {
    let open = |nodes: &[Node]| {
        let (_folder, path) = saved(&archive("", &[EVEN], nodes));
        read_mesh(&path, &[]).and_then(|read| {
            let reader = open_frames(&path, read.model.points.len())?;
            Ok((read.model.points.len(), reader.notes().concat()))
        })
    };
    let chain =
        [triangle(1), instance("a", "/b"), instance("b", "/triangle"), instance("c", "/gone"), instance("d", "")];
    let (points, notes) = open(&chain).unwrap();
    assert_eq!(points, 9);
    for what in ["/c is an instance of /gone, which is not there", "/d is an instance of nothing"] {
        assert!(notes.contains(what), "{notes}");
    }
    assert!(message(open(&chain[3..])).contains("/c is an instance of /gone, which is not there, and is left out; "));
    let inside = transform("x", &[0x10], 0, &[vec![0.0; 3]], vec![triangle(1), instance("again", "/x")]);
    assert!(message(open(&[inside])).contains("nests deeper than 256"));
    let (_, notes) = open(&[triangle(1), instance("a", "/b"), instance("b", "/a")]).unwrap();
    assert!(notes.contains("/a is an instance of itself"), "{notes}");
    // Each level shows the one before ten times.
    let names = ["l0", "l1", "l2", "l3", "l4", "l5", "l6"];
    let twice = |k: usize| {
        let copies =
            ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"].map(|name| instance(name, &format!("/l{}", k - 1)));
        transform(names[k], &[0x10], 0, &[vec![0.0; 3]], copies.to_vec())
    };
    let first = transform("l0", &[0x10], 0, &[vec![0.0; 3]], vec![triangle(1)]);
    let levels: Vec<Node> = std::iter::once(first).chain((1..7).map(twice)).collect();
    assert!(message(open(&levels)).contains("shows its meshes so many times"));
    // The same without anything that is there: of those in copies there is one message.
    let missing = |levels: usize| {
        let first = transform("l0", &[0x10], 0, &[vec![0.0; 3]], vec![instance("gone", "/nothing")]);
        let levels = std::iter::once(first).chain((1..levels).map(twice));
        open(&levels.chain([triangle(1)]).collect::<Vec<_>>())
    };
    let (points, notes) = missing(3).unwrap();
    assert_eq!((points, notes.matches("which is not there").count()), (3, 1));
    assert!(notes.contains("/l0/gone is an instance of /nothing") && notes.contains("110 more times"), "{notes}");
    assert!(message(missing(7)).contains("shows its meshes so many times"));
}

#[test]
fn topology_that_changes_names_the_frame() {
    let mut frames = rising(3);
    frames[2].extend([0.0; 3]);
    let bytes = archive("", &[EVEN], &[mesh("m", positions(&frames), &[&[2, 1, 0]])]);
    let (mut reader, mut frame) = (open(&bytes, 3).unwrap(), Vec::new());
    assert!(reader.read_next(&mut frame).unwrap() && reader.read_next(&mut frame).unwrap());
    let error = message(reader.read_next(&mut frame));
    assert!(error.contains("frame 2: its topology changes: it has 4 points, and 3 in frame 0; "), "{error}");

    let mut node = triangle(3);
    let faces = [vec![2, 1, 0], vec![2, 1, 0], vec![1, 2, 0]];
    node.properties[1] = array(".faceIndices", (I32, 1), 1, &faces, i32::to_le_bytes);
    let bytes = archive("", &[EVEN], &[node]);
    let mut reader = open(&bytes, 3).unwrap();
    assert!(reader.read_next(&mut frame).unwrap() && reader.read_next(&mut frame).unwrap());
    assert!(message(reader.read_next(&mut frame)).contains("frame 2: its topology changes: its faces are not those"));
}

#[test]
fn what_cannot_be_read_says_why_and_what_to_do() {
    let whole = archive("", &[EVEN], &[triangle(2)]);
    let with = |at: usize, byte: u8| {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        message(open(&bytes, 3))
    };
    assert!(with(5, 0).contains("was never closed: the program that wrote it stopped before its end; export it again"));
    assert!(with(7, 9).contains("is of version 9 of Ogawa"));
    assert!(with(0, b'0').contains("does not begin as an Alembic archive does"));
    assert!(with(15, 0x7f).contains("an offset leads out of the file"));
    let hdf5 = message(open(b"\x89HDF\r\n\x1a\n and so on", 3));
    assert!(hdf5.contains("of the old kind, HDF5, which is not read; write it as Ogawa with abcconvert -toOgawa"));
    assert!(message(open(&support::npy_f4(), 3)).contains("is not a .abc file but a file of the kind .npy"));
    assert!(message(read("a.abc", b"Ogawa")).contains("does not begin as"));
    let none = archive("", &[EVEN], &[transform("x", &[0x10], 0, &[vec![0.0; 3]], vec![])]);
    assert!(message(open(&none, 3)).contains("holds no polygon mesh; export the mesh itself as Alembic"));
    assert!(matches!(open(&whole, 4), Err(Error::PointCount { expected: 4, found: 3, .. })));

    let of = |change: &dyn Fn(&mut Node)| {
        let mut node = triangle(2);
        change(&mut node);
        message(open(&archive("", &[EVEN], &[node]), 3))
    };
    assert!(of(&|node| drop(node.properties.remove(0))).contains("has a mesh without samples of P"));
    assert!(of(&|node| node.properties[0].extent = 2).contains("positions that are not three numbers"));
    assert!(of(&|node| node.properties[0].samples[0].truncate(11)).contains("end within a point"));
    assert!(of(&|node| node.properties[0].samples[0].clear()).contains("a mesh without points in its first frame"));
    assert!(of(&|node| node.properties[1].samples[0][0] = 3).contains("face 0: the face names vertex 3"));
    assert!(of(&|node| node.properties[2].samples[0][3] = 1).contains("face 0 has more corners than are there"));
    assert!(of(&|node| node.properties[0].sampling = 2).contains("times that are not there"));

    let mut bad = rising(2);
    bad[1][4] = f32::INFINITY;
    let bytes = archive("", &[EVEN], &[mesh("m", positions(&bad), &[])]);
    let (mut reader, mut frame) = (open(&bytes, 3).unwrap(), Vec::new());
    assert!(reader.read_next(&mut frame).unwrap());
    assert!(matches!(reader.read_next(&mut frame), Err(Error::NonFinite { frame: 1, point: 1, .. })));
    let lost = transform("x", &[0x10], 0, &[vec![f64::NAN; 3]], vec![triangle(1)]);
    assert!(message(open(&archive("", &[EVEN], &[lost]), 3)).contains("has a transform that is NaN or infinite"));
}

#[test]
fn objects_that_contain_themselves_are_refused() {
    let place = |name, child| transform(name, &[0x10], 0, &[vec![0.0; 3]], vec![child]);
    let whole = archive("", &[EVEN], &[place("outer", place("inner", triangle(1)))]);
    let number = |at: usize| u64::from_le_bytes(whole[at..at + 8].try_into().unwrap());
    // Where a group has the offset of one of its children, and that offset; the first child of an
    // object are its properties.
    let slot = |group: u64, child: usize| group as usize + 8 + 8 * child;
    let child = |group: u64| number(slot(group, 1));
    let top = number(slot(number(8), 2));
    let (outer, inner) = (child(top), child(child(top)));
    let objects = [top, outer, inner, child(inner)];
    assert!(objects.iter().all(|&group| group & DATA == 0) && open(&whole, 3).is_ok());
    for (depth, &group) in objects[..3].iter().enumerate() {
        // Itself, and each that it lies below.
        for target in &objects[..=depth] {
            let mut bytes = whole.clone();
            let at = slot(group, 1);
            bytes[at..at + 8].copy_from_slice(&target.to_le_bytes());
            let error = message(open(&bytes, 3));
            assert!(error.contains("its tables overlap") || error.contains("nests deeper than 256"), "{error}");
        }
    }
}

/// `make alembic` installs it.
#[test]
fn the_library_of_alembic_reads_what_is_written() {
    let python = std::env::var("CAGER_ALEMBIC_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found = Command::new(&python).args(["-c", "import imath, alembic3d"]).output();
    if !found.is_ok_and(|found| found.status.success()) {
        eprintln!("skipped: {python} has no alembic3d; `make alembic` installs it and runs this test");
        return;
    }
    let faces = polygons(&[&[0, 1, 2], &[2, 1, 0, 3]]);
    let frames: Vec<Vec<f32>> =
        (0..300_u16).map(|k| (0..12).map(|i| (f32::from(k) + 0.1) * i as f32).collect()).collect();
    let uneven = FrameOptions { fps: 25.0, numbers: vec![1.0, 2.0, 5.0, 9.0], ..FrameOptions::default() };
    let far = FrameOptions { origin: Some([1e7 + 0.125, -3.5e6, 1.0 / 3.0]), ..FrameOptions::default() };
    for (options, count) in [(FrameOptions::default(), 300), (uneven, 4), (far, 1)] {
        let (_folder, path) = written(&frames[..count], &faces, &options);
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/read_alembic.py");
        let done = Command::new(&python).arg(script).arg(&path).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = String::from_utf8(done.stdout).unwrap();
        let mut lines = text.lines();
        assert_eq!((lines.next(), lines.next()), (Some("3 4"), Some("2 1 0 3 0 1 2")));
        let mut reader = open_frames(&path, 4).unwrap();
        let own = all(&mut *reader);
        assert_eq!(lines.clone().count(), count);
        for (frame, line) in lines.enumerate() {
            let values: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
            let time = options.numbers.get(frame).copied().unwrap_or(frame as f64) / options.fps;
            assert!((values[0] - time).abs() < 1e-12, "frame {frame} at {} s", values[0]);
            assert_eq!(values[1..], own[frame], "frame {frame}");
        }
    }
}
