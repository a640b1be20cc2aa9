//! Sequences of pictures: one for each frame, as scans have them.

use crate::support::Dir;
use cager_formats::{open_frames, read_mesh};
use cager_geometry::surface::{Channel, Texture};
use std::fmt::Write;
use std::fs;

const ENCODE: &str = "encode --cage-vertices 30 --max-error 0.001 --overwrite";
const FRAMES: usize = 4;

/// The picture of a frame: those of the second and the third are equal.
fn picture(frame: usize) -> Vec<u8> {
    [&b"\x89PNG\r\n\x1a\n"[..], if frame == 2 { &b"1"[..] } else { &b"0123"[frame..=frame] }].concat()
}

/// A folder of `.obj` files, each with its own materials and pictures.
fn scans() -> Dir {
    let dir = Dir::new();
    for frame in 0..FRAMES {
        let mut text = format!("mtllib scan.{frame}.mtl\no body\nusemtl skin\n");
        for corner in 0..8 {
            let at = |axis: usize| f64::from(corner >> axis & 1) + if axis == 0 { 0.1 * frame as f64 } else { 0.0 };
            writeln!(text, "v {} {} {}\nvt {} {}", at(0), at(1), at(2), corner & 1, f64::from(corner) / 8.0)
                .expect("memory");
        }
        for face in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
            let corners: String = face.iter().map(|k| format!(" {k}/{k}")).collect();
            writeln!(text, "f{corners}").expect("memory");
        }
        dir.write(&format!("scans/scan.{frame}.obj"), text);
        dir.write(
            &format!("scans/scan.{frame}.mtl"),
            format!("newmtl skin\nmap_Kd maps/{frame}.png\nmap_Pr rough.png\n"),
        );
        dir.write(&format!("scans/maps/{frame}.png"), picture(frame));
    }
    dir.write("scans/rough.png", picture(0));
    dir
}

/// The pictures of the base colour by frame that a file of USD names.
fn named_by(dir: &Dir, file: &str) -> Vec<Vec<u8>> {
    let reader = open_frames(dir.path(file), 8).expect(file);
    let found = reader.pictures();
    assert_eq!((found.len(), found[0].material.as_str(), found[0].channel), (1, "skin", Channel::BaseColor), "{file}");
    found[0].paths.iter().map(|path| fs::read(path).expect(path)).collect()
}

fn all() -> Vec<Vec<u8>> {
    (0..FRAMES).map(picture).collect()
}

#[test]
fn pictures_of_scans_come_in_and_out_frame_by_frame() {
    let dir = scans();
    // From a rest pose in another folder, and another name of its own.
    dir.write("rest.obj", dir.read("scans/scan.0.obj"));
    dir.write("scan.0.mtl", "newmtl skin\nmap_Kd rest.png\nmap_Pr scans/rough.png\n");
    dir.cager(&format!("{ENCODE} --rest rest.obj --frames scans -o scans.cager --textures embed")).succeeds();
    fs::rename(dir.path("scans"), dir.path("gone")).expect("a folder");

    dir.cager("decode scans.cager -o walk.usdc").succeeds();
    assert_eq!(named_by(&dir, "walk.usdc"), all());
    // The three that differ; that of the roughness is one of them.
    assert_eq!(fs::read_dir(dir.path("walk_textures")).expect("a folder").count(), 3);

    // And again from USD, whose rest pose has the first one.
    dir.cager(&format!("{ENCODE} --rest walk.usdc --frames walk.usdc -o again.cager --textures embed")).succeeds();
    dir.cager("decode again.cager --range 1-3 -o part.usdc").succeeds();
    assert_eq!(named_by(&dir, "part.usdc"), all()[1..]);
    dir.cager(&format!("{ENCODE} --rest walk.usdc --frames walk.usdc --frames-range 0-3x3 -o few.cager")).succeeds();
    dir.cager("decode few.cager -o few.usdc").succeeds();
    // References, of which the files are where they were; a picture stays until the next one.
    assert_eq!(named_by(&dir, "few.usdc"), [0, 0, 0, 3].map(picture));

    // Packages have them inside.
    dir.cager("decode again.cager -o walk.usdz").succeeds();
    let packed = open_frames(dir.path("walk.usdz"), 8).expect("a package").pictures();
    assert_eq!(packed[0].paths.len(), FRAMES);
    assert_eq!(packed[0].paths[1], packed[0].paths[2]);
    dir.cager(&format!("{ENCODE} --rest walk.usdz --frames walk.usdz -o packed.cager --textures embed")).succeeds();
    dir.cager("decode packed.cager -o unpacked.usdc").succeeds();
    assert_eq!(named_by(&dir, "unpacked.usdc"), all());

    // Folders of .obj have a file of materials for each frame.
    dir.cager("decode again.cager -o take/").succeeds();
    for frame in 0..FRAMES {
        let read = read_mesh(&dir.path(&format!("take/frame_{frame:04}.obj")), &[]).expect("a frame").model;
        let path = &read.surface.materials[0].textures[0].path;
        assert_eq!(fs::read(dir.path("take").join(path)).expect(path), picture(frame));
    }
    dir.cager("decode again.cager -o take/ --overwrite").succeeds();
    // An output of one file of materials takes their place, and the other way round.
    dir.cager("decode again.cager -o plain.npy").succeeds();
    dir.cager(&format!("{ENCODE} --rest walk.usdc --frames plain.npy -o still.cager")).succeeds();
    dir.cager("decode again.cager -o take/ --overwrite").succeeds();
    dir.cager("decode still.cager -o take/ --overwrite").succeeds();
    dir.cager("decode again.cager -o take/ --overwrite").succeeds();

    // Others have the first one, and say so.
    for name in ["walk.glb", "ply/*.ply"] {
        let said = dir.cager(&format!("decode again.cager -o {name}")).succeeds();
        let said = said.stdout + &said.stderr;
        assert!(said.contains("the pictures of frames after the first"), "{name}: {said}");
    }
}

