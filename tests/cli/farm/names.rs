//! Names that artists give to shots and meshes: the scripts of the Open Job Description templates, and the job types of
//! Flamenco where Node is, with a program that writes down what it is told.

use crate::support::Dir;
use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// In place of the program: it prints its arguments, and writes its output, for which the folder has to be there.
const PROGRAM: &str = "#!/bin/sh\nprintf '%s\\n' \"$@\"\nwhile [ \"$1\" != -o ]; do shift; done\ntouch \"$2\"\n";

fn of_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Runs the script of a task of a template with a program that writes down its arguments, and gives its exit status and
/// what it said. Of the arguments `captures`, `out` and `program` are places in the folder.
fn task(dir: &Dir, template: &str, arguments: &[&str]) -> (i32, String) {
    let template =
        fs::read_to_string(of_repository(&format!("deploy/farm/{template}.openjd.yaml"))).expect("the template");
    let (_, script) = template.split_once("          data: |\n").expect("a script");
    let program = dir.path("program");
    fs::write(&program, PROGRAM).expect("written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("made executable");
    let placed = arguments.iter().map(|&argument| match argument {
        "captures" | "out" | "program" => dir.path(argument).display().to_string(),
        _ => argument.to_owned(),
    });
    // In a folder with files that a glob would find.
    dir.write("here/eyeball", "");
    let done = Command::new("sh")
        .args(["-c", script, "sh"])
        .args(placed)
        .current_dir(dir.path("here"))
        .output()
        .expect("sh runs");
    let said = [done.stdout, done.stderr].concat();
    (done.status.code().unwrap_or(-1), String::from_utf8_lossy(&said).into_owned())
}

/// Encodes a shot by its name and number.
fn encoded(dir: &Dir, name: &str, number: &str, more: [&str; 4]) -> (i32, String) {
    let usual = ["captures", name, number, "rest.obj", "frames.npy", "", "0.001", "out", "replace", "", "program"];
    task(dir, "encode-shots", &[&usual[..], &more].concat())
}

/// Nothing said of meshes, axes, units and rates.
const NOTHING: [&str; 4] = ["", "", "", "0"];

#[test]
fn folders_in_the_names_of_shots_are_made() {
    let dir = Dir::new();
    for (name, number, shot) in [
        ("sh%03d", "10", "sh010"),
        ("seq01/sh%03d", "10", "seq01/sh010"),
        ("a b/100%%/%d", "7", "a b/100%/7"),
        ("--version%d", "10", "--version10"),
    ] {
        let (status, said) = encoded(&dir, name, number, NOTHING);
        assert_eq!(status, 0, "{name}: {said}");
        assert!(said.contains(&format!("/captures/{shot}/rest.obj\n")), "{name}: {said}");
        assert!(dir.path(&format!("out/{shot}.cager")).exists(), "{name}: {said}");
    }
}

#[test]
fn names_that_are_not_another_for_every_shot_are_refused() {
    let dir = Dir::new();
    for name in ["shot", "sh%%d", "%%%%d", "sh%s", "sh%c d", "sh%03d_%03d", "%", ""] {
        let (status, said) = encoded(&dir, name, "10", NOTHING);
        assert_eq!(status, 2, "{name}: {said}");
        let words = format!("ShotName: {name} is the same for all shots, or has not one place for their numbers; ");
        assert!(said.starts_with(&words), "{name}: {said}");
    }
    assert!(!dir.path("out").exists());
}

#[test]
fn options_reach_the_program_word_by_word() {
    let dir = Dir::new();
    let (status, said) = encoded(&dir, "sh%03d", "10", ["/hero/**/eye*, left eye", "z", "cm", "23.976"]);
    let words = "--up\nz\n--unit\ncm\n--sample-rate\n23.976\n--prim\n/hero/**/eye*\n--prim\nleft eye\n-o\n";
    assert!(status == 0 && said.contains(words), "{said}");
    let (_, said) = encoded(&dir, "sh%03d", "10", NOTHING);
    assert!(["--up", "--unit", "--sample-rate", "--prim"].iter().all(|option| !said.contains(option)), "{said}");
}

#[test]
fn shots_are_decoded_to_files_and_folders() {
    let dir = Dir::new();
    let decoded = |format, part, onto, existing| {
        let words = ["in", "seq/sh%03d", "10", format, part, "captures", onto, "out", existing, "program"];
        task(&dir, "decode-shots", &words)
    };
    for (format, output) in
        [("usdc", "sh010.usdc"), ("obj", "sh010/"), ("ply", "sh010/*.ply"), ("vat", "sh010.vat/"), ("npy", "sh010.npy")]
    {
        let (_, said) = decoded(format, "", "", "replace");
        assert!(
            said.contains(&format!("decode\nin/seq/sh010.cager\n-o\n{}/seq/{output}\n", dir.path("out").display())),
            "{said}"
        );
    }
    let (status, said) = decoded("usdc", "eye*, left hand", "../hero.usdc", "replace");
    let words = format!(
        "--onto\n{}/seq/sh010/../hero.usdc\n--part\neye*\n--part\nleft hand\n-o\n",
        dir.path("captures").display()
    );
    assert!(status == 0 && said.contains(&words), "{said}");
    let (status, said) = decoded("usdc", "", "", "skip");
    assert!(status == 0 && said.ends_with("sh010.usdc: is there already; skipped\n"), "{said}");
}

#[test]
fn every_run_of_marks_in_a_name_becomes_the_number() {
    let dir = Dir::new();
    let settings = r#"{"captures": "/c", "output": "/o", "shots": "7,10", "shot_name": "seq#_sh###"}"#;
    fs::write(dir.path("settings.json"), settings).expect("written");
    let compiled = Command::new("node")
        .arg(of_repository("tests/farm/compile.js"))
        .arg(of_repository("deploy/farm/cager_encode_shots.js"))
        .arg(dir.path("settings.json"))
        .output();
    let Ok(compiled) = compiled else {
        eprintln!("skipped: Node is not here");
        return;
    };
    let tasks = String::from_utf8_lossy(&compiled.stdout);
    assert!(tasks.contains("encode-seq7_sh007") && tasks.contains("/o/seq10_sh010.cager"), "{tasks}");
}
