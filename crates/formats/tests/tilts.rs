//! Normals that lean away from those of the faces around go through files.

mod support;

use std::fs;
use std::path::Path;

use cager_formats::{FrameOptions, create_frames, read_mesh};
use cager_geometry::mesh::{Model, Point, Polygons};
use cager_geometry::surface::{Part, SharedNormals, Surface};
use support::polygons;
use tempfile::tempdir;

/// A sheet of 3 × 3 squares that is bent along x.
fn sheet() -> (Vec<Point>, Polygons) {
    let places = (0..16).map(|k| [(k % 4) as f64, (k / 4) as f64]);
    let points = places.map(|[x, y]| [x, y, 0.25 * x * x]).collect();
    let mut faces = Polygons::new();
    for (i, j) in (0..3).flat_map(|j| (0..3).map(move |i| (i, j))) {
        let at = 4 * j + i;
        faces.push(&[at, at + 1, at + 5, at + 4]);
    }
    (points, faces)
}

/// The normal of each point, where one has another at a corner the last one.
fn by_point(model: &Model, points: &[Point]) -> Vec<Point> {
    let part = &model.surface.parts[0];
    let shared = SharedNormals::of(part, model.faces.clone());
    let normals = shared.at(|point| points[point as usize]);
    let mut found = vec![[0.0; 3]; part.points];
    for (&point, &number) in model.faces.indices().iter().zip(&shared.corners) {
        found[point as usize] = normals[number as usize];
    }
    found
}

fn degrees(a: Point, b: Point) -> f64 {
    let length = |v: Point| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>() / (length(a) * length(b))).clamp(-1.0, 1.0).acos().to_degrees()
}

/// The sheet in a part whose normals lean by these.
fn leaning(lean: Point) -> Model {
    let (points, faces) = sheet();
    let mut part = Part { path: "/sheet".to_owned(), points: 16, faces: 9, ..Part::default() };
    let shared = SharedNormals::new(faces.clone(), &[0; 36]);
    let normals = shared.at(|point| points[point as usize]);
    let corners: Vec<[f32; 3]> = shared
        .corners
        .iter()
        .map(|&number| std::array::from_fn(|k| (normals[number as usize][k] + lean[k]) as f32))
        .collect();
    part.take_normals(&faces, |point| points[point as usize], &corners);
    Model { points, faces, surface: Surface { parts: vec![part], ..Surface::default() }, ..Model::default() }
}

fn write(path: &Path, model: &Model) {
    let options = FrameOptions { surface: model.surface.clone(), ..FrameOptions::default() };
    let mut writer = create_frames(path, model.points.len(), 1, &model.faces, &options).unwrap();
    writer.write_frame(&model.points.as_flattened().iter().map(|&x| x as f32).collect::<Vec<_>>()).unwrap();
    writer.finish().unwrap();
}

#[test]
fn each_format_with_normals_writes_tilted_ones_and_reads_them() {
    let folder = tempdir().unwrap();
    for lean in [[0.5, 0.1, 0.0], [0.0, 0.0, -3.0]] {
        let model = leaning(lean);
        assert!(model.surface.parts[0].tilts.is_some());
        let wanted = by_point(&model, &model.points);
        for name in ["one.obj", "one.usdc", "one.abc", "one.glb"] {
            let path = folder.path().join(name);
            fs::remove_file(&path).unwrap_or_default();
            write(&path, &model);
            let read = read_mesh(&path, &[]).unwrap().model;
            read.surface.check(16, &read.faces).unwrap();
            assert!(read.surface.parts[0].tilts.is_some(), "{name}");
            let found = by_point(&read, &read.points);
            let worst = wanted.iter().zip(&found).map(|(&a, &b)| degrees(a, b)).fold(0.0, f64::max);
            assert!(worst < 0.2, "{name}: {worst}°");
        }
    }
}

