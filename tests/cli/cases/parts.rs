//! Captures of several parts: which are read, shown and written, and their pictures.

use crate::support::Dir;
use cager_formats::{FrameSelection, open_frames, open_selected_frames, read_mesh};
use cager_geometry::mesh::Model;
use std::fmt::Write;

const PICTURE: &[u8] = b"\x89PNG\r\n\x1a\n of one texel";

/// Two boxes as objects of an `.obj` file, the second one only where it is there, moved by `shift`.
fn boxes(shift: f64, has_hat: bool) -> String {
    let mut text = "mtllib cast.mtl\n".to_owned();
    let mut points = 0;
    for (name, center, half) in [("body", [shift, 0.0, 0.0], 1.0), ("hat", [shift, 1.6, 0.3 * shift], 0.5)] {
        if name == "hat" && !has_hat {
            break;
        }
        writeln!(text, "o {name}").expect("memory");
        for corner in 0..8 {
            let of = |axis: usize| center[axis] + half * f64::from(2 * (corner >> axis & 1) - 1);
            writeln!(text, "v {} {} {}", of(0), of(1), of(2)).expect("memory");
            writeln!(text, "vt {} {}", corner & 1, f64::from(corner) / 8.0).expect("memory");
        }
        writeln!(text, "usemtl {}", if name == "hat" { "felt" } else { "skin" }).expect("memory");
        for face in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
            let corners: Vec<String> = face.iter().map(|k| format!("{0}/{0}", k + points)).collect();
            writeln!(text, "f {}", corners.join(" ")).expect("memory");
        }
        points += 8;
    }
    text
}

/// Four frames, of which the second and the third lack the hat, encoded with its pictures.
fn encoded() -> Dir {
    let dir = Dir::new();
    dir.write("cast.obj", boxes(0.0, true));
    dir.write("cast.mtl", "newmtl skin\nmap_Kd maps/skin.png\nnewmtl felt\nKd 0.1 0.2 0.3\nmap_Kd maps/felt.png\n");
    ["maps/skin.png", "maps/felt.png"].iter().for_each(|name| dir.write(name, PICTURE));
    for (k, has_hat) in [true, false, false, true].into_iter().enumerate() {
        dir.write(&format!("take/f.{k}.obj"), boxes(0.1 * k as f64, has_hat));
        dir.write("take/cast.mtl", "newmtl skin\nnewmtl felt\n");
    }
    let line =
        "encode --rest cast.obj --frames take --cage-vertices 30 --max-error 0.001 -o cast.cager --textures embed";
    dir.cager(line).succeeds();
    dir
}

fn model(dir: &Dir, name: &str) -> Model {
    read_mesh(&dir.path(name), &[]).expect(name).model
}

#[test]
fn a_part_that_some_frames_lack_is_hidden_in_them() {
    let dir = encoded();
    let said = dir.cager("inspect cast.cager").succeeds().stdout;
    assert!(said.contains("/body: 8 points from 0, 6 faces") && said.contains("/hat: 8 points from 8"), "{said}");
    assert_eq!(said.matches("hidden in some frames").count(), 1, "{said}");
    for name in ["cast.usdc", "cast.abc", "cast.glb"] {
        dir.cager(&format!("decode cast.cager -o {name}")).succeeds();
        let rest = model(&dir, name);
        assert_eq!(rest.surface.parts.len(), 2, "{name}");
        let reader = open_frames(dir.path(name), rest.points.len()).expect(name);
        assert_eq!(reader.shown(), [None, Some(vec![0..1, 3..4])], "{name}");
        // Of the frames that are written.
        let only = 1..2;
        dir.cager(&format!("decode cast.cager --range 2-3 -o {name} --overwrite")).succeeds();
        let reader = open_frames(dir.path(name), rest.points.len()).expect(name);
        assert_eq!(reader.shown(), [None, Some(Vec::from([only.clone()]))], "{name}");
    }
}

