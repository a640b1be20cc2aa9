//! What becomes of outputs: files that are there already, standard output, and runs that write nothing.

use crate::refused::refused;
use crate::support::{Dir, ENCODE, has_report_page, npy_f64};

const ENCODE_NEW: &str = "encode --rest rest.obj --cage cage.obj --frames frames.npy";
const COMPARE: &str =
    "compare --rest rest.obj --cage cage.obj --frames frames.npy --coordinates mvc --frames-at-most 1";

/// Refused where the file is there, done with --overwrite; gives what is there then.
#[track_caller]
fn only_overwritten(dir: &Dir, line: &str, file: &str) -> Vec<u8> {
    dir.write(file, "mine");
    refused(dir, line, &[file, "is there already", "--overwrite"]);
    dir.cager(&format!("{line} --overwrite")).succeeds();
    let replaced = dir.read(file);
    assert_ne!(replaced, b"mine", "{line}");
    std::fs::remove_file(dir.path(file)).expect("removed");
    replaced
}

#[test]
fn a_container_is_not_written_under_the_name_of_another_format() {
    let (dir, _) = Dir::with_encoded();
    for name in ["walk.pc2", "walk.glb", "walk.obj"] {
        refused(&dir, &format!("{ENCODE_NEW} -o {name}"), &[name, "walk.cager", "cager decode"]);
    }
}

#[test]
fn no_output_is_replaced_without_overwrite() {
    let (dir, _) = Dir::with_encoded();
    dir.cager("decode out.cager --cages -o cages.npy").succeeds();
    for (line, file) in [
        (format!("{ENCODE_NEW} -o walk.cager"), "walk.cager"),
        (format!("{ENCODE_NEW} -o other.cager --report other.json"), "other.json"),
        ("decode out.cager -o walk.npy".into(), "walk.npy"),
        ("decode out.cager -o walk.pc2".into(), "walk.pc2"),
        ("decode out.cager -o walk.mdd".into(), "walk.mdd"),
        ("decode out.cager --cages -o walk.npy".into(), "walk.npy"),
        ("edit out.cager --with-cages cages.npy -o edited.cager".into(), "edited.cager"),
        ("cage --rest rest.obj --vertices 30 -o made.obj".into(), "made.obj"),
        ("cage --rest rest.obj --vertices 30 -o one.obj --report one.json".into(), "one.json"),
        ("cage --rest rest.obj --check cage.obj --report three.json".into(), "three.json"),
        ("cage --rest rest.obj --repair cage.obj -o repaired.obj".into(), "repaired.obj"),
        (format!("{COMPARE} -o other.html --json walk.json"), "walk.json"),
    ] {
        only_overwritten(&dir, &line, file);
    }
    if has_report_page() {
        let line = "cage --rest rest.obj --vertices 30 -o two.obj --picture two.html";
        only_overwritten(&dir, line, "two.html");
        only_overwritten(&dir, &format!("{COMPARE} -o walk.html"), "walk.html");
    }
}

#[test]
fn a_file_that_is_there_is_told_before_anything_is_read() {
    let dir = Dir::new();
    dir.write("walk.cager", "mine");
    let line = "encode --rest none.obj --frames none.npy -o walk.cager";
    refused(&dir, line, &["walk.cager: is there already; name another file, or give --overwrite to replace it"]);
}

#[test]
fn folders_of_frames_are_replaced_as_a_whole_and_only_where_they_hold_nothing_else() {
    let (dir, _) = Dir::with_encoded();
    for (output, folder) in [("poses", "poses"), ("binary/*.ply", "binary")] {
        let line = format!("decode out.cager -o {output}");
        dir.cager(&line).succeeds();
        refused(&dir, &line, &[output, "not empty", "--overwrite"]);
        dir.cager(&format!("{line} --range 3-5 --overwrite")).succeeds();
        assert_eq!(dir.names(folder).len(), 3, "{output}");
        dir.write(&format!("{folder}/notes.txt"), "mine");
        refused(&dir, &format!("{line} --overwrite"), &[folder, "not empty"]);
    }
    // Of names of one's own, those that are written are replaced alone, and may stand beside others.
    let line = "decode out.cager -o named/f.%03d.obj";
    dir.cager(line).succeeds();
    refused(&dir, line, &["named/f.000.obj", "is there already", "--overwrite"]);
    dir.write("named/notes.txt", "mine");
    dir.cager(&format!("{line} --overwrite")).succeeds();
    assert_eq!((dir.names("named").len(), dir.read("named/notes.txt")), (21, b"mine".to_vec()));
    assert!(dir.names("").iter().all(|name| !name.starts_with(".cager-")), "{:?}", dir.names(""));
}

