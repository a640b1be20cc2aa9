//! How much memory large models take.

use super::support::{Dir, as_model};
use cager_demo::{Capture, Options};
use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Runs the program and gives the most memory that it held, in bytes.
fn most_held(dir: &Dir, args: &str) -> u64 {
    let mut child = Command::new(env!("CARGO_BIN_EXE_cager"))
        .args(args.split_whitespace())
        .current_dir(dir.path("."))
        .stdout(Stdio::null())
        .spawn()
        .expect("the program");
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    loop {
        // The mark of a process that has ended cannot be read any more.
        if let Ok(text) = fs::read_to_string(&status)
            && let Some(line) = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))
        {
            most = line.trim().trim_end_matches(" kB").parse().unwrap_or(most);
        }
        if let Some(status) = child.try_wait().expect("a status") {
            assert!(status.success(), "{args}");
            return 1024 * most;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_million_points_take_little_memory_to_encode_and_decode() {
    let capture = Capture::new(&Options { points: 1_000_000, frames: 5, cage_vertices: 140 });
    let dir = Dir::new();
    dir.model("rest.ply", &capture.rest);
    dir.model("cage.obj", &as_model(&capture.cage));
    let mut frames = vec![Vec::new(); 5];
    frames.iter_mut().enumerate().for_each(|(t, frame)| capture.frame(t, frame));
    dir.frames("frames.npy", &frames);
    drop((capture, frames));
    let encode =
        "encode --rest rest.ply --cage cage.obj --frames frames.npy --report report.json -o out.cager --memory 1GB";
    let decode = "decode out.cager -o out.npy --memory 1GB";
    for command in [encode, decode] {
        let most = most_held(&dir, command);
        assert!(most > 100_000_000 && most < 800_000_000, "{command}: {most} bytes");
    }
    let report = dir.json("report.json");
    assert!(report["error"]["l2_mean"].as_f64().is_some_and(|l2| l2 < 0.01), "{}", report["error"]["l2_mean"]);
    // Memory changes nothing but the way.
    dir.cager("decode out.cager -o all.npy --memory 16GB").succeeds();
    assert!(dir.read("out.npy") == dir.read("all.npy"));
}

#[test]
fn sizes_of_memory_are_checked() {
    let (dir, _) = Dir::with_encoded();
    for (size, advice) in [("1MB", "at least 100MB"), ("much", "such as 800MB")] {
        let refused = dir.cager(&format!("decode out.cager -o out.npy --memory {size}")).run();
        assert_eq!(refused.status, Some(2));
        assert!(refused.stderr.contains(advice), "{}", refused.stderr);
    }
}