#[test]
fn parts_come_back_alone_by_name_or_glob() {
    let dir = encoded();
    dir.cager("decode cast.cager --part hat -o hat.usdc").succeeds();
    let hat = model(&dir, "hat.usdc");
    assert_eq!((hat.points.len(), hat.surface.parts.len(), hat.surface.parts[0].path.as_str()), (8, 1, "/hat/hat"));
    assert_eq!(hat.surface.parts[0].uv_sets[0].corners.len(), 24);
    // With what it has alone.
    let names: Vec<&str> = hat.surface.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!((names, hat.surface.materials[0].base_color), (vec!["felt"], [0.1, 0.2, 0.3]));
    assert!(dir.path("hat_textures/felt.png").exists() && !dir.path("hat_textures/skin.png").exists());
    dir.cager("decode cast.cager --part *y -o body.npy").succeeds();
    let mut reader = open_frames(dir.path("body.npy"), 8).expect("the points of the body");
    let mut frame = Vec::new();
    reader.read_next(&mut frame).expect("a frame");
    assert!((frame[0] + 1.0).abs() < 0.01, "{frame:?}");
    let refused = dir.cager("decode cast.cager --part hair -o hair.usdc").run();
    assert_eq!(refused.status, Some(1));
    let said = refused.stderr;
    assert!(said.contains("has no part hair, but body and hat; give one of these with --part"), "{said}");
    assert!(!dir.path("hair.usdc").exists());
}

#[test]
fn meshes_of_a_scene_are_chosen_by_globs_and_taken_together_otherwise() {
    let dir = encoded();
    dir.cager("decode cast.cager -o cast.abc").succeeds();
    let prims = |words: &[&str]| FrameSelection {
        prims: words.iter().map(|&word| word.to_owned()).collect(),
        ..FrameSelection::default()
    };
    let points =
        |words: &[&str]| read_mesh(&dir.path("cast.abc"), &prims(words).prims).map(|read| read.model.points.len());
    assert_eq!(
        [points(&[]), points(&["**/h*"]), points(&["hat", "body"])].map(|found| found.expect("meshes")),
        [16, 8, 16]
    );
    assert!(points(&["/x*"]).unwrap_err().to_string().contains("holds no mesh /x*, but "));
    let open = |words: &[&str], points| open_selected_frames(dir.path("cast.abc"), points, &prims(words));
    assert_eq!(open(&["hat"], 8).expect("frames").points(), 8);
    // Both have eight points, so that these do not tell which is meant.
    let said = open(&[], 8).err().expect("a choice").to_string();
    assert!(
        said.contains("holds 2 meshes, ") && said.contains("which together have 16 points, and 8 are expected"),
        "{said}"
    );
}

#[test]
fn pictures_that_were_taken_in_are_put_beside_what_is_decoded() {
    let dir = encoded();
    let told: serde_json::Value =
        serde_json::from_str(&dir.cager("inspect cast.cager --json").succeeds().stdout).expect("JSON");
    let sections = told["sections"].as_array().expect("sections");
    let pictures = sections.iter().find(|section| section["tag"] == "pict").expect("pictures");
    let stored = pictures["bytes"].as_u64().expect("bytes");
    assert!(stored < 2 * PICTURE.len() as u64 + 200, "equal pictures are there once: {stored}");
    for (output, folder) in
        [("out/cast.usdc", "out/cast_textures"), ("out/cast.gltf", "out/cast_textures"), ("folder/", "folder_textures")]
    {
        dir.write("out/there.txt", "");
        dir.cager(&format!("decode cast.cager -o {output} --overwrite")).succeeds();
        assert_eq!(dir.read(&format!("{folder}/skin.png")), PICTURE, "{output}");
        // Both materials have the one file.
        assert_eq!(std::fs::read_dir(dir.path(folder)).expect("a folder").count(), 1, "{output}");
    }
    let there = model(&dir, "out/cast.usdc").surface;
    let path = &there.materials.iter().find(|material| material.name == "felt").expect("felt").textures[0].path;
    assert_eq!(path.trim_start_matches("./"), "cast_textures/skin.png");
    // Another file of that name stays, and so does what is decoded.
    dir.write("new_textures/skin.png", "mine");
    let refused = dir.cager("decode cast.cager -o new.usdc").run();
    assert!(refused.status == Some(1) && refused.stderr.contains("skin.png"), "{}", refused.stderr);
    assert!(!dir.path("new.usdc").exists());
    // Without the bytes they stay the names that they were.
    dir.write("maps/felt.png", "");
    std::fs::remove_file(dir.path("maps/skin.png")).expect("a file");
    let line = "encode --rest cast.obj --frames take --cage-vertices 30 --max-error 0.001 -o cast.cager --overwrite";
    let said = dir.cager(&format!("{line} --textures embed")).succeeds().stderr;
    assert!(said.contains("skin.png that its materials name is not taken in"), "{said}");
    dir.cager(line).succeeds();
    dir.cager("decode cast.cager -o plain.usdc").succeeds();
    assert!(!dir.path("plain_textures").exists());
}