#[test]
fn normals_that_follow_from_the_faces_take_nothing() {
    let folder = tempdir().unwrap();
    let model = leaning([0.0; 3]);
    assert_eq!(model.surface.parts[0].tilts, None);
    for name in ["one.obj", "one.usdc", "one.abc", "one.glb"] {
        let path = folder.path().join(name);
        write(&path, &model);
        let read = read_mesh(&path, &[]).unwrap().model;
        assert!(read.surface.parts.iter().all(|part| part.tilts.is_none()), "{name}");
    }
}

/// A scene in which a mesh is shown as a mirror does and twice as large, its faces in either direction.
fn mirrored(is_left_handed: bool) -> String {
    let (points, faces) = sheet();
    let model = leaning([0.5, 0.1, 0.0]);
    let told =
        |list: Vec<Point>| list.iter().map(|[x, y, z]| format!("({x}, {y}, {z})")).collect::<Vec<_>>().join(", ");
    let corners: Vec<String> = faces
        .iter()
        .flat_map(|face| if is_left_handed { face.iter().rev().collect() } else { face.iter().collect::<Vec<_>>() })
        .map(u32::to_string)
        .collect();
    format!(
        r#"#usda 1.0
(
    upAxis = "Y"
)
def Mesh "sheet"
{{
    uniform token orientation = "{}"
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [{}]
    point3f[] points = [{}]
    normal3f[] normals = [{}] (
        interpolation = "vertex"
    )
    double3 xformOp:scale = (-2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}}
"#,
        if is_left_handed { "leftHanded" } else { "rightHanded" },
        corners.join(", "),
        told(points.clone()),
        told(by_point(&model, &points)),
    )
}

#[test]
fn a_mirror_shows_tilted_normals_as_it_shows_points() {
    let folder = tempdir().unwrap();
    let model = leaning([0.5, 0.1, 0.0]);
    let wanted: Vec<Point> = by_point(&model, &model.points).iter().map(|&[x, y, z]| [-x, y, z]).collect();
    for is_left_handed in [false, true] {
        let path = folder.path().join("mirrored.usda");
        fs::write(&path, mirrored(is_left_handed)).unwrap();
        let read = read_mesh(&path, &[]).unwrap().model;
        assert_eq!(read.points[1], [-2.0, 0.0, 0.5]);
        for (a, b) in wanted.iter().zip(by_point(&read, &read.points)) {
            assert!(degrees(*a, b) < 0.1, "{a:?} {b:?}");
        }
    }
}

#[test]
fn lines_of_an_obj_tell_tilted_normals_alone() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("leaning.obj");
    let text = |normal: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n{normal}f 1//1 2//1 4//1 3//1\n");
    fs::write(&path, text("vn 0 0.01 1\n")).unwrap();
    assert!(read_mesh(&path, &[]).unwrap().model.surface.is_empty());
    fs::write(&path, text("vn 0 1 1\n")).unwrap();
    let read = read_mesh(&path, &[]).unwrap().model;
    assert!(by_point(&read, &read.points).iter().all(|&normal| degrees(normal, [0.0, 1.0, 1.0]) < 1e-3));
    // What is no direction tilts nothing.
    for normal in ["vn 0 0 0\n", "vn 0 0 0\nvn 1 0 0\n", "vn 1e-40 0 0\n"] {
        fs::write(&path, text(normal)).unwrap();
        assert!(read_mesh(&path, &[]).unwrap().model.surface.is_empty(), "{normal}");
    }
}

#[test]
fn faces_without_an_area_and_normals_without_a_direction_tilt_nothing() {
    let mut part = Part { points: 5, faces: 2, ..Part::default() };
    let faces = polygons(&[&[0, 0, 0], &[1, 2, 3]]);
    let points = [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0; 3]];
    part.take_normals(&faces, |point| points[point as usize], &[[f32::INFINITY, 1.0, 0.0]; 6]);
    assert_eq!((part.normals.len(), part.tilts), (6, None));
}
