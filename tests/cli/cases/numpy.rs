//! Arrays as NumPy users save them.

use crate::refused::assert_sentence;
use crate::support::Dir;

const CASE: &str = "16-numpy-layouts";
const ENCODE: &str = "encode --rest rest.obj --cage cage.obj -o out.cager --overwrite --report report.json --frames";

#[test]
fn flat_arrays_and_the_one_array_that_fits_and_folders_of_arrays_are_read() {
    let dir = Dir::with_case(CASE);
    for (frames, count, rate) in [
        ("flat5.npy", 5, None),
        ("flat3.npy", 3, None),
        ("mesh.npz", 5, None),
        ("fps.npz", 5, Some(30.0)),
        ("npy", 3, None),
        ("npy/*.npy", 3, None),
        ("npy/f_%03d.npy", 3, None),
    ] {
        dir.cager(&format!("{ENCODE} {frames}")).succeeds();
        let report = dir.json("report.json");
        assert_eq!(report["frames"], count, "{frames}");
        assert_eq!(report["frame_rate"].as_f64(), rate, "{frames}");
        // Read in another order of its values, a frame would not look like the model.
        let error = report["error"]["l2_max"].as_f64().expect("an error");
        assert!(error < 0.05, "{frames}: {error}");
    }
}

#[test]
fn arrays_that_are_not_read_come_with_advice_that_works() {
    let dir = Dir::with_case(CASE);
    for (frames, words) in [
        (
            "per-frame.npz",
            vec!["3 arrays of one frame each (frame_0, frame_1, frame_2)", "[a[k] for k in sorted(a.files, key="],
        ),
        (
            "records.npy",
            vec![
                "has records (\"x\", \"y\", \"z\")",
                "numpy.stack([numpy.load(path)[k] for k in \"xyz\"], -1).astype(\"<f4\")",
            ],
        ),
        ("object.npy", vec!["Python objects", "numpy.load(path, allow_pickle=True) if len(frame) == 162], \"<f4\")"]),
        ("lzma.npz", vec!["packed with LZMA", "numpy.savez_compressed(\"converted.npz\", **numpy.load(path))"]),
    ] {
        let done = dir.cager(&format!("{ENCODE} {frames}")).run();
        assert_eq!(done.status, Some(1), "{frames}");
        assert_sentence(frames, &done.stderr, &[&[frames], words.as_slice()].concat());
    }
}

#[test]
fn advice_works_when_followed() {
    let Ok(python) = std::env::var("CAGER_PYTHON") else {
        eprintln!("skipped: CAGER_PYTHON names no Python with NumPy");
        return;
    };
    let dir = Dir::with_case(CASE);
    for (frames, converted, count) in [
        ("per-frame.npz", "converted.npy", 3),
        ("records.npy", "converted.npy", 5),
        ("object.npy", "converted.npy", 1),
        ("lzma.npz", "converted.npz", 5),
    ] {
        let said = dir.cager(&format!("{ENCODE} {frames}")).run().stderr;
        let start = said.find("a = numpy").or_else(|| said.find("numpy.save")).expect("advice");
        let script = format!("import numpy; path = {frames:?}; {}", said[start..].trim());
        dir.command(&python, ["-c", script.as_str()]).succeeds();
        dir.cager(&format!("{ENCODE} {converted}")).succeeds();
        assert_eq!(dir.json("report.json")["frames"], count, "{frames}");
    }
}
