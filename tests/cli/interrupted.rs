//! Commands that are told to end while they work: they die by the signal and leave the folder as it was.

use crate::support::{Dir, Small, as_model, has_report_page, npy};
use rustix::process::{Pid, Signal, kill_process};
use std::fs::{self, OpenOptions};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::Child;
use std::thread::sleep;
use std::time::{Duration, Instant};

const ASKED: [Signal; 3] = [Signal::INT, Signal::TERM, Signal::HUP];

/// A capture as long as wanted that takes no room on the disk: all its points stay at the origin, in a file of holes.
fn inputs(frames: usize) -> Dir {
    let (dir, small) = (Dir::new(), Small::new());
    dir.model("rest.obj", &small.rest);
    dir.model("cage.obj", &as_model(&small.cage));
    let points = small.rest.points.len();
    let header = npy("<f4", false, &format!("({frames}, {points}, 3)"), &[]);
    dir.write("frames.npy", &header);
    let file = OpenOptions::new().write(true).open(dir.path("frames.npy")).expect("frames.npy");
    file.set_len((header.len() + 12 * points * frames) as u64).expect("room for holes");
    dir
}

fn encode(inputs: &Dir) -> String {
    let path = |name| inputs.path(name).display().to_string();
    let (rest, cage, frames) = (path("rest.obj"), path("cage.obj"), path("frames.npy"));
    format!("encode --rest {rest} --cage {cage} --frames {frames} -o out.cager --overwrite --report report.json")
}

/// A capture that takes minutes to encode, and a folder with outputs of earlier times.
fn long_encode() -> (Dir, Dir, String) {
    let (inputs, dir) = (inputs(10_000_000), Dir::new());
    dir.write("out.cager", "an old capture");
    dir.write("report.json", "an old report");
    let line = encode(&inputs);
    (inputs, dir, line)
}

/// A container that takes seconds to decode.
fn long_decode() -> Dir {
    let (inputs, dir) = (inputs(30_000), Dir::new());
    dir.cager(&encode(&inputs)).succeeds();
    dir
}

/// Whether a process has this many files open for an output in the folder.
fn writes(child: &Child, dir: &Dir, files: usize) -> bool {
    let Ok(open) = fs::read_dir(format!("/proc/{}/fd", child.id())) else { return false };
    let folder = fs::canonicalize(dir.path("")).expect("the folder");
    let ours = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        path.parent() == Some(&folder) && name.starts_with(".cager-")
    };
    open.filter(|entry| entry.as_ref().is_ok_and(|entry| fs::read_link(entry.path()).is_ok_and(|p| ours(&p)))).count()
        == files
}

/// Whether a frame lies in a folder that has no name yet.
fn writes_frames(dir: &Dir) -> bool {
    let names = dir.names("");
    let folder = names.iter().find(|name| name.starts_with(".cager-"));
    folder.is_some_and(|name| fs::read_dir(dir.path(name)).is_ok_and(|mut frames| frames.next().is_some()))
}

/// Runs a command until it has demonstrably begun its output.
#[track_caller]
fn begin(dir: &Dir, line: &str, begun: impl Fn(&Child) -> bool) -> Child {
    wait_for(dir.cager(line).spawn(), line, begun)
}

#[track_caller]
fn wait_for(mut child: Child, line: &str, begun: impl Fn(&Child) -> bool) -> Child {
    let start = Instant::now();
    while !begun(&child) {
        assert!(child.try_wait().expect("a process").is_none(), "{line} ended before it could be interrupted");
        assert!(start.elapsed() < Duration::from_secs(30), "{line} has not begun its output");
        sleep(Duration::from_millis(1));
    }
    child
}

fn send(child: &Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).expect("a signal");
}

/// The signal that a process dies by.
#[track_caller]
fn death(mut child: Child) -> Option<i32> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a process") {
            return status.signal();
        }
        if start.elapsed() > Duration::from_secs(30) {
            let _ = child.kill();
            panic!("the signal did not end the process");
        }
        sleep(Duration::from_millis(1));
    }
}

