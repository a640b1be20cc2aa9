//! Names that artists give to shots: the script of the Open Job Description template, and the job type of Flamenco where Node is, with a program that
//! writes down what it is told.

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

/// Runs the script of a task, and gives its exit status and what it said.
fn task(dir: &Dir, name: &str, number: &str) -> (i32, String) {
    let template = fs::read_to_string(of_repository("deploy/farm/encode-shots.openjd.yaml")).expect("the template");
    let (_, script) = template.split_once("          data: |\n").expect("a script");
    let program = dir.path("program");
    fs::write(&program, PROGRAM).expect("written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("made executable");
    let (captures, output) = (dir.path("captures"), dir.path("out"));
    let done = Command::new("sh")
        .args(["-c", script, "sh"])
        .arg(captures)
        .args([name, number, "rest.obj", "frames.npy", "", "0.001"])
        .arg(output)
        .args(["replace", ""])
        .arg(program)
        .output()
        .expect("sh runs");
    let said = [done.stdout, done.stderr].concat();
    (done.status.code().unwrap_or(-1), String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn folders_in_the_names_of_shots_are_made() {
    let dir = Dir::new();
    for (name, number, shot) in [
        ("sh%03d", "10", "sh010"),
        ("seq01/sh%03d", "10", "seq01/sh010"),
        ("a b/100%%/%d", "7", "a b/100%/7"),
        ("--version%d", "10", "--version10"),
    ] {
        let (status, said) = task(&dir, name, number);
        assert_eq!(status, 0, "{name}: {said}");
        assert!(said.contains(&format!("/captures/{shot}/rest.obj\n")), "{name}: {said}");
        assert!(dir.path(&format!("out/{shot}.cager")).exists(), "{name}: {said}");
    }
}

#[test]
fn names_that_are_not_another_for_every_shot_are_refused() {
    let dir = Dir::new();
    for name in ["shot", "sh%%d", "%%%%d", "sh%s", "sh%c d", "sh%03d_%03d", "%", ""] {
        let (status, said) = task(&dir, name, "10");
        assert_eq!(status, 2, "{name}: {said}");
        let words = format!("ShotName: {name} is the same for all shots, or has not one place for their numbers; ");
        assert!(said.starts_with(&words), "{name}: {said}");
    }
    assert!(!dir.path("out").exists());
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
