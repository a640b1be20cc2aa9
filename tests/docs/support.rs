//! A running service, blocks of documents, names in the sources.

use cager_demo::{Capture, Options};
use cager_formats::write_model;
use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub(crate) const FRAMES: usize = 5;

pub(crate) fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub(crate) fn text(path: &str) -> String {
    fs::read_to_string(repository().join(path)).expect(path)
}

/// The fenced blocks of a language in a document, one after another.
pub(crate) fn blocks(document: &str, language: &str) -> Vec<String> {
    let fence = format!("```{language}\n");
    text(document)
        .split(&fence)
        .skip(1)
        .map(|rest| rest.split("\n```").next().unwrap_or_default().to_owned() + "\n")
        .collect()
}

/// Names of metrics that the sources count, set or record.
pub(crate) fn metrics() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut folders = vec![repository().join("crates/service/src")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            // However the lines are broken.
            let source: String = fs::read_to_string(&path).expect("a source").split_whitespace().collect();
            for kind in ["counter!(\"", "gauge!(\"", "histogram!(\""] {
                let names = source.split(kind).skip(1).filter_map(|rest| rest.split('"').next());
                found.extend(names.map(str::to_owned));
            }
        }
    }
    assert!(found.len() > 20, "{found:?}");
    found
}

/// Every word in a text that begins like a metric.
pub(crate) fn words(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    words.filter(|word| word.starts_with("cager_")).map(str::to_owned).collect()
}

/// A small capture as the documents want it: `rest.obj`, `cage.obj`, `frames.f32` and `0.f32`, `1.f32`, …
pub(crate) fn write_capture(folder: &Path) {
    let capture = Capture::new(&Options { points: 400, frames: FRAMES, cage_vertices: 40 });
    write_model(&folder.join("rest.obj"), &capture.rest).expect("rest.obj");
    write_model(&folder.join("cage.obj"), &capture.cage.clone().into()).expect("cage.obj");
    let (mut all, mut frame) = (Vec::new(), Vec::new());
    for t in 0..FRAMES {
        capture.frame(t, &mut frame);
        let bytes: Vec<u8> = frame.iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
        fs::write(folder.join(format!("{t}.f32")), &bytes).expect("a frame");
        all.extend(bytes);
    }
    fs::write(folder.join("frames.f32"), all).expect("frames.f32");
}

/// The file is a container of `frames` frames with good checksums.
#[track_caller]
pub(crate) fn assert_container(path: &Path, frames: usize) {
    let mut container = cager_capture::decode::open(path).expect("a container");
    assert_eq!(container.frames(), frames);
    container.verify().expect("its checksums match");
}

/// The program, without settings from the environment.
pub(crate) fn cager() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cager"));
    without_settings(&mut command);
    command
}

pub(crate) fn without_settings(command: &mut Command) {
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CAGER_")) {
        command.env_remove(name);
    }
    // Some tools ask a proxy for their own machine.
    command.env("NO_PROXY", "*").env("no_proxy", "*");
}

/// A running service; killed when dropped.
pub(crate) struct Service {
    pub(crate) child: Child,
    pub(crate) address: String,
}

impl Service {
    /// `cager serve` on a free port, with its data in `folder`.
    pub(crate) fn start(folder: &Path, more: &[&str]) -> Self {
        let mut command = cager();
        command
            .args(["serve", "--listen", "127.0.0.1:0", "--log-filter", "warn", "--data"])
            .arg(folder.join("data"))
            .args(more);
        Self::of(command)
    }

    /// A command that says where it listens.
    pub(crate) fn of(mut command: Command) -> Self {
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().expect("the program runs");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut line).expect("a line");
        let Some(address) = line.trim().strip_prefix("listening on ") else {
            let _ = child.kill();
            panic!("the service did not start: {line:?}");
        };
        Self { child, address: address.to_owned() }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits for a process at most so long.
#[track_caller]
pub(crate) fn ends_within(child: &mut Child, limit: Duration) -> std::process::ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a process") {
            return status;
        }
        assert!(start.elapsed() < limit, "it has not ended after {limit:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[track_caller]
pub(crate) fn succeeds(command: &mut Command) -> Output {
    let done = command.stdin(Stdio::null()).output().expect("the program runs");
    let (out, err) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{command:?}: {}\n{out}\n{err}", done.status);
    done
}

/// Whether a program is there. Continuous integration has python3 and bash, but not curl everywhere.
pub(crate) fn is_there(program: &str) -> bool {
    let there = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !there {
        let expected = std::env::var_os("CI").is_some() && program != "curl";
        assert!(!expected, "{program} is missing, and CI must not skip what needs it");
        eprintln!("\n*** SKIPPED: {program} is missing, so its example in docs/CLIENTS.md was not run ***\n");
    }
    there
}

/// A new folder with the small capture in it.
pub(crate) fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_capture(folder.path());
    let path = folder.path().to_owned();
    (folder, path)
}