#[test]
fn a_layer_on_top_of_the_source_moves_its_meshes() {
    let dir = encoded();
    dir.cager("decode cast.cager -o hero.usdc").succeeds();
    let line = "encode --rest hero.usdc --frames hero.usdc --cage-vertices 30 --max-error 0.001 -o hero.cager";
    dir.cager(line).succeeds();
    dir.cager("decode hero.cager --onto hero.usdc -o walk.usdc").succeeds();
    dir.cager("decode hero.cager -o walk.npy").succeeds();
    let (layer, plain) = (open_frames(dir.path("walk.usdc"), 16), open_frames(dir.path("walk.npy"), 16));
    let (mut layer, mut plain) = (layer.expect("a layer"), plain.expect("frames"));
    let (mut moved, mut expected) = (Vec::new(), Vec::new());
    for _ in 0..4 {
        assert!(layer.read_next(&mut moved).expect("a frame") && plain.read_next(&mut expected).expect("a frame"));
        assert!(moved.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{moved:?} {expected:?}");
    }
    // What is not moved stays as it is in the source.
    let surface = model(&dir, "walk.usdc").surface;
    assert_eq!((surface.parts[1].path.as_str(), surface.materials.len()), ("/hero/hat", 2));
    dir.cager("decode hero.cager --part hat -o hat.usdc").succeeds();
    let refused = dir.cager("decode hero.cager --onto hat.usdc -o no.usdc").run();
    assert!(
        refused.status == Some(1) && refused.stderr.contains("hat.usdc: has no mesh /hero/body"),
        "{}",
        refused.stderr
    );
    let refused = dir.cager("decode hero.cager --onto hero.usdc -o no.abc").run();
    assert!(refused.status == Some(1) && refused.stderr.contains("end the name in .usdc"), "{}", refused.stderr);
}

#[test]
fn edited_cages_keep_parts_and_pictures_and_damage_is_said() {
    let dir = encoded();
    dir.cager("decode cast.cager --cages -o cages.npy").succeeds();
    dir.cager("edit cast.cager --with-cages cages.npy --flatten -o edited.cager").succeeds();
    let said = dir.cager("inspect edited.cager").succeeds().stdout;
    assert!(said.contains("/hat: 8 points from 8") && said.contains("pict"), "{said}");
    // An intact file loses nothing where what can be is taken out of it.
    dir.cager("decode cast.cager --salvage -o saved.usdc").succeeds();
    assert_eq!(dir.read("saved_textures/skin.png"), PICTURE);
    let bytes = dir.read("cast.cager");
    let at = bytes.windows(4).position(|tag| tag == b"surf").expect("the section");
    let mut damaged = bytes.clone();
    damaged[at + 60] ^= 0xff;
    dir.write("damaged.cager", damaged);
    let said = dir.cager("decode damaged.cager --salvage -o damaged.npy").succeeds();
    let said = said.stdout + &said.stderr;
    assert!(said.contains("what lies on their faces, are damaged and left out"), "{said}");
}

#[test]
fn files_that_are_no_pictures_are_not_taken_in() {
    let dir = encoded();
    dir.write("maps/skin.png", "root:x:0:0");
    let line =
        "encode --rest cast.obj --frames take --cage-vertices 30 --max-error 0.001 -o again.cager --textures embed";
    let said = dir.cager(line).succeeds().stderr;
    assert!(
        said.contains("skin.png that its materials name is not taken in (it is no picture that is known)"),
        "{said}"
    );
}

#[test]
fn pictures_that_nobody_asks_for_are_left_out_of_motions_that_are_made() {
    let dir = encoded();
    dir.cager("decode cast.cager -o cast.usdz").succeeds();
    (0..3).for_each(|k| dir.write(&format!("whole/f.{k}.obj"), boxes(0.1 * f64::from(k), true)));
    let lines = [
        "transfer --source cast.cager --target cast.usdz --align none -o made.cager",
        "recover --template cast.usdz --frames whole -o made.cager",
    ];
    for line in lines {
        let said = dir.cager(&format!("{line} --overwrite")).succeeds();
        assert!(said.stderr.contains("cast.usdz: the pictures in it are left out"), "{line}: {}", said.stderr);
        let inside = dir.cager("inspect made.cager").succeeds().stdout;
        assert!(inside.contains("surf") && !inside.contains("pict"), "{line}: {inside}");
    }
}
