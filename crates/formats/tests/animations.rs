//! What users rely on when animations of glTF are read, and frames are written as morph targets.

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use cager_formats::{
    CacheFormat, Error, FrameOptions, FrameReader, FrameSelection, MorphOptions, Target, create_frames, open_frames,
    open_frames_bytes, open_selected_frames, read_mesh, read_model,
};
use cager_geometry::mesh::Polygons;
use gltf::json::Root;
use gltf::json::accessor::Type;
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use support::document::Built;
use support::{POINTS, all, message, numbers, polygons, wide};
use tempfile::{TempDir, tempdir};

fn open(bytes: &[u8], points: usize) -> Result<Box<dyn FrameReader + '_>, Error> {
    open_frames_bytes(CacheFormat::Glb, Path::new("a.glb"), bytes, points)
}

/// One animation: where each channel leads, how it is interpolated, and its accessors of times and values.
fn animation(channels: &[(&str, &str, usize, usize)]) -> String {
    let targets: Vec<String> = channels
        .iter()
        .enumerate()
        .map(|(k, (target, ..))| format!(r#"{{"sampler":{k},"target":{target}}}"#))
        .collect();
    let samplers: Vec<String> = channels
        .iter()
        .map(|(_, way, input, output)| format!(r#"{{"input":{input},"output":{output},"interpolation":"{way}"}}"#))
        .collect();
    format!(r#""animations":[{{"channels":[{}],"samplers":[{}]}}]"#, targets.join(","), samplers.join(","))
}

fn close(found: &[f64], wanted: &[f64], within: f64) {
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() <= within, "{found} is not {wanted}");
    }
}

fn moved(by: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<f64> {
    POINTS.map(by).concat()
}

const MESH: &str = r#""meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":0}]}]"#;

#[test]
fn nodes_move_their_meshes_at_the_times_of_their_keys_and_between() {
    let mut built = Built::default();
    built.points();
    let (few, many) = (built.floats("SCALAR", &[0.5, 1.5]), built.floats("SCALAR", &[0.0, 0.5, 1.0, 1.5, 2.0]));
    let across = built.floats("VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let sizes = built.floats("VEC3", &[1.0, 2.0, 3.0, 2.0, 1.0].map(|x| [x; 3]).concat());
    // Half a turn about z in whole numbers, the second quaternion the other way around.
    let turn: Vec<u8> =
        [[0_i16, 0, 0, 32767], [0, 0, -32767, 0]].concat().iter().flat_map(|x| x.to_le_bytes()).collect();
    let turn = built.add(5122, 2, "VEC4", &turn);
    let nodes = r#""scenes":[{"nodes":[0,2]}],"nodes":[{"name":"above","children":[1]},{"mesh":0},{}]"#;
    let idle = (r#"{"node":2,"path":"translation"}"#, "LINEAR", 1, 1);
    let of = |channels: &[(&str, &str, usize, usize)]| {
        built.file(&format!("{MESH},{nodes},{}", animation(&[channels, &[idle]].concat())))
    };
    let bytes = of(&[
        (r#"{"node":0,"path":"translation"}"#, "LINEAR", few, across),
        (r#"{"node":1,"path":"scale"}"#, "STEP", many, sizes),
    ]);
    let mut reader = open(&bytes, 4).unwrap();
    assert_eq!((numbers(&*reader), reader.frame_rate()), (vec![0.0, 1.0, 2.0, 3.0, 4.0], Some(2.0)));
    for (found, (size, x)) in all(&mut *reader).iter().zip([(1.0, 0.0), (2.0, 0.0), (3.0, 2.0), (2.0, 4.0), (1.0, 4.0)])
    {
        close(found, &moved(|p| [size * p[0] + x, size * p[1], size * p[2]]), 1e-6);
    }
    let bytes = of(&[(r#"{"node":0,"path":"rotation"}"#, "LINEAR", few, turn)]);
    let folder = tempdir().unwrap();
    let path = folder.path().join("turn.glb");
    fs::write(&path, bytes).unwrap();
    let selection = FrameSelection { rate: Some(4.0), ..FrameSelection::default() };
    let mut reader = open_selected_frames(&path, 4, &selection).unwrap();
    assert_eq!((numbers(&*reader), reader.frame_rate()), (vec![2.0, 3.0, 4.0, 5.0, 6.0], Some(4.0)));
    for (k, found) in all(&mut *reader).iter().enumerate() {
        let (s, c) = (k as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
        // The shorter way is the same one, whatever the sign.
        let way = found[4].signum();
        close(found, &moved(|[x, y, z]| [c * x - way * s * y, way * s * x + c * y, z]), 1e-6);
    }
    // A folder with nothing but it has the same frames.
    assert_eq!(open_frames(folder.path(), 4).unwrap().frames(), 2);
    let endless = FrameSelection { rate: Some(1e8), ..FrameSelection::default() };
    assert!(message(open_selected_frames(&path, 4, &endless)).contains("frames"));
}

#[test]
fn weights_of_morph_targets_follow_their_splines() {
    let mut built = Built::default();
    built.points();
    // A target that is stored, and one of which a single point is.
    let stored = built.floats("VEC3", &[1.0, 0.0, 0.0].repeat(4));
    let (at, to) = (built.view(&[2]), built.view(&[0.0_f32, 0.0, 8.0].map(f32::to_le_bytes).concat()));
    built.accessors.push(format!(
        r#"{{"componentType":5126,"count":4,"type":"VEC3","sparse":{{"count":1,"indices":{{"bufferView":{at},"componentType":5121}},"values":{{"bufferView":{to}}}}}}}"#
    ));
    let sparse = built.accessors.len() - 1;
    let mesh = format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":0,"targets":[{{"POSITION":{stored}}},{{"POSITION":{sparse}}}]}}],"weights":[0,1]}}],"nodes":[{{"mesh":0}}]"#
    );
    let times = built.floats("SCALAR", &[0.0, 2.0]);
    // Tangents before, values, tangents behind; for two targets each.
    let spline = built.floats("SCALAR", &[9.0, 9.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 9.0, 9.0]);
    let target = r#"{"node":0,"path":"weights"}"#;
    let bytes = built.file(&format!("{mesh},{}", animation(&[(target, "CUBICSPLINE", times, spline)])));
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.glb");
    fs::write(&path, &bytes).unwrap();
    let rest = read_model(&path).unwrap();
    assert_eq!(rest.points[2], [0.0, 1.5, 8.0], "at rest the mesh's own weights hold");
    let selection = FrameSelection { rate: Some(1.0), ..FrameSelection::default() };
    let frames = all(&mut *open_selected_frames(&path, 4, &selection).unwrap());
    assert_eq!(frames.len(), 3);
    // In the middle of two seconds: half the values, and a quarter of the tangent behind.
    for (found, [first, second]) in frames.iter().zip([[0.0, 1.0], [0.75, 1.0], [1.0, 1.0]]) {
        let mut wanted = moved(|[x, y, z]| [x + first, y, z]);
        wanted[8] += 8.0 * second;
        close(found, &wanted, 1e-6);
    }
    let short = built.floats("SCALAR", &[1.0, 2.0, 3.0]);
    let bytes = built.file(&format!("{mesh},{}", animation(&[(target, "LINEAR", times, short)])));
    assert!(message(open(&bytes, 4)).contains("animation 0, channel 0: has 3 values for 2 times of 2 each"));
    let back = built.floats("SCALAR", &[1.0, 1.0]);
    let bytes = built.file(&format!("{mesh},{}", animation(&[(target, "STEP", back, spline)])));
    assert!(message(open(&bytes, 4)).contains("its time 1 is not after the one before"));
}

#[test]
fn joints_carry_a_skin_through_an_animation() {
    let mut built = Built::default();
    built.points();
    let joints = built.add(5121, 4, "VEC4", &[0_u8, 1, 0, 0].repeat(4));
    let weights = built.add(5121, 4, "VEC4", &[0, 255, 0, 0].repeat(4));
    let (times, up) = (built.floats("SCALAR", &[0.0, 0.25]), built.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 3.0, 0.0]));
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"JOINTS_0":{joints},"WEIGHTS_0":{weights}}},"mode":0}}]}}],"nodes":[{{"mesh":0,"skin":0}},{{"children":[2]}},{{}}],"skins":[{{"joints":[1,2]}}]"#
    );
    // The root of the joints moves, and the node of the mesh, which counts for nothing.
    let moving = [
        (r#"{"node":1,"path":"translation"}"#, "LINEAR", times, up),
        (r#"{"node":0,"path":"translation"}"#, "LINEAR", times, up),
    ];
    let bytes = built.file(&format!("{rest},{}", animation(&moving))).clone();
    let fixed = String::from_utf8_lossy(&bytes).contains("normalized\":true");
    assert!(fixed);
    let frames = all(&mut *open(&bytes, 4).unwrap());
    assert_eq!(frames.len(), 2);
    close(&frames[0], &moved(|p| p), 1e-6);
    close(&frames[1], &moved(|[x, y, z]| [x, y + 3.0, z]), 1e-6);
}

#[test]
fn of_several_meshes_all_or_the_chosen_one_are_read() {
    let mut built = Built::default();
    built.points();
    let two = built.floats("VEC3", &[5.0, 0.0, 0.0, 6.0, 0.0, 0.0]);
    let (times, up) = (built.floats("SCALAR", &[0.0, 1.0]), built.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 3.0, 0.0]));
    let rest = format!(
        r#""meshes":[{{"name":"skin","primitives":[{{"attributes":{{"POSITION":0}},"mode":0}}]}},{{"primitives":[{{"attributes":{{"POSITION":{two}}},"mode":0}}]}}],"scenes":[{{"nodes":[0,1]}}],"nodes":[{{"name":"body","mesh":0}},{{"name":"eyes","mesh":1}}]"#
    );
    let bytes =
        built.file(&format!("{rest},{}", animation(&[(r#"{"node":1,"path":"translation"}"#, "LINEAR", times, up)])));
    assert_eq!(open(&bytes, 6).unwrap().frames(), 2);
    let told = message(open(&bytes, 2));
    assert!(told.contains("/body/skin (4 points) and /eyes/mesh_1 (2 points), which together have 6 points"), "{told}");
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.glb");
    fs::write(&path, &bytes).unwrap();
    for prim in ["eyes", "/eyes", "mesh_1", "/eyes/mesh_1"] {
        let selection = FrameSelection { prims: vec![prim.to_owned()], ..FrameSelection::default() };
        let frames = all(&mut *open_selected_frames(&path, 2, &selection).unwrap());
        assert_eq!(frames, [[5.0, 0.0, 0.0, 6.0, 0.0, 0.0], [5.0, 3.0, 0.0, 6.0, 3.0, 0.0]]);
        assert_eq!(read_mesh(&path, &[prim.to_owned()]).unwrap().model.points.len(), 2);
    }
    let still = FrameSelection { prims: vec!["skin".to_owned()], ..FrameSelection::default() };
    assert_eq!(open_selected_frames(&path, 4, &still).unwrap().frames(), 1);
    assert!(message(read_mesh(&path, &["hat".to_owned()])).contains("holds no mesh hat, but /body/skin"));
}

#[test]
fn text_is_read_with_the_files_beside_it() {
    let mut built = Built::default();
    built.points();
    let (times, up) = (built.floats("SCALAR", &[0.0, 1.0]), built.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 3.0, 0.0]));
    let moving = animation(&[(r#"{"node":0,"path":"translation"}"#, "LINEAR", times, up)]);
    let whole = built.file(&format!(r#"{MESH},"nodes":[{{"mesh":0}}],{moving}"#));
    let text =
        String::from_utf8(whole[20..20 + u32::from_le_bytes(*whole[12..].first_chunk().unwrap()) as usize].to_vec());
    let text =
        |uri: &str| text.clone().unwrap().replacen(r#"{"byteLength""#, &format!(r#"{{"uri":"{uri}","byteLength""#), 1);
    let folder = tempdir().unwrap();
    fs::write(folder.path().join("my data.bin"), &built.data).unwrap();
    fs::create_dir(folder.path().join("sub")).unwrap();
    let path = folder.path().join("sub/../a.gltf");
    fs::write(&path, text("./my%20data.bin")).unwrap();
    let frames = all(&mut *open_frames(&path, 4).unwrap());
    assert_eq!(frames, [moved(|p| p), moved(|[x, y, z]| [x, y + 3.0, z])]);
    assert_eq!(read_model(&path).unwrap().points, POINTS);
    for (uri, words) in [
        ("../a.bin", "which is not in its folder"),
        ("/etc/passwd", "which is not in its folder"),
        ("file:a.bin", "which is not in its folder"),
        ("none.bin", "has its data in \"none.bin\", which cannot be read"),
    ] {
        fs::write(&path, text(uri)).unwrap();
        assert!(message(open_frames(&path, 4)).contains(words), "{uri}");
        assert!(message(read_model(&path)).contains(words), "{uri}");
    }
    // What comes without a folder names none.
    let bytes = text("a.bin").into_bytes();
    let opened = open_frames_bytes(CacheFormat::Gltf, &folder.path().join("a.gltf"), &bytes, 4);
    assert!(message(opened).contains("has its data in another file"));
}

#[test]
fn rates_are_told_apart_long_after_the_beginning() {
    for rate in [30.0, 30_000.0 / 1001.0, 24.0, 24_000.0 / 1001.0] {
        let mut built = Built::default();
        built.points();
        let numbered: Vec<f64> = (0..12).map(|k| 30_000.0 + f64::from(k)).collect();
        let times: Vec<f32> = numbered.iter().map(|frame| (frame / rate) as f32).collect();
        let times = built.floats("SCALAR", &times);
        let across = built.floats("VEC3", &(0..36).map(|k| k as f32).collect::<Vec<_>>());
        let moved = animation(&[(r#"{"node":0,"path":"translation"}"#, "LINEAR", times, across)]);
        let bytes = built.file(&format!(r#"{MESH},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],{moved}"#));
        let reader = open(&bytes, 4).unwrap();
        assert_eq!((reader.frame_rate(), numbers(&*reader)), (Some(rate), numbered));
    }
}

#[test]
fn of_several_animations_the_first_or_the_chosen_one_is_read() {
    let mut built = Built::default();
    built.points();
    let times = built.floats("SCALAR", &[0.0, 0.04]);
    let ways = [1.0, 2.0, 3.0].map(|x| built.floats("VEC3", &[0.0, 0.0, 0.0, x, 0.0, 0.0]));
    let one = |name: &str, way: usize| {
        let target = r#"{"sampler":0,"target":{"node":0,"path":"translation"}}"#;
        format!(r#"{{{name}"channels":[{target}],"samplers":[{{"input":{times},"output":{way}}}]}}"#)
    };
    let all_of = [one(r#""name":"walk","#, ways[0]), one(r#""name":"run","#, ways[1]), one("", ways[2])].join(",");
    let nodes = r#""scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}]"#;
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.glb");
    fs::write(&path, built.file(&format!(r#"{MESH},{nodes},"animations":[{all_of}]"#))).unwrap();
    let take = |animation: Option<&str>| {
        let selection = FrameSelection { animation: animation.map(str::to_owned), ..FrameSelection::default() };
        open_selected_frames(&path, 4, &selection)
    };
    for (animation, by) in [(None, 1.0), (Some("walk"), 1.0), (Some("run"), 2.0), (Some("2"), 3.0), (Some("1"), 2.0)] {
        let mut reader = take(animation).unwrap();
        assert_eq!(reader.notes().is_empty(), animation.is_some(), "{:?}", reader.notes());
        close(&all(&mut *reader)[1], &moved(|[x, y, z]| [x + by, y, z]), 1e-6);
    }
    let note = &take(None).unwrap().notes()[0];
    let told = "of its 3 animations walk is read, run and animation 2 left out; choose one with --animation";
    assert!(note.contains(told), "{note}");
    for gone in ["jump", "3"] {
        let error = message(take(Some(gone)));
        let listed =
            format!("holds no animation {gone} that moves the mesh, but walk, run and animation 2; give one of");
        assert!(error.contains(&listed), "{error}");
    }
}

#[test]
fn channels_without_a_node_and_meshes_that_are_switched_off_are_left_out() {
    let mut built = Built::default();
    built.points();
    let times = built.floats("SCALAR", &[0.0, 1.0]);
    let across = built.floats("VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let hidden = r#"{"mesh":0,"children":[2],"extensions":{"KHR_node_visibility":{"visible":false}}}"#;
    let with = |channel: &str| {
        let nodes = format!(r#""scenes":[{{"nodes":[0,1]}}],"nodes":[{{"mesh":0}},{hidden},{{"mesh":0}}]"#);
        let moved = r#"{"sampler":0,"target":{"node":0,"path":"translation"}}"#;
        let sampler = format!(r#"{{"input":{times},"output":{across}}}"#);
        built.file(&format!(
            r#"{MESH},{nodes},"animations":[{{"channels":[{moved},{channel}],"samplers":[{sampler}]}}]"#
        ))
    };
    let pointer = |to: &str| {
        format!(
            r#"{{"sampler":0,"target":{{"path":"pointer","extensions":{{"KHR_animation_pointer":{{"pointer":"{to}"}}}}}}}}"#
        )
    };
    for channel in [r#"{"sampler":0,"target":{"path":"scale"}}"#.to_owned(), pointer("/materials/0/alphaCutoff")] {
        let bytes = with(&channel);
        close(&all(&mut *open(&bytes, 4).unwrap())[1], &moved(|[x, y, z]| [x + 4.0, y, z]), 1e-6);
    }
    let error = message(open(&with(&pointer("/nodes/0/scale")), 4));
    assert!(error.contains("moves nodes by KHR_animation_pointer"), "{error}");
}

#[test]
fn nodes_in_a_circle_and_matrices_that_move_are_refused() {
    let mut built = Built::default();
    built.points();
    let (times, up) = (built.floats("SCALAR", &[0.0, 1.0]), built.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 3.0, 0.0]));
    let moving = animation(&[(r#"{"node":0,"path":"translation"}"#, "LINEAR", times, up)]);
    let of = |nodes: &str| {
        message(open(&built.file(&format!(r#"{MESH},"scenes":[{{"nodes":[0]}}],"nodes":{nodes},{moving}"#)), 4))
    };
    assert!(of(r#"[{"mesh":0,"children":[1]},{"children":[0]}]"#).contains("is reached twice"));
    let matrix = "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1";
    assert!(of(&format!(r#"[{{"mesh":0,"matrix":[{matrix}]}}]"#)).contains("moves node 0, which has a matrix"));
}

/// A grid of 48 points that waves; not to be told by few shapes.
fn waves(frames: usize) -> Vec<Vec<f32>> {
    let at = |t: f64, i: f64, j: f64| {
        let z = 0.3 * (2.0 * i + 3.0 * t).sin() * (j - t).cos();
        [i + 0.2 * (t + j).sin(), z + 0.5 * t, j + 0.1 * (5.0 * t * i).cos()].map(|x| x as f32)
    };
    let grid = || (0..48).map(|k| (f64::from(k / 6), f64::from(k % 6)));
    (0..frames).map(|k| grid().flat_map(|(i, j)| at(0.05 * k as f64, i, j)).collect()).collect()
}

fn strip() -> Polygons {
    let mut faces = polygons(&[&[0, 1, 7, 6]]);
    (1..40).for_each(|k| faces.push(&[k, k + 1, k + 7]));
    faces
}

fn written(
    name: &str,
    frames: &[Vec<f32>],
    faces: &Polygons,
    options: &FrameOptions,
) -> (TempDir, PathBuf, Vec<String>) {
    let folder = tempdir().unwrap();
    let path = folder.path().join(name);
    let mut writer = create_frames(&path, frames[0].len() / 3, frames.len(), faces, options).unwrap();
    frames.iter().for_each(|frame| writer.write_frame(frame).unwrap());
    let notes = writer.notes();
    writer.finish().unwrap();
    (folder, path, notes)
}

fn morphs(morphs: MorphOptions) -> FrameOptions {
    FrameOptions { morphs, ..FrameOptions::default() }
}

/// The largest distance of a point.
fn distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let points = |frames: &[Vec<f64>]| -> Vec<[f64; 3]> { frames.concat().as_chunks().0.to_vec() };
    let squared = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    assert_eq!(a.len(), b.len());
    points(a).iter().zip(&points(b)).map(squared).fold(0.0, f64::max).sqrt()
}

/// The numbers in a note: targets, then the largest and the mean error.
fn told(notes: &[String]) -> [f64; 3] {
    let [.., note] = notes else { panic!("{notes:?}") };
    let words = note.split_once("its ").unwrap().1.split([' ', ',']);
    let found: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
    [found[0], found[1], found[3]]
}

#[test]
fn frames_come_back_as_near_as_is_told() {
    let frames = waves(40);
    let numbered: Vec<f64> = (0..40).map(|k| 1001.0 + f64::from(k)).collect();
    for (floats, targets) in [(false, None), (true, None), (false, Some(3)), (true, Some(3)), (false, Some(1))] {
        let diagonal = Some(10.0);
        let options = FrameOptions {
            fps: 30000.0 / 1001.0,
            numbers: numbered.clone(),
            ..morphs(MorphOptions { targets, floats, diagonal, ..MorphOptions::default() })
        };
        let (_folder, path, notes) = written("my walk.glb", &frames, &strip(), &options);
        let mut reader = open_frames(&path, 48).unwrap();
        assert_eq!((numbers(&*reader), reader.frame_rate()), (numbered.clone(), Some(30000.0 / 1001.0)));
        let read = all(&mut *reader);
        let [count, largest, mean] = told(&notes);
        assert_eq!(count as usize, targets.unwrap_or(39));
        let found = distance(&read, &wide(&frames)) / 10.0;
        assert!((found - largest).abs() <= 0.06 * largest + 2e-8 && mean <= largest, "{found} is told as {largest}");
        if targets.is_none() {
            assert!(found < if floats { 1e-6 } else { 4e-5 }, "{found}");
        }
        let rest = read_model(&path).unwrap();
        close(rest.points.as_flattened(), &read[0], 1e-6);
        let triangles: Vec<u32> = strip().triangulated().concat();
        assert_eq!((rest.faces.indices(), reader.mesh().unwrap().1), (&triangles[..], &rest.faces));
    }
}

#[test]
fn text_and_numbers_are_written_together_or_not_at_all() {
    let frames = waves(40);
    let (folder, path, _) = written("my walk.gltf", &frames, &strip(), &FrameOptions::default());
    let (_binary, binary, _) = written("my walk.glb", &frames, &strip(), &FrameOptions::default());
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(r#""uri":"my%20walk.bin""#), "{text:.400}");
    let [read, wanted] = [&path, &binary].map(|path| all(&mut *open_frames(path, 48).unwrap()));
    assert_eq!(read, wanted);
    let names = || {
        let mut names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names(), ["my walk.bin", "my walk.gltf"]);
    // Of a name that is taken, neither is written; nor of what is dropped.
    fs::remove_file(&path).unwrap();
    let new = || Target::New(path.clone());
    let error = message(create_frames(new(), 48, 1, &strip(), &FrameOptions::default()));
    assert!(error.contains("my walk.bin: is there already"), "{error}");
    fs::remove_file(path.with_extension("bin")).unwrap();
    let mut writer = create_frames(new(), 48, 2, &strip(), &FrameOptions::default()).unwrap();
    writer.write_frame(&frames[0]).unwrap();
    drop(writer);
    assert!(names().is_empty());
}

/// Normals of a file as programs make them: the base and so much of each target, at the times of keys.
fn normals(path: &Path, frames: usize) -> Vec<Vec<[f64; 3]>> {
    let root: Root = gltf::json::deserialize::from_slice(&fs::read(path).unwrap()).unwrap();
    let data = fs::read(path.with_extension("bin")).unwrap();
    let floats = |accessor: usize| {
        let accessor = &root.accessors[accessor];
        let view = &root.buffer_views[accessor.buffer_view.unwrap().value()];
        let start = (view.byte_offset.unwrap_or_default().0 + accessor.byte_offset.unwrap_or_default().0) as usize;
        let width = if accessor.type_ == Checked::Valid(Type::Vec3) { 3 } else { 1 };
        let bytes = data[start..start + 4 * width * accessor.count.0 as usize].as_chunks().0;
        bytes.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect::<Vec<_>>()
    };
    let primitive = &root.meshes[0].primitives[0];
    let base = floats(primitive.attributes[&Checked::Valid(Semantic::Normals)].value());
    let targets: Vec<_> =
        primitive.targets.as_ref().unwrap().iter().map(|target| floats(target.normals.unwrap().value())).collect();
    let weights = floats(root.animations[0].samplers[0].output.value());
    // Programs hold sliders within that, and a normal is of length 1.
    assert!(weights.iter().all(|weight| (0.0..=1.0).contains(weight)), "{weights:?}");
    assert!(base.as_chunks().0.iter().all(|[x, y, z]: &[f64; 3]| (x * x + y * y + z * z - 1.0).abs() < 1e-5));
    let sum = |frame: usize| {
        let mut sum = base.clone();
        for (k, target) in targets.iter().enumerate() {
            let weight = weights[frame * targets.len() + k];
            sum.iter_mut().zip(target).for_each(|(sum, x)| *sum += weight * x);
        }
        sum.as_chunks()
            .0
            .iter()
            .map(|n: &[f64; 3]| n.map(|x| x / n.iter().map(|x| x * x).sum::<f64>().sqrt()))
            .collect()
    };
    (0..frames).map(sum).collect()
}

#[test]
fn normals_turn_with_the_mesh() {
    // A sheet that bends by up to 60 degrees.
    let sheet = |frame: usize| -> Vec<f32> {
        let angle = |i: f64| 1.05 * (0.2 * frame as f64).sin() * i / 5.0;
        let grid = (0..36).map(|k| (f64::from(k / 6), f64::from(k % 6)));
        grid.flat_map(|(i, j)| [i * angle(i).cos(), i * angle(i).sin(), -j].map(|x| x as f32)).collect()
    };
    let mut faces = Polygons::new();
    (0..30).filter(|k| k % 6 < 5).for_each(|k| faces.push(&[k, k + 6, k + 7, k + 1]));
    let frames: Vec<Vec<f32>> = (0..30).map(sheet).collect();
    let options = morphs(MorphOptions { normals: true, ..MorphOptions::default() });
    let (_folder, path, _) = written("a.gltf", &frames, &faces, &options);
    let found = normals(&path, 30);
    for (frame, found) in frames.iter().zip(&found) {
        let at = |k: u32| -> [f64; 3] { std::array::from_fn(|i| f64::from(frame[3 * k as usize + i])) };
        let mut wanted = vec![[0.0; 3]; 36];
        for triangle in faces.triangulated() {
            let [a, b, c] = triangle.map(at);
            let (u, v): ([f64; 3], [f64; 3]) =
                (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
            let area: [f64; 3] =
                std::array::from_fn(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]);
            triangle.iter().for_each(|&k| (0..3).for_each(|i| wanted[k as usize][i] += area[i]));
        }
        for (found, wanted) in found.iter().zip(&wanted) {
            let length = wanted.iter().map(|x| x * x).sum::<f64>().sqrt();
            let cosine = (0..3).map(|k| found[k] * wanted[k]).sum::<f64>() / length;
            assert!(cosine > 0.999, "{} degrees off", cosine.acos().to_degrees());
        }
    }
}

#[test]
fn as_few_targets_are_written_as_hold_the_error() {
    let frames = waves(40);
    let with = |targets, max_error| {
        let options = morphs(MorphOptions { targets, max_error, ..MorphOptions::default() });
        told(&written("a.glb", &frames, &strip(), &options).2)
    };
    let [count, largest, _] = with(None, Some(0.01));
    assert!(count > 1.0 && largest <= 0.01, "{count} targets, {largest}");
    let [_, fewer, _] = with(Some(count as usize - 1), None);
    assert!(fewer > 0.01, "{fewer}");
    let [same, again, _] = with(Some(count as usize), None);
    assert_eq!((same, again), (count, largest));
    let options = morphs(MorphOptions { max_error: Some(1e-9), ..MorphOptions::default() });
    let mut writer = create_frames(tempdir().unwrap().path().join("a.glb"), 48, 40, &strip(), &options).unwrap();
    let last = frames.iter().map(|frame| writer.write_frame(frame)).last().unwrap();
    assert!(message(last).contains("cannot hold --max-error 0.000000001: 39 morph targets are"));
}

#[test]
fn short_and_long_captures_and_clouds_are_written() {
    // One frame is a mesh that stands still; what does not move keeps its times; more frames than coordinates.
    let few: Vec<Vec<f32>> = (0..100).map(|k| vec![0.1 * k as f32, 1.0, -2.0, 0.5, (k as f32).sin(), 7.0]).collect();
    for (frames, faces) in
        [(waves(1), strip()), (vec![waves(1)[0].clone(); 3], Polygons::new()), (few, Polygons::new())]
    {
        let (_folder, path, _) = written("a.glb", &frames, &faces, &FrameOptions::default());
        let read = all(&mut *open_frames(&path, frames[0].len() / 3).unwrap());
        let within = distance(&read, &wide(&frames));
        assert!(within < 4e-4, "{within}");
        assert_eq!(read_model(&path).unwrap().faces.len(), faces.triangulated().len());
    }
}

#[test]
fn times_before_the_start_are_moved_and_told() {
    let options = FrameOptions { numbers: vec![-4.0, -2.0, 1.0], ..FrameOptions::default() };
    let (_folder, path, notes) = written("a.glb", &waves(3), &strip(), &options);
    assert!(notes[0].contains("frame -4 is at 0 s"), "{notes:?}");
    let reader = open_frames(&path, 48).unwrap();
    assert_eq!((numbers(&*reader), reader.frame_rate()), (vec![-4.0, -2.0, 1.0], Some(24.0)));
    let far = FrameOptions { origin: Some([1e7, 0.0, 0.0]), rounding: 1e-6, ..FrameOptions::default() };
    assert!(
        message(create_frames(path.with_file_name("far.glb"), 48, 3, &strip(), &far))
            .contains("holds single precision")
    );
    let near = FrameOptions { origin: Some([1e3, 0.0, 0.0]), rounding: 1e-3, ..FrameOptions::default() };
    let (_folder, path, _) = written("a.glb", &waves(3), &strip(), &near);
    let read = all(&mut *open_frames(&path, 48).unwrap());
    assert!((read[0][0] - 1e3 - f64::from(waves(3)[0][0])).abs() < 1e-3);
}

#[test]
fn a_shot_from_1001_plays_at_once_and_keeps_its_numbers() {
    for (numbered, fps) in [
        (vec![1001.0, 1002.0, 1003.0], 25.0),
        (vec![1001.0, 1002.0, 1003.0], 12.5),
        (vec![1001.0, 1003.0, 1004.0], 12.5),
        (vec![86_400.5, 86_401.5, 86_402.5], 24_000.0 / 1001.0),
    ] {
        for name in ["a.glb", "a.gltf"] {
            let options = FrameOptions { numbers: numbered.clone(), fps, ..FrameOptions::default() };
            let (_folder, path, notes) = written(name, &waves(3), &strip(), &options);
            assert!(notes[0].contains("is at 0 s, where programs begin to play"), "{notes:?}");
            let root = Root::from_slice(&fs::read(&path).unwrap());
            if let Ok(root) = root {
                assert!(root.accessors.iter().any(|accessor| {
                    accessor.min.as_ref().is_some_and(|min| min[0].as_f64() == Some(0.0) && min[1].is_null())
                }));
            }
            let reader = open_frames(&path, 48).unwrap();
            assert_eq!((numbers(&*reader), reader.frame_rate()), (numbered.clone(), Some(fps)));
            // Slow frames are all there is, as the file says.
            assert!(!reader.notes().iter().any(|note| note.contains("--sample-rate 24")), "{:?}", reader.notes());
        }
    }
    let (_folder, _, notes) = written("a.glb", &waves(3), &strip(), &FrameOptions::default());
    assert!(!notes.iter().any(|note| note.contains("is at 0 s")), "{notes:?}");
}

#[test]
fn a_shot_from_frame_1_keeps_its_times() {
    let options = FrameOptions { numbers: vec![1.0, 2.0, 3.0], fps: 25.0, ..FrameOptions::default() };
    let (_folder, path, notes) = written("a.gltf", &waves(3), &strip(), &options);
    assert!(!notes.iter().any(|note| note.contains("is at 0 s")), "{notes:?}");
    let times = [0.04, 0.12].map(|seconds: f32| Some(f64::from(seconds)));
    let root = Root::from_slice(&fs::read(&path).unwrap()).unwrap();
    let of_times = |accessor: &gltf::json::Accessor| {
        let ends = [&accessor.min, &accessor.max].map(|end| end.as_ref().and_then(|end| end[0].as_f64()));
        ends == times && accessor.count.0 == 3
    };
    assert!(root.accessors.iter().any(of_times), "{:?}", root.accessors);
    let reader = open_frames(&path, 48).unwrap();
    assert_eq!((numbers(&*reader), reader.frame_rate()), (options.numbers, Some(25.0)));
}

#[test]
fn keys_that_are_far_apart_are_told_once_with_the_option() {
    let mut built = Built::default();
    built.points();
    let [far, near] = [[0.0, 0.5], [0.0, 0.04]].map(|times| built.floats("SCALAR", &times));
    let turn = built.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.997_564, 0.069_756]);
    let still = built.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let folder = tempdir().unwrap();
    let path = folder.path().join("turn.glb");
    let notes = |way: &str, times: usize, values: usize, rate: Option<f64>| {
        let moved = animation(&[(r#"{"node":0,"path":"rotation"}"#, way, times, values)]);
        let nodes = r#""scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}]"#;
        fs::write(&path, built.file(&format!("{MESH},{nodes},{moved}"))).unwrap();
        let selection = FrameSelection { rate, ..FrameSelection::default() };
        open_selected_frames(&path, 4, &selection).unwrap().notes()
    };
    let told = notes("LINEAR", far, turn, None);
    assert!(told.len() == 1 && told[0].contains("its keys are up to 0.500 s apart, and the 2 frames"), "{told:?}");
    assert!(told[0].contains("--sample-rate 24"), "{told:?}");
    for (way, times, values, rate) in [
        ("LINEAR", far, turn, Some(24.0)),
        ("LINEAR", near, turn, None),
        ("STEP", far, turn, None),
        ("LINEAR", far, still, None),
    ] {
        assert_eq!(notes(way, times, values, rate), [""; 0], "{way} {rate:?}");
    }
}

#[test]
fn captures_that_would_fill_the_memory_are_refused() {
    let refused = |points, frames| {
        let folder = tempdir().unwrap();
        message(create_frames(folder.path().join("a.glb"), points, frames, &Polygons::new(), &FrameOptions::default()))
    };
    assert!(refused(1_000_000, 1000).contains("take fewer of them (--range), or write .usdc or .abc"));
    assert!(refused(3000, 5000).contains("cannot hold 5000 frames of 3000 points"));
    assert!(refused(1, 20_000_000).contains("more than 1024 MB"));
}

/// Reads all that there is; gives whether it was good.
fn try_all(bytes: &[u8]) -> bool {
    let mut reader = match open(bytes, 48) {
        Ok(reader) => reader,
        Err(error) => {
            assert!(error.to_string().starts_with("a.glb: ") && error.to_string().len() < 1500, "{error}");
            return false;
        }
    };
    let mut frame = Vec::new();
    for _ in 0..reader.frames().min(64) {
        match reader.read_next(&mut frame) {
            Ok(more) => assert!(more && frame.len() == 144 && frame.iter().all(|x| x.is_finite())),
            Err(error) => {
                assert!(error.to_string().starts_with("a.glb: "), "{error}");
                return false;
            }
        }
    }
    true
}

#[test]
fn files_that_end_early_or_are_changed_are_errors_at_the_most() {
    let options = morphs(MorphOptions { targets: Some(3), ..MorphOptions::default() });
    let (_folder, path, _) = written("a.glb", &waves(5), &strip(), &options);
    let whole = fs::read(path).unwrap();
    assert!(try_all(&whole));
    assert!((0..64).all(|k| !try_all(&whole[..whole.len() * k / 64])));
    let json = 20..20 + u32::from_le_bytes(*whole[12..].first_chunk().unwrap()) as usize;
    let mut random = support::random(1);
    let mut good = 0;
    for round in 0..1000 {
        let mut bytes = whole.clone();
        for _ in 0..=random() % 4 {
            // Half of the changes are to numbers of the document.
            let at = if round % 2 == 0 { random() % bytes.len() } else { json.start + random() % json.len() };
            let is_digit = bytes[at].is_ascii_digit() && json.contains(&at);
            bytes[at] = if is_digit { b"0189-e"[random() % 6] } else { [0, 0xff, 0x7f, random() as u8][random() % 4] };
        }
        good += usize::from(try_all(&bytes));
    }
    assert!((1..1000).contains(&good), "{good}");
}

#[test]
fn the_validator_and_the_loader_of_three_read_what_is_written() {
    let Ok(folder) = std::env::var("CAGER_GLTF_NODE") else {
        eprintln!("skipped: CAGER_GLTF_NODE is not set; `make gltf` installs the packages and runs this test");
        return;
    };
    let numbered = FrameOptions { fps: 25.0, numbers: vec![3.0, 4.0, 6.0, 9.0], ..FrameOptions::default() };
    let floats = morphs(MorphOptions { floats: true, ..MorphOptions::default() });
    let few = morphs(MorphOptions { targets: Some(5), ..MorphOptions::default() });
    let normals = morphs(MorphOptions { normals: true, ..MorphOptions::default() });
    for (options, count, faces) in [
        (normals.clone(), 30, strip()),
        (normals, 1, strip()),
        (numbered, 4, strip()),
        (floats, 90, strip()),
        (few, 40, strip()),
        (FrameOptions::default(), 1, Polygons::new()),
    ] {
        let (_folder, path, _) = written("a.glb", &waves(count), &faces, &options);
        let mut reader = open_frames(&path, 48).unwrap();
        // All of these begin within the first second, and keep their times.
        let (all_numbers, rate) = (numbers(&*reader), reader.frame_rate().unwrap_or(1.0));
        let seconds = all_numbers.iter().map(|number| (number / rate).to_string());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/gltf.mjs");
        let done = Command::new("node").arg(script).arg(&folder).arg(&path).args(seconds).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = String::from_utf8(done.stdout).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("0 errors, 0 warnings"), "{text:.2000}");
        let read: Vec<Vec<f64>> =
            lines.map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect();
        let apart = distance(&read, &all(&mut *reader));
        assert!(apart < 2e-5, "{count} frames: {apart}");
    }
}
