//! Help, completions and exit statuses.

use crate::support::{Dir, ENCODE};

#[test]
fn exit_status_is_0_for_done_1_for_failed_and_2_for_wrong_usage() {
    let (dir, _) = Dir::with_capture();
    let status = |line: &str| dir.cager(line).run().status;
    assert_eq!(status(ENCODE), Some(0));
    assert_eq!(status("inspect out.cager"), Some(0));
    assert_eq!(status("--version"), Some(0));
    assert_eq!(status("inspect missing.cager"), Some(1));
    for wrong in [
        "",
        "encod",
        "encode",
        "encode --rest rest.obj --cage cage.obj -o out.cager",
        &format!("{ENCODE} --handles some"),
        &format!("{ENCODE} --regularizer strong"),
        &format!("{ENCODE} --coordinates barycentric"),
        &format!("{ENCODE} --spectrum -1"),
        &format!("{ENCODE} --lambda much"),
        &format!("{ENCODE} --fast"),
        "decode out.cager",
        "inspect",
        "demo --points 0",
        "completions tcsh",
    ] {
        let done = dir.cager(wrong).run();
        assert_eq!(done.status, Some(2), "{wrong}");
        assert!(done.stdout.is_empty() && !done.stderr.is_empty(), "{wrong}: {done:?}");
    }
}

#[test]
fn a_misspelt_option_gets_a_suggestion() {
    let done = Dir::new().cager("encode --frame walk").run();
    assert!(done.stderr.contains("--frames"), "{}", done.stderr);
}

#[test]
fn help_of_every_command_shows_an_example() {
    let dir = Dir::new();
    for command in ["encode", "decode", "inspect", "transfer", "explore", "cage", "demo", "formats", "completions"] {
        let help = dir.cager(&format!("{command} --help")).succeeds().stdout;
        assert!(help.contains(&format!("Example: cager {command}")), "{help}");
        assert!(dir.cager("--help").succeeds().stdout.contains(&format!("  {command} ")));
    }
    let encode = dir.cager("encode --help").succeeds().stdout;
    for format in [".obj", ".ply", ".off", ".stl", ".glb", ".npy", ".pc2", ".mdd", ".abc", "folder", "glob"] {
        assert!(encode.contains(format), "{format} is missing in {encode}");
    }
    let decode = dir.cager("decode --help").succeeds().stdout;
    for format in [".npy", ".pc2", ".mdd", ".abc", "folder"] {
        assert!(decode.contains(format), "{format} is missing in {decode}");
    }
}

#[test]
fn formats_are_listed_with_what_they_are_for() {
    let list = Dir::new().cager("formats").succeeds().stdout;
    let line = |extension: &str| list.lines().find(|line| line.starts_with(extension)).expect(extension);
    assert!(line(".abc").contains("read, written  all frames") && line(".abc").contains("frame rate, times"), "{list}");
    assert!(line(".glb").contains("metres, Y up") && line(".glb").contains("written"), "{list}");
    assert!(!line(".usda").contains("written") && !line(".vat").contains("read"), "{list}");
}

#[test]
fn completions_know_every_command() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = Dir::new().cager(&format!("completions {shell}")).succeeds().stdout;
        for command in ["encode", "decode", "inspect", "demo", "--frames", "--regularizer"] {
            assert!(script.contains(command.trim_start_matches('-')), "{shell}: {command}");
        }
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let (dir, _) = Dir::with_encoded();
    // The reader has gone before the first byte comes.
    let program = env!("CARGO_BIN_EXE_cager");
    let line = format!("(sleep 0.2; exec {program} inspect --json out.cager) | true; exit ${{PIPESTATUS[0]}}");
    dir.command("bash", ["-c", &line]).succeeds();
}