#[test]
fn an_encoding_told_to_end_leaves_the_old_files_and_no_others() {
    let (_inputs, dir, line) = long_encode();
    let before = dir.contents();
    for signal in ASKED {
        let child = begin(&dir, &line, |child| writes(child, &dir, 2));
        send(&child, signal);
        assert_eq!(death(child), Some(signal.as_raw()));
        assert!(dir.contents() == before, "{signal:?} left {:?}", dir.names(""));
    }
}

#[test]
fn a_comparison_told_to_end_leaves_the_old_files_and_no_others() {
    let (_inputs, dir, line) = long_encode();
    dir.write("report.html", "an old report");
    let line = line.replace("encode ", "compare ").replace("out.cager", "report.html").replace("--report", "--json");
    let (before, files) = (dir.contents(), if has_report_page() { 2 } else { 1 });
    for signal in ASKED {
        let child = begin(&dir, &line, |child| writes(child, &dir, files));
        send(&child, signal);
        assert_eq!(death(child), Some(signal.as_raw()));
        assert!(dir.contents() == before, "{signal:?} left {:?}", dir.names(""));
    }
}

#[test]
fn a_decoding_told_to_end_leaves_no_folder_and_no_file() {
    let dir = long_decode();
    let before = dir.contents();
    for signal in ASKED {
        for output in ["poses", "poses/*.ply", "back.npy"] {
            let line = format!("decode out.cager -o {output}");
            let begun = |child: &Child| if output == "back.npy" { writes(child, &dir, 1) } else { writes_frames(&dir) };
            let child = begin(&dir, &line, begun);
            send(&child, signal);
            assert_eq!(death(child), Some(signal.as_raw()), "{line}");
            assert!(dir.contents() == before, "{line}: {signal:?} left {:?}", dir.names(""));
        }
    }
}

#[test]
fn a_demo_told_to_end_takes_its_service_along() {
    let line = "demo --points 2000 --frames 100000 --cage-vertices 200";
    for signal in ASKED {
        let dir = Dir::new();
        // While it starts, while it prepares, and while frames arrive.
        for begun in ["", "sessions", "sessions/*"] {
            let child = begin(&dir, line, |_| service_has(&dir, begun));
            send(&child, signal);
            assert_eq!(death(child), Some(signal.as_raw()), "{begun}");
            assert_eq!(dir.names("cager-demo"), ["cage.obj", "rest.obj"], "{signal:?} at {begun:?}");
        }
    }
}

/// Whether the demo's service has something in its data folder. `*` stands for any name.
fn service_has(dir: &Dir, what: &str) -> bool {
    let pattern = dir.path("cager-demo/.cager-*.tmp").join(what);
    glob::glob(&pattern.display().to_string()).expect("a pattern").next().is_some()
}

#[test]
fn a_killed_process_leaves_the_old_files_and_at_most_hidden_ones() {
    let (_inputs, dir, line) = long_encode();
    let before = dir.contents();
    let child = begin(&dir, &line, |child| writes(child, &dir, 2));
    send(&child, Signal::KILL);
    assert_eq!(death(child), Some(Signal::KILL.as_raw()));
    for name in dir.names("").iter().filter(|name| name.starts_with(".cager-")) {
        fs::remove_file(dir.path(name)).expect("removed");
    }
    assert!(dir.contents() == before, "killed, it left {:?}", dir.names(""));
}

#[test]
fn what_is_started_with_nohup_outlives_its_terminal() {
    let (_inputs, dir, line) = long_encode();
    let before = dir.contents();
    let shell = format!("trap '' HUP; exec {} {line}", env!("CARGO_BIN_EXE_cager"));
    let mut child = wait_for(dir.command("sh", ["-c", &shell]).spawn(), &line, |child| writes(child, &dir, 2));
    send(&child, Signal::HUP);
    sleep(Duration::from_millis(100));
    assert!(child.try_wait().expect("a process").is_none(), "it died of a signal that was to be ignored");
    send(&child, Signal::TERM);
    assert_eq!(death(child), Some(Signal::TERM.as_raw()));
    assert!(dir.contents() == before, "it left {:?}", dir.names(""));
}
