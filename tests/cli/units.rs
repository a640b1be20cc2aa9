//! Units and axes that files say, on their way through containers.

use crate::refused::refused;
use crate::support::{Dir, ENCODE, Small, as_model, read_frames};
use cager_formats::{FrameOptions, Units, Up, create_frames, open_frames};
use cager_geometry::mesh::Polygons;

const CENTIMETRES: Units = Units::new(Up::Z, 0.01);
const NOTHING: [&str; 3] = ["rest.obj", "cage.obj", "frames.npy"];

/// Writes frames, which are in metres with Y up, as a file that says other units.
fn write(dir: &Dir, name: &str, units: Units, faces: &Polygons, frames: &[Vec<f64>]) {
    let change = Units::METRES.change_to(units);
    let options = FrameOptions { units, ..FrameOptions::default() };
    let mut writer = create_frames(dir.path(name), frames[0].len() / 3, frames.len(), faces, &options).expect("a file");
    for frame in frames {
        let changed = frame.as_chunks().0.iter().flat_map(|&p| change.apply(p)).map(|x| x as f32);
        writer.write_frame(&changed.collect::<Vec<_>>()).expect("a frame");
    }
    writer.finish().expect("a file");
}

/// Writes the small capture, its rest pose and its cage, each as a file that says its units.
fn write_all(dir: &Dir, small: &Small, [rest, cage, walk]: [(&str, Units); 3]) {
    let faces = &small.rest.faces;
    write(dir, rest.0, rest.1, faces, &[small.rest.points.as_flattened().to_vec()]);
    let cage_model = as_model(&small.cage);
    write(dir, cage.0, cage.1, &cage_model.faces, &[cage_model.points.as_flattened().to_vec()]);
    write(dir, walk.0, walk.1, faces, &small.frames);
}

/// What a file says, and how far its frames are from the small capture in metres with Y up.
fn read(dir: &Dir, small: &Small, name: &str) -> (Units, f64) {
    let mut reader = open_frames(dir.path(name), small.rest.points.len()).expect("frames");
    let (units, mut values, mut farthest) = (reader.units(), Vec::new(), 0.0_f64);
    for frame in &small.frames {
        assert!(reader.read_next(&mut values).expect("a frame"));
        units.change_to(Units::METRES).apply_to(values.as_chunks_mut().0);
        farthest = values.iter().zip(frame).fold(farthest, |far, (a, b)| far.max((a - b).abs()));
    }
    (units, farthest)
}

fn encode(dir: &Dir, [rest, cage, frames]: [&str; 3], more: &str) -> String {
    let line = ENCODE.replace("rest.obj", rest).replace("cage.obj", cage).replace("frames.npy", frames);
    dir.cager(&format!("{line} {more}")).succeeds().stderr
}

#[test]
fn units_and_axes_come_back_from_containers() {
    let (dir, small) = Dir::with_capture();
    for name in ["walk.usdc", "walk.usdz", "walk.glb"] {
        let said = [("rest.usdc", CENTIMETRES), ("cage.usdc", Units::METRES), (name, CENTIMETRES)];
        write_all(&dir, &small, said);
        let said = encode(&dir, said.map(|(name, _)| name), "--max-error 1e-5");
        assert!(said.contains("cage.usdc: the cage is scaled by 100 and turned to Z up"), "{said}");
        assert_eq!(said.contains("its frames are scaled by 100 and turned to Z up"), name == "walk.glb", "{said}");
        let shown = dir.cager("inspect out.cager").succeeds().stdout;
        assert!(shown.contains("units     1 is 0.01 m, Z up"), "{shown}");
        let report = dir.cager("inspect out.cager --json").succeeds().stdout;
        let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
        assert_eq!((&report["metres_per_unit"], &report["up"]), (&0.01.into(), &"z".into()));
        for (out, said) in
            [("a.usdc", CENTIMETRES), ("a.usdz", CENTIMETRES), ("a.glb", Units::METRES), ("a.gltf", Units::METRES)]
        {
            dir.cager(&format!("decode out.cager -o {out} --overwrite")).succeeds();
            let (units, off) = read(&dir, &small, out);
            assert_eq!(units, said, "{name} to {out}");
            let size = cager_geometry::mesh::diagonal(&small.rest.points);
            assert!(off < 1e-3 * size, "{name} to {out}: {off} of {size}");
        }
    }
}

#[test]
fn files_that_say_nothing_follow_what_is_told_and_containers_stay_as_they_were() {
    let (dir, small) = Dir::with_capture();
    let said = encode(&dir, NOTHING, "");
    assert!(!said.contains("unit"), "{said}");
    assert!(!dir.cager("inspect out.cager").succeeds().stdout.contains("units "));
    let without = std::fs::read(dir.path("out.cager")).expect("a container").len();
    encode(&dir, NOTHING, "--unit cm");
    assert!(dir.cager("inspect out.cager").succeeds().stdout.contains("units     1 is 0.01 m\n"));
    assert_eq!(std::fs::read(dir.path("out.cager")).expect("a container").len(), without + 89);
    dir.cager("decode out.cager -o a.usdc").succeeds();
    assert_eq!(read(&dir, &small, "a.usdc").0, Units::new(Up::Y, 0.01));
    // Edited cages keep it.
    dir.cager("decode out.cager --cages -o cages.usdc").succeeds();
    dir.cager("edit out.cager --with-cages cages.usdc -o edited.cager").succeeds();
    assert!(dir.cager("inspect edited.cager").succeeds().stdout.contains("units     1 is 0.01 m\n"));
}

