//! What lies on faces goes into Alembic archives as the library of Alembic reads it.

use std::path::Path;
use std::process::Command;

use cager_formats::{FrameOptions, create_frames};
use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{
    Channel, CornerSet, Crease, FaceGroup, Material, NO_MATERIAL, Part, Subdivision, Surface, Texture,
};
use tempfile::tempdir;

/// A roof of two quads that meet at a ridge, a flag below it that is hidden in the first and the last of three frames,
/// and a triangle without a path.
fn scene() -> (Surface, Polygons, Vec<Vec<f32>>) {
    let mut faces = Polygons::new();
    for face in [&[0, 1, 2, 3][..], &[3, 2, 4, 5], &[6, 7, 8], &[9, 10, 11]] {
        faces.push(face);
    }
    let set = |name: &str, values: Vec<[f32; 2]>, corners: &[u32]| CornerSet {
        name: name.to_owned(),
        values,
        corners: corners.to_vec(),
    };
    let roof = Part {
        path: "/house/top/roof/roof_mesh".to_owned(),
        points: 6,
        faces: 2,
        uv_sets: vec![
            set("UV;Map", vec![[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]], &[0, 1, 2, 3, 0, 1, 2, 3]),
            set("light", vec![[0.25, 0.75], [0.5, 0.125]], &[0, 0, 0, 0, 1, 1, 1, 0]),
        ],
        color_sets: vec![CornerSet {
            name: "light".to_owned(),
            values: vec![[1.0, 0.0, 0.0, 1.0], [0.0, 0.5, 0.0, 0.25]],
            corners: vec![0, 0, 0, 0, 1, 1, 1, 0],
        }],
        normals: vec![0, 0, 0, 0, 1, 1, 1, 1],
        materials: vec![1, 0],
        groups: vec![FaceGroup { name: "tiles".to_owned(), faces: vec![0, 1] }],
        ..Part::default()
    };
    let flag = Part {
        path: "/house/top/roof/flag".to_owned(),
        points: 3,
        faces: 1,
        subdivision: Subdivision::CatmullClark,
        creases: vec![Crease { edge: [0, 2], sharpness: 2.5 }, Crease { edge: [1, 2], sharpness: 10.0 }],
        materials: vec![NO_MATERIAL],
        shown: Some(vec![1..2]),
        ..Part::default()
    };
    let bare =
        Part { shown: Some(vec![0..1, 2..3]), points: 3, faces: 1, subdivision: Subdivision::Loop, ..Part::default() };
    let named = |name: &str| Material { name: name.to_owned(), ..Material::default() };
    let picture = Texture { channel: Channel::BaseColor, path: "tiles.png".to_owned() };
    let materials = vec![named("glass"), Material { textures: vec![picture], ..named("tiles") }];
    let rest = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
        [1.0, 2.0, 0.0],
        [0.0, 2.0, 0.0],
        [5.0, 0.0, 0.0],
        [6.0, 0.0, 0.0],
        [5.0, 1.0, 0.0],
        [8.0, 0.0, 0.0],
        [9.0, 0.0, 0.0],
        [8.0, 1.0, 0.0_f32],
    ];
    // The roof is turned over by and by.
    let frames = [1.0, 0.0, -1.0].map(|lift| rest.iter().flat_map(|&[x, y, z]| [x, y, z * lift]).collect());
    (Surface { parts: vec![roof, flag, bare], materials }, faces, frames.to_vec())
}

const READ: &str = "\
/house/top/roof/roof_mesh IPolyMesh
faces 4 4 : 3 2 1 0 5 4 2 3
uv UV_Map kFacevaryingScope 0 0.5 1 0.5 1 0 0 0 0 0.5 1 0.5 1 0 0 0
normals kFacevaryingScope 0 -0.707 0.707 0 -0.707 0.707 0 -0.707 0.707 0 -0.707 0.707 0 0.707 0.707 0 0.707 0.707 0 0.707 0.707 0 0.707 0.707
normals kFacevaryingScope 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1
normals kFacevaryingScope 0 0.707 0.707 0 0.707 0.707 0 0.707 0.707 0 0.707 0.707 0 -0.707 0.707 0 -0.707 0.707 0 -0.707 0.707 0 -0.707 0.707
other IV2fGeomParam light kFacevaryingScope 0.25 0.75 0.25 0.75 0.25 0.75 0.25 0.75 0.25 0.75 0.5 0.125 0.5 0.125 0.5 0.125
other IC4fGeomParam light_1 kFacevaryingScope 1 0 0 1 1 0 0 1 1 0 0 1 1 0 0 1 1 0 0 1 0 0.5 0 0.25 0 0.5 0 0.25 0 0.5 0 0.25
set glass kFaceSetExclusive 1
set tiles kFaceSetExclusive 0
set tiles_1 kFaceSetNonExclusive 0 1
/house/top/roof/flag shown 0 1 0
/house/top/roof/flag ISubD
faces 3 : 2 1 0
creases catmull-clark 0 2 1 2 : 2 2 : 2.5 10
/house_fire shown 1 0 1
/house_fire/house_fireShape ISubD
faces 3 : 2 1 0
creases loop : :
";

/// `make alembic` installs it.
#[test]
fn the_library_of_alembic_reads_what_lies_on_the_faces() {
    let (surface, faces, frames) = scene();
    let folder = tempdir().unwrap();
    let path = folder.path().join("house fire.abc");
    let options = FrameOptions { surface, ..FrameOptions::default() };
    let mut writer = create_frames(&path, 12, 3, &faces, &options).unwrap();
    frames.iter().for_each(|frame| writer.write_frame(frame).unwrap());
    let note = format!("{}: has no place for the values and pictures of 1 material of the model", path.display());
    assert_eq!(writer.notes(), [note]);
    writer.finish().unwrap();
    let python = std::env::var("CAGER_ALEMBIC_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found = Command::new(&python).args(["-c", "import imath, alembic3d"]).output();
    if !found.is_ok_and(|found| found.status.success()) {
        eprintln!("skipped: {python} has no alembic3d; `make alembic` installs it and runs this test");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/read_alembic_surface.py");
    let done = Command::new(&python).arg(script).arg(&path).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let text = String::from_utf8(done.stdout).unwrap();
    for (found, expected) in text.lines().zip(READ.lines()) {
        assert_eq!(found.trim(), expected);
    }
    assert_eq!(text.lines().count(), READ.lines().count());
}