#[test]
fn inputs_are_never_outputs() {
    let (dir, small) = Dir::with_encoded();
    dir.cager("decode out.cager --cages -o cages/").succeeds();
    dir.model("walk/1.obj", &small.posed(1));
    for (line, file) in [
        (format!("{ENCODE_NEW} -o rest.obj"), "rest.obj"),
        (format!("{ENCODE_NEW} -o new.cager --report frames.npy"), "frames.npy"),
        (format!("{} -o walk/1.obj", ENCODE_NEW.replace("frames.npy", "walk/*.obj")), "1.obj"),
        (format!("{} -o walk/1.obj", ENCODE_NEW.replace("frames.npy", "walk/%d.obj")), "1.obj"),
        ("decode out.cager --with-cages cages -o cages/".into(), "cages"),
        ("decode out.cager --with-cages cages/*.obj -o cages/*.obj".into(), "cages"),
        ("edit out.cager --with-cages cages/*.obj -o cages/frame_0001.obj".into(), "obj"),
        ("cage --rest rest.obj --repair cage.obj -o cage.obj".into(), "cage.obj"),
        (format!("{COMPARE} -o cage.obj"), "cage.obj"),
    ] {
        refused(&dir, &format!("{line} --overwrite"), &[file, "input"]);
    }
}

#[test]
fn containers_and_positions_stream_as_the_same_bytes() {
    let (dir, _) = Dir::with_encoded();
    let (container, said) = dir.cager(&format!("{ENCODE_NEW} -o -")).streams();
    assert!(container == dir.read("out.cager") && said.contains("20 frames of"), "{said}");
    assert_eq!(dir.cager(&format!("{ENCODE_NEW} -o - --quiet")).streams().1, "");
    dir.cager("decode out.cager -o back.npy").succeeds();
    assert!(dir.cager("decode out.cager -o -").streams().0 == dir.read("back.npy"));
    dir.cager("decode out.cager --cages -o cages.npy").succeeds();
    let names = dir.names("");
    assert!(dir.cager("decode out.cager --cages -o -").streams().0 == dir.read("cages.npy"));
    assert!(dir.cager("edit out.cager --with-cages cages.npy -o -").streams().0 == dir.read("out.cager"));
    let (cage, _) = dir.cager("cage --rest rest.obj --vertices 30 -o -").streams();
    assert!(cage.starts_with(b"v "), "no .obj");
    assert_eq!(dir.names(""), names, "a file was left");
}

#[test]
fn reports_stream_as_nothing_but_their_text() {
    let (dir, _) = Dir::with_capture();
    for line in [
        format!("{ENCODE} --report -"),
        "cage --rest rest.obj --vertices 30 -o made.obj --report -".into(),
        "cage --rest rest.obj --check cage.obj --report -".into(),
        format!("{COMPARE} -o walk.html --json -"),
    ] {
        let (report, said) = dir.cager(&line).streams();
        serde_json::from_slice::<serde_json::Value>(&report).expect(&line);
        assert!(!said.is_empty(), "{line}");
    }
    let (page, _) = dir.cager(&format!("{COMPARE} -o -")).streams();
    let (begin, end): (&[u8], &[u8]) = if has_report_page() { (b"<!doctype html>", b"</html>") } else { (b"{", b"}") };
    assert!(page.starts_with(begin) && page.trim_ascii_end().ends_with(end), "no whole page");
}

