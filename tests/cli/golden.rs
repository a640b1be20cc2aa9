//! Files that the program wrote, with the positions that they decoded to: they decode to the same for ever.
//!
//! `tests/golden/definitionN-SYSTEM.cager` was written by a program whose coordinates are of definition N, and the array beside it by its
//! `cager decode`; `-elements` is with the boundary elements in the file, `-origin` of a capture far from the origin of its coordinates, `edited` with layers of edits. Frames of `coded-SYSTEM` are coded, by
//! `--max-error 1e-3`, with `harmonic` by `--quality preview`; `coded-parted-SYSTEM` has a residual in two parts, by a program whose `PARTED_NUMBERS` is 1;
//! cages of `rounded-SYSTEM` are coded in a basis of rounded numbers. The model has 120 points in a
//! cage of 26 vertices, and three frames.

use crate::support::Dir;
use std::path::{Path, PathBuf};

/// How far a decoded point may move, of the model's diagonal: single precision of what is stored.
const TOLERANCE: f64 = 1e-7;

fn golden() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "cager"));
    files.sort();
    files
}

/// The numbers of an array of three dimensions, in double precision of a capture far away.
fn numbers(file: &Path) -> Vec<f64> {
    let bytes = std::fs::read(file).expect("an array");
    let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]])) + 10;
    let text = String::from_utf8_lossy(&bytes[..header]);
    if text.contains("'<f8'") {
        return bytes[header..].as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
    }
    assert!(text.contains("'<f4'"), "{}", file.display());
    bytes[header..].as_chunks().0.iter().map(|&b| f64::from(f32::from_le_bytes(b))).collect()
}

#[test]
fn files_of_every_version_decode_to_what_they_always_did() {
    let files = golden();
    let kinds = ["mvc", "mvc-origin", "mvc-edited", "harmonic", "harmonic-elements", "green", "green-free"];
    let definition = cager_core::coordinates::DEFINITION;
    let coded = ["mvc", "harmonic", "green", "green-free", "parted-mvc"].map(|kind| format!("coded-{kind}"));
    let edited = ["edited-mvc".to_owned()];
    let rounded = ["mvc", "harmonic", "green", "green-free"].map(|kind| format!("rounded-{kind}"));
    for name in
        kinds.map(|kind| format!("definition{definition}-{kind}")).iter().chain(&coded).chain(&rounded).chain(&edited)
    {
        assert!(files.iter().any(|file| file.file_stem().is_some_and(|stem| *stem == **name)), "{name} is missing");
    }
    let dir = Dir::new();
    for file in files {
        let out = dir.path("out.npy");
        dir.cager("decode --overwrite -o out.npy").arg(&file).succeeds();
        let (found, expected) = (numbers(&out), numbers(&file.with_extension("npy")));
        assert_eq!(found.len(), expected.len(), "{}", file.display());
        let extent = |axis: usize| {
            let values = || expected[..360].iter().skip(axis).step_by(3);
            values().copied().fold(f64::MIN, f64::max) - values().copied().fold(f64::MAX, f64::min)
        };
        let diagonal = (0..3).map(|axis| extent(axis).powi(2)).sum::<f64>().sqrt();
        let farthest = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / diagonal;
        assert!(farthest <= TOLERANCE, "{}: off by {farthest:.1e} of the diagonal", file.display());
    }
}