#[test]
fn a_rest_pose_a_cage_and_a_capture_are_brought_together() {
    let (dir, small) = Dir::with_capture();
    let said = [("rest.usdc", Units::METRES), ("cage.glb", Units::METRES), ("walk.usdc", CENTIMETRES)];
    write_all(&dir, &small, said);
    let names = said.map(|(name, _)| name);
    let said = encode(&dir, names, "--max-error 1e-5");
    assert!(said.contains("walk.usdc: its frames are scaled by 0.01 and turned to Y up"), "{said}");
    dir.cager("decode out.cager -o a.usdc").succeeds();
    let (units, off) = read(&dir, &small, "a.usdc");
    assert_eq!(units, Units::METRES);
    assert!(off < 1e-4, "{off}");
    // A length needs no --unit where the rest pose says it.
    encode(&dir, names, "--max-error 5mm");
    // The cage of a take in other units is, too.
    let said = [("rest_cm.usdc", CENTIMETRES), ("cage_cm.usdc", CENTIMETRES), ("walk_cm.usdc", CENTIMETRES)];
    write_all(&dir, &small, said);
    let line = "encode --rest rest_cm.usdc --cage out.cager --frames walk_cm.usdc -o cm.cager --max-error 1e-5";
    let said = dir.cager(line).succeeds().stderr;
    assert!(said.contains("out.cager: the cage is scaled by 100 and turned to Z up"), "{said}");
    dir.cager("decode cm.cager -o cm.usdc").succeeds();
    let (units, off) = read(&dir, &small, "cm.usdc");
    assert_eq!(units, CENTIMETRES);
    assert!(off < 1e-4, "{off}");
    // A cage to improve is brought to the rest pose, too; what its rounding changes, the search for a better one makes larger.
    let cage = as_model(&small.cage);
    write(&dir, "cage.usdc", CENTIMETRES, &cage.faces, &[cage.points.as_flattened().to_vec()]);
    let improved = ["cage.glb", "cage.usdc"].map(|start| {
        let line = format!("cage --rest rest.usdc --frames walk.usdc --improve {start} -o improved.obj --overwrite");
        dir.cager(&line).succeeds();
        cager_formats::read_model(&dir.path("improved.obj")).expect("a cage").points
    });
    let pairs = improved[0].as_flattened().iter().zip(improved[1].as_flattened());
    let off = pairs.fold(0.0_f64, |far, (a, b)| far.max((a - b).abs()));
    assert!(off < 0.01, "{off}");
}

#[test]
fn positions_are_turned_and_scaled_where_the_container_knows_its_own() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    let read = |name: &str, rows| read_frames(&dir.path(name), rows);
    refused(
        &dir,
        "decode out.cager --up z -o z.npy",
        &["out.cager", "which axis points up", "say it first: cager edit"],
    );
    refused(&dir, "decode out.cager --unit m --cages -o z.npy", &["out.cager", "what its unit is"]);
    dir.cager("edit out.cager --up y --unit cm -o said.cager").succeeds();
    refused(&dir, "edit said.cager --up z -o other.cager", &["said.cager", "says already", "cager decode"]);
    dir.cager("edit said.cager --up y -o same.cager").succeeds();
    assert_eq!(dir.read("same.cager"), dir.read("said.cager"));

    let near = |found: &[Vec<f64>], own: &[Vec<f64>]| {
        let turned =
            own.iter().flat_map(|frame| frame.as_chunks::<3>().0).map(|[x, y, z]| [x / 100.0, -z / 100.0, y / 100.0]);
        let wanted: Vec<f64> = turned.flatten().collect();
        found.iter().flatten().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-8) && !wanted.is_empty()
    };
    dir.cager("decode said.cager -o own.npy").succeeds();
    for output in ["z.npy", "z.pc2", "folder/"] {
        dir.cager(&format!("decode said.cager --up z --unit m -o {output}")).succeeds();
        assert!(near(&read(output, points), &read("own.npy", points)), "{output}");
    }
    // Alembic has no place for an axis.
    let said = dir.cager("decode said.cager --up z -o z.abc").succeeds().stdout;
    assert!(said.contains("lay the model on its back"), "{said}");
    assert!(!dir.cager("decode said.cager -o y.abc").succeeds().stdout.contains("back"));

    // Cages go out turned and scaled, with the rest cage, and come back.
    let rows = small.cage.vertices.len();
    dir.cager("decode said.cager --cages -o own-cages.npy").succeeds();
    dir.cager("decode said.cager --cages --up z --unit m -o cages.npy").succeeds();
    assert!(near(&read("cages.npy", rows), &read("own-cages.npy", rows)));
    dir.cager("edit said.cager --with-cages cages.npy --up z --unit m -o back.cager").succeeds();
    dir.cager("decode back.cager --cages -o back.npy").succeeds();
    let far = read("back.npy", rows).into_iter().flatten().zip(read("own-cages.npy", rows).into_iter().flatten());
    assert!(far.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-6);
    refused(&dir, "edit out.cager --with-cages cages.npy --up z -o no.cager", &["out.cager", "which axis points up"]);
}
