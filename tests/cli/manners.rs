//! How commands work and what they say, whatever they do.

use crate::support::Dir;
use std::fs;

const ENCODE: &str = "encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite";

#[test]
fn a_quiet_command_says_nothing_and_a_verbose_one_says_how_long_steps_took() {
    let (dir, _) = Dir::with_capture();
    assert_eq!(dir.cager(&format!("{ENCODE} --quiet")).succeeds().stdout, "");
    let usual = dir.cager(ENCODE).succeeds().stdout;
    let most = dir.cager(&format!("--verbose {ENCODE}")).succeeds().stdout;
    assert!(!usual.contains("steps") && most.contains("  steps   read "), "{most}");
    // What was asked for is said all the same.
    assert!(dir.cager("inspect out.cager --quiet").succeeds().stdout.contains("20 frames"));
    assert_eq!(dir.cager(&format!("{ENCODE} --quiet --verbose")).run().status, Some(2));
}

#[test]
fn any_number_of_threads_gives_the_same_file() {
    let (dir, _) = Dir::with_capture();
    let mut files = Vec::new();
    for threads in ["1", "3"] {
        dir.cager(&format!("{ENCODE} --threads {threads}")).succeeds();
        files.push(dir.read("out.cager"));
    }
    assert!(files[0] == files[1]);
    let said = dir.cager(&format!("{ENCODE} --threads 0")).run();
    assert!(said.status == Some(2) && said.stderr.contains("--threads"), "{}", said.stderr);
}

#[test]
fn the_version_is_that_of_the_package_and_names_the_commit_where_it_is_known() {
    let said = Dir::new().cager("--version").succeeds().stdout;
    let rest = said.trim().strip_prefix(concat!("cager ", env!("CARGO_PKG_VERSION"))).expect("the version");
    let commit = rest.trim().trim_start_matches('(').trim_end_matches(')');
    assert!(commit.is_empty() || (commit.len() >= 7 && commit.chars().all(|c| c.is_ascii_hexdigit())), "{said}");
}

#[test]
fn manual_pages_are_those_of_the_commands() {
    let dir = Dir::new();
    fs::create_dir(dir.path("man1")).expect("a folder");
    dir.cager("man -o man1").succeeds();
    let page = String::from_utf8(dir.read("man1/cager-encode.1")).expect("text");
    assert!(page.starts_with(".ie") || page.contains(".TH"), "{page}");
    assert!(page.contains("regularizer") && page.contains("EXAMPLE") | page.contains("Example"), "{page}");
    assert!(dir.path("man1/cager.1").is_file());
    // A folder is made where there is none, but not in the place of a file.
    dir.cager("man -o new/man1").succeeds();
    assert!(dir.path("new/man1/cager.1").is_file());
    let said = dir.cager("man -o new/man1/cager.1").run();
    assert!(said.status == Some(1) && said.stderr.contains("new/man1/cager.1: cannot be made"), "{}", said.stderr);
}
