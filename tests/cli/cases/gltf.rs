//! Models in `.glb` files as the specification lets them be written.

use crate::refused::refused;
use crate::support::Dir;

#[test]
fn a_skinned_model_belongs_to_what_viewers_show_of_it() {
    let dir = Dir::with_case("08-skinned-glb-not-where-viewers-show-it");
    let line = "encode --rest rest.glb --cage cage.obj --frames frames.npy -o out.cager --overwrite";
    let done = dir.cager(line).succeeds();
    assert_eq!(done.stderr.matches("warning").count(), 1, "{}", done.stderr);
    assert!(done.stderr.contains("rest.glb: its skin of 1 joint is not kept"), "{}", done.stderr);
    dir.cager("cage --rest rest.glb --vertices 40 -o made.obj").succeeds();
    // As tall as it stands, not as it was bound.
    let y = || {
        String::from_utf8(dir.read("made.obj"))
            .unwrap()
            .lines()
            .filter_map(|l| l.strip_prefix("v ")?.split(' ').nth(1)?.parse().ok())
            .collect::<Vec<f64>>()
    };
    let tall = y().iter().copied().fold(f64::MIN, f64::max) - y().iter().copied().fold(f64::MAX, f64::min);
    assert!((3.0..6.0).contains(&tall), "{tall}");
}

#[test]
fn quantized_sparse_and_embedded_data_are_the_same_model() {
    let dir = Dir::with_case("11-glb-quantized-sparse-data-uri");
    for name in ["quantized", "sparse", "data-uri"] {
        let done = dir
            .cager(&format!("encode --rest {name}.glb --cage cage.obj --frames frames.npy -o {name}.cager"))
            .succeeds();
        assert!(!done.stderr.contains("warning"), "{name}: {}", done.stderr);
    }
    assert!(dir.read("sparse.cager") == dir.read("data-uri.cager"), "both hold the same numbers");
}

#[test]
fn what_is_not_read_is_refused_by_its_name() {
    let dir = Dir::with_case("11-glb-quantized-sparse-data-uri");
    let quantized = dir.read("quantized.glb");
    let name = b"KHR_mesh_quantization";
    let renamed = |to: &[u8]| {
        let mut file = quantized.clone();
        let at = file.windows(name.len()).rposition(|w| w == name).unwrap();
        file[at..at + name.len()].copy_from_slice(&[to, &vec![b'_'; name.len() - to.len()]].concat());
        file
    };
    dir.write("splines.glb", renamed(b"ACME_splines"));
    let line = |file: &str| format!("cage --rest {file} --vertices 40 -o made.obj");
    refused(
        &dir,
        &line("splines.glb"),
        &["splines.glb", "needs the extension \"ACME_splines", "export the mesh without it"],
    );
    // What changes no shape is no reason to refuse a file.
    dir.write("lights.glb", renamed(b"KHR_lights_punctual"));
    dir.cager(&line("lights.glb")).succeeds();
}

#[test]
fn a_second_scene_without_nodes_is_no_reason_to_refuse() {
    let dir = Dir::with_case("22-gltf-second-scene-without-nodes");
    let line = "encode --rest two_scenes.glb --frames two_scenes.glb -o a.cager --report a.json --cage-vertices 20";
    let said = dir.cager(line).succeeds().stderr;
    let report = dir.json("a.json");
    assert_eq!((&report["frames"], &report["points"]), (&2.into(), &82.into()));
    // Two keys a second apart are two frames, which is said with the way to all of the motion.
    assert_eq!(said.matches("--sample-rate 24").count(), 1, "{said}");
    let every = dir.cager(&format!("{line} --overwrite --sample-rate 24")).succeeds().stderr;
    assert!(!every.contains("--sample-rate"), "{every}");
    assert_eq!(dir.json("a.json")["frames"], 25);
}

#[test]
fn instances_of_a_mesh_are_read_as_many_as_there_are() {
    let dir = Dir::with_case("23-gltf-sixty-instances");
    dir.cager("encode --rest chain.glb --frames chain.glb -o a.cager --dry-run").succeeds();
    let made = dir.cager("cage --rest chain.glb --general box -o box.obj").succeeds().stdout;
    assert!(made.contains("encloses every point"), "{made}");
    let rest = cager_formats::read_model(&dir.path("chain.glb")).expect("a chain");
    assert_eq!(rest.points.len(), 21_720);
}

#[test]
fn a_shot_from_1001_begins_at_once_and_comes_back_with_its_numbers() {
    let dir = Dir::with_case("31-glb-of-a-shot-from-1001");
    dir.cager("cage --rest rest.obj --vertices 30 -o cage.obj").succeeds();
    dir.cager("encode --rest rest.obj --frames shot --fps 25 --cage cage.obj -o a.cager").succeeds();
    for name in ["a.glb", "a.gltf"] {
        let said = dir.cager(&format!("decode a.cager -o {name}")).succeeds().stdout;
        assert!(said.contains(&format!("{name}: frame 1001 is at 0 s, where programs begin to play")), "{said}");
        let line =
            format!("encode --rest {name} --frames {name} --cage cage.obj -o b.cager --report b.json --overwrite");
        let said = dir.cager(&line).succeeds().stderr;
        let report = dir.json("b.json");
        let wanted: Vec<f64> = (1001..1007).map(f64::from).collect();
        assert_eq!((&report["frame_numbers"], &report["frame_rate"]), (&wanted.into(), &25.0.into()), "{said}");
    }
    // As it was asked for.
    let said = dir.cager("decode a.cager -o b.glb --start 0").succeeds().stdout;
    assert!(!said.contains("is at 0 s"), "{said}");
}
