//! The examples of `docs/CLIENTS.md`, run against a service.

use crate::support::{FRAMES, Service, assert_container, blocks, folder, is_there, succeeds, text, without_settings};
use std::fs;
use std::path::Path;
use std::process::Command;

const DOCUMENT: &str = "docs/CLIENTS.md";
/// Set where the test of the Rust example is to be the example.
const EXAMPLE: &str = "RUN_THE_RUST_EXAMPLE";
const TOKEN: &str = "a token that is long enough";
/// Of the token.
const SHA256: &str = "b1f04507892daa251f873b7fb74e47e7ddf9b228157a48ffee5bfd5d894af379";

/// Runs an example in a folder with a capture, without tokens and then with one.
fn try_out(command: impl Fn(&Path) -> Command, check: impl Fn(&Path, &str)) {
    for guarded in [false, true] {
        let (_keep, folder) = folder();
        let tokens = folder.join("tokens.toml");
        let entry = format!("[[token]]\nname = \"one\"\ntenant = \"docs\"\nsha256 = \"{SHA256}\"\n");
        fs::write(&tokens, entry).expect("a tokens file");
        let more = ["--tokens", tokens.to_str().expect("UTF-8")];
        let service = Service::start(&folder, if guarded { &more } else { &[] });
        let mut command = command(&folder);
        without_settings(&mut command);
        command.current_dir(&folder).env("CAGER_SERVER", service.url());
        if guarded {
            command.env("CAGER_TOKEN", TOKEN);
        }
        let done = succeeds(&mut command);
        check(&folder, &String::from_utf8_lossy(&done.stdout));
    }
}

#[test]
fn the_rust_example_is_that_of_the_client_and_encodes() {
    if std::env::var_os(EXAMPLE).is_some() {
        return crate::encode_example::main().expect("the example works");
    }
    assert_eq!(blocks(DOCUMENT, "rust"), [text("crates/client/examples/encode.rs")]);
    // This test again, in a folder of its own.
    let example = |_: &Path| {
        let mut command = Command::new(std::env::current_exe().expect("this program"));
        let test = "clients::the_rust_example_is_that_of_the_client_and_encodes";
        command.args(["--exact", test, "--nocapture"]).env(EXAMPLE, "1");
        command
    };
    try_out(example, |folder, out| {
        assert!(out.contains("1 passed"), "{out}");
        assert_container(&folder.join("capture.cager"), FRAMES);
    });
}

#[test]
fn the_curl_examples_encode() {
    if !is_there("curl") || !is_there("bash") {
        return;
    }
    let script = blocks(DOCUMENT, "bash").concat();
    for part in ["$server/$id/frames", "/complete", "/capture.cager", "-X DELETE"] {
        assert!(script.contains(part), "{part}");
    }
    let bash = |folder: &Path| {
        fs::write(folder.join("script.sh"), &script).expect("a script");
        let mut command = Command::new("bash");
        command.arg("script.sh");
        command
    };
    try_out(bash, |folder, out| {
        assert!(out.contains("session ") && out.contains(&format!("\"frame\":{}", FRAMES - 1)), "{out}");
        assert_container(&folder.join("capture.cager"), FRAMES);
        let cage = fs::read(folder.join("cage-0.f32")).expect("a cage");
        assert!(!cage.is_empty() && cage.len().is_multiple_of(12));
        let positions = fs::read(folder.join("positions.f32")).expect("positions");
        assert!(!positions.is_empty() && fs::read(folder.join("other-positions.f32")).expect("positions") == positions);
        cager_formats::read_model(&folder.join("designed.obj")).expect("a designed cage");
        let sessions = fs::read_dir(folder.join("data/sessions")).expect("the data folder").count();
        assert_eq!(sessions, 0, "the last step deletes the session");
        assert_eq!(fs::read_dir(folder.join("data/cages")).expect("the data folder").count(), 0);
    });
}

#[test]
fn the_python_example_encodes_with_nothing_but_the_standard_library() {
    if !is_there("python3") {
        return;
    }
    let script = blocks(DOCUMENT, "python").concat();
    let python = |folder: &Path| {
        fs::write(folder.join("script.py"), &script).expect("a script");
        let mut command = Command::new("python3");
        // Isolated: no packages of the user's.
        command.args(["-I", "-S", "script.py"]);
        command
    };
    try_out(python, |folder, out| {
        assert_eq!(out.lines().filter(|line| line.starts_with("frame ")).count(), 3, "{out}");
        assert_container(&folder.join("capture.cager"), 3);
        assert!(out.contains("designed cage of "), "{out}");
    });
}
