//! Disks that fill: one sentence that names the file, exit status 1, and nothing left behind.

use crate::refused::assert_sentence;
use crate::support::{Dir, ENCODE, Output, quad_box};

/// Runs the program where files may have no more than some blocks of 512 or, in other shells, 1,024 bytes, as on a disk
/// that is full.
fn limited(dir: &Dir, blocks: usize, line: &str) -> Output {
    let limited = format!("ulimit -f {blocks}; trap '' XFSZ; exec {} {line}", env!("CARGO_BIN_EXE_cager"));
    dir.command("sh", ["-c", &limited]).run()
}

#[test]
fn full_disk_is_refused_and_leaves_nothing() {
    let (dir, _) = Dir::with_encoded();
    let line = "encode --rest rest.obj --cage cage.obj --frames frames.npy -o new.cager --report new.json";
    assert!(dir.read("out.cager").len() > 16 << 10, "the output fits on the full disk, so that this tests nothing");
    for (line, file) in [
        (line, "new.cager"),
        ("decode out.cager -o back.npy", "back.npy"),
        ("decode out.cager -o back.mdd", "back.mdd"),
        ("decode out.cager -o poses", "poses/frame_0000.obj"),
    ] {
        let before = dir.contents();
        let done = limited(&dir, 8, line);
        assert_eq!(done.status, Some(1), "{line}: {done:?}");
        assert_sentence(line, &done.stderr, &[file, "cannot be written", "free some space"]);
        assert!(dir.contents() == before, "{line} left {:?}", dir.names(""));
        // The same without the limit, so that it was the limit.
        dir.cager(line).succeeds();
    }
}

/// A capture that does not move makes a small container and a long report, so that the disk fills in the report.
#[test]
fn disk_full_of_the_report_leaves_no_container_either() {
    let (dir, small) = Dir::with_capture();
    dir.model("cage.obj", &quad_box(&small.rest.points));
    dir.frames("frames.npy", &vec![small.frames[0].clone(); 2000]);
    let line = format!("{ENCODE} --report report.json");
    for old in [None, Some("of earlier times")] {
        for file in ["out.cager", "report.json"] {
            let _ = std::fs::remove_file(dir.path(file));
            old.iter().for_each(|text| dir.write(file, text));
        }
        let before = dir.contents();
        let done = limited(&dir, 128, &line);
        assert_eq!(done.status, Some(1), "{done:?}");
        assert_sentence(&line, &done.stderr, &["report.json", "cannot be written", "free some space"]);
        assert_eq!(done.stdout, "");
        assert!(dir.contents() == before, "it left {:?}", dir.names(""));
    }
    dir.cager(&line).succeeds();
    let (container, report) = (dir.read("out.cager").len(), dir.read("report.json").len());
    assert!(container < 64 << 10 && report > 128 << 10, "{container} and {report} bytes, so that this tests nothing");
}
