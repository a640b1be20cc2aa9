//! Models in `.glb` files as the specification lets them be written.

use crate::refused::refused;
use crate::support::Dir;

#[test]
fn a_skinned_model_belongs_to_what_viewers_show_of_it() {
    let dir = Dir::with_case("08-skinned-glb-not-where-viewers-show-it");
    let line = "encode --rest rest.glb --cage cage.obj --frames frames.npy -o out.cager --overwrite";
    let done = dir.cager(line).succeeds();
    assert!(!done.stderr.contains("warning"), "{}", done.stderr);
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