#[test]
fn a_stream_that_cannot_be_is_refused() {
    let (dir, _) = Dir::with_encoded();
    refused(&dir, &format!("{ENCODE_NEW} -o - --report -"), &["-:", "two outputs"]);
    if cfg!(target_os = "linux") {
        refused(&dir, &format!("{ENCODE_NEW} -o /dev/stdout"), &["/dev/stdout", "give - for standard output"]);
        refused(&dir, "decode out.cager -o /dev/null --overwrite", &["/dev/null", "give - for standard output"]);
    }
    // What is refused later leaves nothing on standard output either.
    dir.write("spoilt.npy", npy_f64(&[vec![f64::NAN; 1800]]));
    refused(&dir, &format!("{} -o - --force", ENCODE_NEW.replace("frames.npy", "spoilt.npy")), &["spoilt.npy"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_closed_pipe_is_no_failure_and_a_full_disk_is_one() {
    let (dir, _) = Dir::with_encoded();
    let program = env!("CARGO_BIN_EXE_cager");
    let line = format!("{{ {program} decode out.cager -o - --quiet; echo $? >status; }} | head -c 6 >head");
    dir.command("sh", ["-c", &line]).succeeds();
    assert_eq!((dir.read("status"), dir.read("head")), (b"0\n".to_vec(), b"\x93NUMPY".to_vec()));
    let full = dir.command("sh", ["-c", &format!("{program} decode out.cager -o - >/dev/full")]).run();
    assert!(full.status == Some(1) && full.stderr.contains("free some space"), "{full:?}");
    // A report does not take its name where the container could not be written.
    let line = format!("{program} {ENCODE_NEW} -o - --report new.json >/dev/full");
    assert_eq!(dir.command("sh", ["-c", &line]).run().status, Some(1));
    assert!(!dir.path("new.json").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn binary_outputs_are_kept_from_terminals() {
    let (dir, _) = Dir::with_encoded();
    let program = env!("CARGO_BIN_EXE_cager");
    if dir.command("sh", ["-c", "command -v script"]).run().status != Some(0) {
        eprintln!("skipped: no `script` to make a terminal");
        return;
    }
    for line in [format!("{ENCODE_NEW} -o -"), "decode out.cager -o -".into()] {
        let said = dir.command("script", ["-qec", &format!("{program} {line}"), "/dev/null"]).run();
        assert!(said.status == Some(1) && said.stdout.contains("is a terminal; redirect it"), "{said:?}");
    }
}

/// Runs a dry run, which must leave the folder as it was, and gives what it says.
#[track_caller]
fn dry(dir: &Dir, line: &str) -> String {
    let before = dir.contents();
    let said = dir.cager(&format!("{line} --dry-run")).succeeds().stdout;
    assert!(dir.contents() == before, "{line}: the folder was changed");
    assert!(said.contains("would be written"), "{line}: {said}");
    said
}

#[test]
fn a_dry_run_says_what_would_be_written_and_writes_nothing() {
    let (dir, small) = Dir::with_encoded();
    let rows = small.cage.vertices.len();
    let size = format!("20 frames of {rows}");
    let said = dry(&dir, &format!("{ENCODE_NEW} -o new.cager --report new.json"));
    assert!(said.contains("new.cager: ") && said.contains(&size) && said.contains("new.json: "), "{said}");
    assert!(dry(&dir, &format!("{ENCODE_NEW} -o new.cager --server http://127.0.0.1:9")).contains(&size));
    let coded = dry(&dir, &format!("{ENCODE_NEW} -o new.cager --target-size 30000"));
    assert!(coded.contains("20 frames, coded, 30.0 kB at the most"), "{coded}");
    let coded = dry(&dir, &format!("{ENCODE_NEW} -o new.cager --max-error 0.01"));
    assert!(coded.contains("20 frames, coded; "), "{coded}");
    let designed = ENCODE_NEW.replace(" --cage cage.obj", "");
    assert!(dry(&dir, &format!("{designed} -o new.cager")).contains("a cage would be designed"));
    assert!(dry(&dir, "decode out.cager -o new.npy").contains("20 frames of 600 points, about 144.0 kB"));
    for output in ["new", "new/*.ply"] {
        dry(&dir, &format!("decode out.cager -o {output}"));
    }
    assert!(dry(&dir, "decode out.cager --cages -o new.npy").contains(&size));
    dir.cager("decode out.cager --cages -o cages.npy").succeeds();
    assert!(dry(&dir, "edit out.cager --with-cages cages.npy -o new.cager").contains(&size));
    dry(
        &dir,
        &format!("cage --rest rest.obj -o new.obj{}", if has_report_page() { " --picture new.html" } else { "" }),
    );
    dry(&dir, "cage --rest rest.obj --frames frames.npy -o new.obj");
    dry(&dir, "cage --rest rest.obj --repair cage.obj -o new.obj");
    dry(&dir, &format!("{COMPARE} -o new.html"));
}

#[test]
fn a_dry_run_refuses_what_the_work_would_refuse() {
    let (dir, mut small) = Dir::with_encoded();
    small.frames[13][7] = f64::NAN;
    dir.write("spoilt.npy", npy_f64(&small.frames));
    let spoilt = |line: &str| line.replace("frames.npy", "spoilt.npy") + " --dry-run";
    for line in [
        format!("{ENCODE_NEW} -o new.cager"),
        format!("{ENCODE_NEW} -o new.cager --server http://127.0.0.1:9"),
        format!("{} -o new.cager", ENCODE_NEW.replace(" --cage cage.obj", "")),
        "cage --rest rest.obj --frames frames.npy -o new.obj".into(),
        format!("{COMPARE} -o new.html"),
    ] {
        refused(&dir, &spoilt(&line), &["spoilt.npy", "frame 13", "point 2"]);
    }
    let encode = format!("{ENCODE_NEW} --dry-run -o");
    refused(&dir, &format!("{encode} out.cager"), &["out.cager", "is there already"]);
    refused(&dir, &format!("{encode} rest.obj --overwrite"), &["rest.obj", "input"]);
    refused(&dir, &format!("{encode} nowhere/new.cager"), &["nowhere/new.cager", "create its folder"]);
    refused(&dir, &format!("{encode} new.cager --spectrum 1000"), &["--spectrum"]);
    refused(&dir, &format!("{encode} new.cager --lambda nan"), &["--lambda"]);
    refused(&dir, "decode out.cager --dry-run -o nowhere/new.npy", &["nowhere/new.npy"]);
    refused(&dir, "decode out.cager --dry-run --range 5-90 -o new.npy", &["out.cager", "5-90"]);
    dir.frames("few.npy", &[vec![0.0; 9]]);
    refused(&dir, "edit out.cager --dry-run --with-cages few.npy -o new.cager", &["few.npy", "vertices"]);
    refused(&dir, "cage --rest rest.obj --dry-run -o new.stl", &["new.stl"]);
}

#[cfg(unix)]
#[test]
fn a_folder_that_is_replaced_keeps_its_mode() {
    use std::os::unix::fs::PermissionsExt;
    let (dir, _) = Dir::with_encoded();
    dir.cager("decode out.cager -o poses").succeeds();
    std::fs::set_permissions(dir.path("poses"), std::fs::Permissions::from_mode(0o700)).expect("a mode");
    dir.cager("decode out.cager -o poses --overwrite").succeeds();
    let mode = std::fs::metadata(dir.path("poses")).expect("the folder").permissions().mode();
    assert_eq!(mode & 0o777, 0o700);
}

#[cfg(unix)]
#[test]
fn a_link_to_a_file_yet_to_be_made_is_that_file() {
    let dir = Dir::with_capture().0;
    std::os::unix::fs::symlink("new.cager", dir.path("report.json")).expect("a link");
    let done = dir.cager(&format!("{ENCODE_NEW} -o new.cager --report report.json")).run();
    assert_eq!(done.status, Some(1), "{}", done.stderr);
    assert!(done.stderr.contains("report.json: cannot hold two outputs"), "{}", done.stderr);
    assert!(!dir.names("").contains(&"new.cager".to_owned()));
}

#[test]
fn the_folder_that_the_program_runs_in_is_not_replaced() {
    let dir = Dir::with_encoded().0;
    dir.cager("decode out.cager -o poses").succeeds();
    let line = format!("decode {} -o . --overwrite", dir.path("out.cager").display());
    let done = dir.cager(&line).within(&dir.path("poses")).run();
    assert_eq!(done.status, Some(1), "{}", done.stderr);
    assert!(done.stderr.contains(".: is the folder that cager runs in"), "{}", done.stderr);
}
