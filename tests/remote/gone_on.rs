//! `cager encode --server --session`: what breaks off is kept, and gone on with if it is of the same capture.

use crate::server::{Server, capture, ready, sessions};
use crate::support::{Dir, ENCODE, Small, as_model};
use cager_client::messages::SessionState;
use cager_client::{MemoryFrames, UploadOptions};

#[test]
fn an_upload_that_broke_is_gone_on_with() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let session = begun(&server, &dir, points, &values);
    let encode = format!("{ENCODE} --server {} --connections 3", server.address());
    dir.cager(&format!("{encode} --session {session}")).succeeds();
    assert_eq!(sessions(&server).len(), 1);
    let gone_on = dir.read("out.cager");
    std::fs::remove_file(dir.path("out.cager")).expect("a file");
    dir.cager(ENCODE).succeeds();
    assert!(dir.read("out.cager") == gone_on, "other bytes than on this machine");
    let said = dir.cager(&format!("{ENCODE} --session {session}")).run();
    assert_eq!((said.status, said.stderr.contains("--server")), (Some(2), true), "{}", said.stderr);
}

/// A session that has the first seven frames.
#[tokio::main(flavor = "current_thread")]
async fn begun(server: &Server, dir: &Dir, points: usize, values: &[f32]) -> String {
    let client = server.client();
    let session = ready(&client, dir).await;
    let some = MemoryFrames::new(points, &values[..7 * 3 * points]);
    client.upload(&session, some, UploadOptions::default()).await.expect("an upload");
    session.id
}

/// The session that a message names to go on with.
#[track_caller]
fn named(said: &str) -> String {
    assert!(said.contains("goes on"), "{said}");
    said.rsplit_once("--session ").and_then(|(_, rest)| rest.split_whitespace().next()).expect("a session").to_owned()
}

#[test]
fn a_full_quota_leaves_a_session_that_is_gone_on_with_when_there_is_room() {
    let (dir, ..) = capture();
    // The cages of so many frames take more than a megabyte.
    let frames: Vec<Vec<f64>> = (0..100).flat_map(|_| Small::new().frames).collect();
    dir.frames("frames.npy", &frames);
    dir.cager(ENCODE).succeeds();
    let expected = dir.read("out.cager");
    std::fs::remove_file(dir.path("out.cager")).expect("a file");
    let mut server = Server::start_at(&dir, "127.0.0.1:0", &["--set", "tenant_max_bytes=1MiB"]);
    let said = dir.cager(&format!("{ENCODE} --server {}", server.address())).run();
    assert_eq!(said.status, Some(1));
    assert!(said.stderr.contains("delete those that are not needed any more"), "{}", said.stderr);
    let session = named(&said.stderr);
    assert_eq!(sessions(&server).iter().map(|s| s.id.as_str()).collect::<Vec<_>>(), [session.as_str()]);
    assert!(!dir.path("out.cager").exists());

    let place = server.place.clone();
    server.kill();
    let server = Server::start_at(&dir, &place, &[]);
    dir.cager(&format!("{ENCODE} --server {} --session {session}", server.address())).succeeds();
    assert!(dir.read("out.cager") == expected, "other bytes than on this machine");
}

#[test]
fn an_output_that_cannot_be_written_in_the_end_leaves_a_session_to_go_on_with() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    // Nothing larger than ten kilobytes can be written, as on a disk that is full.
    let line = format!(
        "ulimit -f 10; trap '' XFSZ; exec {} {ENCODE} --server {}",
        env!("CARGO_BIN_EXE_cager"),
        server.address()
    );
    let said = dir.command("bash", ["-c", &line]).run();
    assert_eq!(said.status, Some(1), "{}", said.stderr);
    let session = named(&said.stderr);
    assert!(!dir.path("out.cager").exists());
    dir.cager(&format!("{ENCODE} --server {} --session {session}", server.address())).succeeds();
    assert_eq!(sessions(&server).len(), 1);
}

#[test]
fn a_session_that_can_never_be_gone_on_with_says_where_to_look_at_it() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let session = begun(&server, &dir, points, &values);
    complete(&server, &session, 7);
    let encode = format!("{ENCODE} --server {}", server.address());
    let said = dir.cager(&format!("{encode} --session {session}")).run();
    assert_eq!(said.status, Some(1));
    let place = format!("{}/v1/sessions/{session} shows it", server.address());
    assert!(said.stderr.contains(&place) && !said.stderr.contains("goes on"), "{}", said.stderr);
    assert_eq!(sessions(&server)[0].state, SessionState::Completed, "it is still there");
    let said = dir.cager(&format!("{encode} --session 0123456789abcdef")).run();
    assert!(said.stderr.contains("leave out --session to begin a new one"), "{}", said.stderr);
}