#[test]
fn one_frame_has_its_own_picture_and_one_file_of_materials_has_one() {
    let dir = scans();
    dir.cager(&format!("{ENCODE} --rest scans/scan.0.obj --frames scans -o scans.cager --textures embed")).succeeds();
    dir.cager("decode scans.cager --frame 3 -o last.obj").succeeds();
    let textures =
        |name: &str| read_mesh(&dir.path(name), &[]).expect(name).model.surface.materials[0].textures.clone();
    assert_eq!(textures("last.obj")[0], Texture::new(Channel::BaseColor, "last_textures/3.png"));
    assert_eq!(fs::read_dir(dir.path("last_textures")).expect("a folder").count(), 2);
    // Where all files name one file of materials there is no sequence.
    for frame in 0..FRAMES {
        let name = format!("scans/scan.{frame}.obj");
        let text = String::from_utf8(dir.read(&name)).expect("text");
        dir.write(&name, text.replace(&format!("scan.{frame}.mtl"), "scan.0.mtl"));
    }
    assert!(open_frames(dir.path("scans"), 8).expect("frames").pictures().is_empty());
}

/// Two boxes, each with a material `skin` of its own, of which one has another picture in each frame.
fn two_skins(moving_first: bool) -> String {
    let mut text = "#usda 1.0\n(\nstartTimeCode = 0\nendTimeCode = 3\n)\n".to_owned();
    for (place, name) in ["one", "two"].into_iter().enumerate() {
        let file = match (place == 0) == moving_first {
            true => "asset inputs:file.timeSamples = { 0: @0.png@, 1: @1.png@, 2: @2.png@, 3: @3.png@ }",
            false => "asset inputs:file = @still.png@",
        };
        let frame = |frame: usize| {
            let points: Vec<String> = (0..8)
                .map(|corner| {
                    let at = |axis: usize| f64::from(corner >> axis & 1);
                    format!("({}, {}, {})", at(0) + 3.0 * place as f64 + 0.1 * frame as f64, at(1), at(2))
                })
                .collect();
            format!("{frame}: [{}]", points.join(", "))
        };
        let frames: Vec<String> = (0..FRAMES).map(frame).collect();
        write!(
            text,
            "def Xform \"{name}\"\n{{\n\
             def Mesh \"m\" (\nprepend apiSchemas = [\"MaterialBindingAPI\"]\n)\n{{\n\
             int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]\n\
             int[] faceVertexIndices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]\n\
             rel material:binding = </{name}/skin>\npoint3f[] points.timeSamples = {{ {} }}\n}}\n\
             def Material \"skin\"\n{{\ntoken outputs:surface.connect = </{name}/skin/surface.outputs:surface>\n\
             def Shader \"surface\"\n{{\nuniform token info:id = \"UsdPreviewSurface\"\n\
             color3f inputs:diffuseColor.connect = </{name}/skin/map.outputs:rgb>\ntoken outputs:surface\n}}\n\
             def Shader \"map\"\n{{\nuniform token info:id = \"UsdUVTexture\"\n{file}\nfloat3 outputs:rgb\n}}\n}}\n}}\n",
            frames.join(", "),
        )
        .expect("memory");
    }
    text
}

#[test]
fn of_materials_of_one_name_each_has_its_own_pictures() {
    let dir = Dir::new();
    for (moving_first, moving) in [(true, "/one/m"), (false, "/two/m")] {
        dir.write("shot.usda", two_skins(moving_first));
        let encode = format!("{ENCODE} --rest shot.usda --frames shot.usda -o shot.cager");
        let said = dir.cager(&encode).succeeds().stderr;
        assert!(!said.contains("left out"), "{said}");
        dir.cager("decode shot.cager -o out.usdc --overwrite").succeeds();
        let found = open_frames(dir.path("out.usdc"), 16).expect("frames").pictures();
        assert_eq!((found.len(), found[0].paths.len()), (1, FRAMES));
        let surface = read_mesh(&dir.path("out.usdc"), &[]).expect("a model").model.surface;
        for part in &surface.parts {
            let [texture] = &surface.materials[part.materials[0] as usize].textures[..] else { panic!("{surface:?}") };
            let moves = part.path.ends_with(moving);
            let name = if moves { "0.png" } else { "still.png" };
            assert!(texture.path.ends_with(name), "{}: {}", part.path, texture.path);
            assert_eq!(moves, found[0].place == Some(part.materials[0] as usize), "{}", part.path);
        }
    }
}

#[test]
fn pictures_by_frame_that_the_rest_pose_has_no_place_for_are_told() {
    let dir = scans();
    dir.write("rest.obj", dir.read("scans/scan.0.obj"));
    dir.write("scan.0.mtl", "newmtl skin\nmap_Pr scans/rough.png\n");
    let said = dir.cager(&format!("{ENCODE} --rest rest.obj --frames scans -o scans.cager")).succeeds().stderr;
    let told = "the base_color pictures by frame of the material \"skin\" are left out";
    assert!(said.contains(told), "{said}");
}
