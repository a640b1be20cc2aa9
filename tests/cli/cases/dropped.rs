//! What files hold that is not kept is said once, by name, by each command that drops it.

use crate::support::{Dir, ENCODE};

/// The rest pose of the small capture with smoothing groups.
fn textured() -> Dir {
    let (dir, _) = Dir::with_capture();
    let text = String::from_utf8(dir.read("rest.obj")).expect("text");
    dir.write("textured.obj", format!("s 1\n{text}s 2\n"));
    dir
}

const LOST: &str = "textured.obj: smoothing groups (s) are not kept";
const ORDER: &str = "nor is the order of faces and of their corners";

#[track_caller]
fn told_once(said: &str) {
    assert_eq!(said.matches(LOST).count(), 1, "{said}");
    assert_eq!(said.matches("not kept").count(), 1, "{said}");
}

#[test]
fn encode_says_what_it_drops_in_the_report_too() {
    let dir = textured();
    let line = ENCODE.replace("rest.obj", "textured.obj") + " --report report.json";
    for (options, is_reordered) in [("", false), (" --max-error 0.01", true), (" --max-error 0.01 --exact-rest", false)]
    {
        let said = dir.cager(&format!("{line}{options}")).succeeds().stderr;
        told_once(&said);
        assert_eq!(said.contains(ORDER), is_reordered, "{options}: {said}");
        let warnings = dir.json("report.json")["warnings"].as_array().cloned().expect("warnings");
        let told = |warning: &&serde_json::Value| warning.as_str().is_some_and(|warning| warning.contains(LOST));
        assert_eq!(warnings.iter().filter(told).count(), 1, "{warnings:?}");
    }
    told_once(&dir.cager(&format!("{line} --dry-run")).succeeds().stderr);
    assert!(!dir.cager(ENCODE).succeeds().stderr.contains("not kept"));
}

#[test]
fn decode_transfer_and_explore_say_what_they_drop() {
    let dir = textured();
    dir.cager(ENCODE).succeeds();
    told_once(&dir.cager("decode out.cager --model textured.obj -o moved.npy").succeeds().stderr);
    let line = "transfer --source out.cager --target textured.obj -o moved.cager --align none --cage-vertices 60";
    told_once(&dir.cager(line).succeeds().stderr);
    told_once(&dir.cager("explore textured.obj textured.obj --weights 0.5,0.5 -o between.obj").succeeds().stderr);
}

#[test]
fn recover_says_what_the_template_and_the_surfaces_lose() {
    let dir = textured();
    let text = String::from_utf8(dir.read("rest.obj")).expect("text").replacen("\nf ", "\nusemtl skin\nf ", 1);
    let text =
        text.lines().map(|line| if line.starts_with('f') { line.replace(' ', "/1 ") + "/1" } else { line.to_owned() });
    let text = text.collect::<Vec<_>>().join("\n").replace("f/1", "f");
    (0..2).for_each(|k| dir.write(&format!("scan_{k}.obj"), format!("vt 0 0\n{text}\n")));
    let said =
        dir.cager("recover --template textured.obj --frames scan_*.obj -o out.cager --dry-run").succeeds().stderr;
    assert_eq!(said.matches(LOST).count(), 1, "{said}");
    let scans = "scan_0.obj: texture coordinates and 1 material are not kept, nor those of other frames";
    assert_eq!(said.matches(scans).count(), 1, "{said}");
}

#[test]
fn a_splat_that_is_moved_loses_its_properties_with_a_word() {
    let dir = textured();
    dir.cager(ENCODE).succeeds();
    let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned).to_vec();
    names.extend((0..3).map(|k| format!("f_dc_{k}")).chain((0..45).map(|k| format!("f_rest_{k}"))));
    names.extend(["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(str::to_owned));
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex 2\n{properties}end_header\n");
    dir.write("splat.ply", [header.into_bytes(), vec![0; 2 * 62 * 4]].concat());
    let said = dir.cager("decode out.cager --model splat.ply -o moved.ply --frame 0").succeeds().stderr;
    assert!(
        said.contains("59 of 62 properties (nx, ny, nz, f_dc_0 and 55 more) of its vertices are not kept"),
        "{said}"
    );
}

#[test]
fn cages_that_are_written_anew_say_what_they_lose() {
    let dir = textured();
    let text = String::from_utf8(dir.read("cage.obj")).expect("text");
    dir.write("cage.obj", format!("usemtl glass\n{text}"));
    let line = "cage --rest rest.obj --frames frames.npy --improve cage.obj --time-limit 1 -o better.obj";
    for line in [line, "cage --rest rest.obj --repair cage.obj -o mended.obj"] {
        let said = dir.cager(line).succeeds().stderr;
        assert_eq!(said.matches("cage.obj: 1 material is not kept").count(), 1, "{line}: {said}");
    }
}