#[tokio::main(flavor = "current_thread")]
async fn complete(server: &Server, session: &str, frames: u32) {
    server.client().complete(session, frames).await.expect("a completion");
}

#[test]
fn a_session_of_another_capture_is_refused_with_the_first_difference() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let session = begun(&server, &dir, points, &values);
    let right = ["rest.obj", "cage.obj", "frames.npy"].map(|name| (name, dir.read(name)));
    let encode = format!("{ENCODE} --server {} --session {session}", server.address());
    let refused = |options: &str, what: &str| {
        let said = dir.cager(&format!("{encode}{options}")).run();
        assert_eq!(said.status, Some(1), "{what}: {}", said.stderr);
        assert!(said.stderr.contains(what) && said.stderr.contains(&session), "{what}: {}", said.stderr);
        assert!(!dir.path("out.cager").exists());
        let now = sessions(&server);
        assert_eq!((now[0].state, now[0].frames.solved), (SessionState::Ready, 7), "{what}");
        right.iter().for_each(|(name, bytes)| dir.write(name, bytes));
    };
    let small = Small::new();
    let mut rest = small.rest.clone();
    rest.points[0][0] += 1e-3;
    dir.model("rest.obj", &rest);
    refused("", "the rest pose differs");
    let mut cage = small.cage.clone();
    cage.vertices[0][0] += 1e-3;
    dir.model("cage.obj", &as_model(&cage));
    refused("", "the cage differs");
    refused(" --coordinates green", "the option coordinates differs: the session has mvc, this command green");
    refused(" --lambda 0.5", "the option lambda differs: the session has 1.0, this command 0.5");
    refused(" --spectrum 5", "the option spectrum differs");
    refused(" --max-error 1e-3", "the option max_error differs: the session has none, this command 0.001");
    for changed in [0, 6] {
        let mut frames = small.frames.clone();
        frames[changed][5] += 0.25;
        dir.frames("frames.npy", &frames);
        refused("", &format!("frame {changed} differs"));
    }
    // Another part of the same capture, and a shorter one.
    refused(" --frames-range 1-19", "frame 0 differs");
    refused(" --frames-range 0-4", "the session has frame 6, and this capture only 5 frames");
    // What the session does not have yet may be anything.
    let mut frames = small.frames.clone();
    frames[12][5] += 0.25;
    dir.frames("frames.npy", &frames);
    dir.cager(&encode).succeeds();
    let gone_on = dir.read("out.cager");
    std::fs::remove_file(dir.path("out.cager")).expect("a file");
    dir.cager(ENCODE).succeeds();
    assert!(dir.read("out.cager") == gone_on, "other bytes than on this machine");
}

#[cfg(target_os = "linux")]
#[test]
fn an_upload_that_is_interrupted_says_how_to_go_on() {
    use crate::support::npy;
    use rustix::process::{Pid, Signal, kill_process};
    use std::io::Read;
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Command, Stdio};

    let (dir, points, _) = capture();
    let server = Server::start(&dir);
    // A capture that takes a while: all its points stay at the origin, in a file of holes.
    let frames = 20_000;
    let header = npy("<f4", false, &format!("({frames}, {points}, 3)"), &[]);
    dir.write("frames.npy", &header);
    let file = std::fs::OpenOptions::new().write(true).open(dir.path("frames.npy")).expect("frames.npy");
    file.set_len((header.len() + 12 * points * frames) as u64).expect("room for holes");
    let line = format!("{ENCODE} --server {}", server.address());
    for signal in [Signal::INT, Signal::TERM] {
        let before = sessions(&server);
        let is_new = |id: &str| before.iter().all(|known| known.id != id);
        let mut command = Command::new(env!("CARGO_BIN_EXE_cager"));
        let mut child = command
            .args(line.split_whitespace())
            .current_dir(dir.path(""))
            .stdin(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program runs");
        // Until it sends frames, so that it has heard of its session.
        while !sessions(&server).iter().any(|known| is_new(&known.id) && known.frames.received > 0) {
            assert!(child.try_wait().expect("a process").is_none(), "it ended before it could be interrupted");
        }
        kill_process(Pid::from_child(&child), signal).expect("a signal");
        let mut said = String::new();
        child.stderr.take().expect("stderr").read_to_string(&mut said).expect("text");
        assert_eq!(child.wait().expect("an end").signal(), Some(signal.as_raw()), "{said}");
        let session = named(&said);
        assert!(sessions(&server).iter().any(|known| known.id == session), "{said}");
    }
}
