//! Files that cannot be read: left where they are, told of, and served again as soon as they can be read.

use crate::support::{Capture, TestApp};
use cager_proto::cage_messages::{CageJob, CageState};
use cager_proto::messages::{SessionList, SessionState};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A file with a folder in its place, which nobody can read, not even an administrator.
struct Obstructed(PathBuf);

impl Obstructed {
    fn new(file: PathBuf) -> Self {
        std::fs::rename(&file, Self::aside(&file)).expect("a file");
        std::fs::create_dir(&file).expect("a folder");
        Self(file)
    }

    fn aside(file: &Path) -> PathBuf {
        file.parent().and_then(Path::parent).expect("a folder").join("../aside")
    }

    fn clear(self) {
        std::fs::remove_dir(&self.0).expect("a folder");
        std::fs::rename(Self::aside(&self.0), &self.0).expect("a file");
    }
}

fn contents(app: &TestApp) -> usize {
    std::fs::read_dir(app.session_file("", "../contents")).expect("a folder").count()
}

async fn told(app: &TestApp, sessions: usize, cages: usize) {
    let ready: Value = app.get("/readyz").await.is(200);
    let detail = ready["detail"].as_str().unwrap_or_default();
    let expected = format!("{sessions} sessions, {cages} cage designs, 0 recoveries and 0 transfers cannot be read");
    assert_eq!(detail.starts_with(&expected), sessions + cages > 0, "{ready}");
    assert_eq!(app.metric("cager_unread{what=\"sessions\"}").await, sessions as f64);
    assert_eq!(app.metric("cager_unread{what=\"cages\"}").await, cages as f64);
}

#[tokio::test]
async fn a_session_that_cannot_be_read_at_the_start_is_kept_whole_and_served_again() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}", session.id);
    let results = app.upload(&session.id, 0, capture.raw(0..20)).await;
    for restarted in [false, true] {
        app.kill();
        let file = app.session_file(&session.id, "session.json");
        let obstructed = Obstructed::new(file.clone());
        app = app.again();
        assert_eq!(contents(&app), 1, "its rest pose and cage stay");
        told(&app, 1, 0).await;
        assert!(app.log().contains(file.to_str().expect("a path")), "{}", app.log());
        assert_eq!(std::fs::read_dir(app.session_file("", "../quarantine")).expect("a folder").count(), 0);
        for path in [&path, &format!("{path}/errors"), &format!("{path}/cages?first=0")] {
            assert!(!app.get(path).await.retry_after().is_zero());
            app.get(path).await.problem(503, "storage-failed");
        }
        app.delete(&path).await.problem(503, "storage-failed");
        obstructed.clear();
        if restarted {
            app.kill();
            app = app.again();
        }
        assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
        told(&app, 0, 0).await;
        assert_eq!(app.errors(&session.id).await, results);
    }
    app.complete(&session.id, 20).await.expect(200);
    assert!(app.container(&session.id).await == capture.encoded(20));
}

#[tokio::test]
async fn the_content_of_a_session_that_cannot_be_read_outlives_its_other_sessions() {
    let mut app = TestApp::start();
    let (session, twin) = (app.ready(Capture::tiny()).await, app.ready(Capture::tiny()).await);
    app.kill();
    let obstructed = Obstructed::new(app.session_file(&session.id, "session.json"));
    app = app.again();
    app.delete(&format!("/v1/sessions/{}", twin.id)).await.expect(204);
    assert_eq!(contents(&app), 1);
    obstructed.clear();
    app.upload(&session.id, 0, Capture::tiny().raw(0..20)).await;
    app.complete(&session.id, 20).await.expect(200);
}

#[tokio::test]
async fn a_session_whose_mark_of_completion_cannot_be_read_takes_no_frame_that_would_be_hidden() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.completed(capture, 15).await;
    let container = app.container(&session.id).await;
    app.kill();
    let obstructed = Obstructed::new(app.session_file(&session.id, "complete.json"));
    app = app.again();
    told(&app, 1, 0).await;
    let frames = format!("/v1/sessions/{}/frames?first=15", session.id);
    app.post(&frames, crate::support::OCTETS, capture.raw(15..20)).await.problem(503, "storage-failed");
    let listed: SessionList = app.get("/v1/sessions").await.is(200);
    assert_eq!(listed.sessions[0].state, SessionState::Failed);
    obstructed.clear();
    assert_eq!(app.session(&session.id).await.state, SessionState::Completed);
    assert!(app.container(&session.id).await == container);
    told(&app, 0, 0).await;
    app.post(&frames, crate::support::OCTETS, capture.raw(15..20)).await.problem(409, "session-completed");
}

#[tokio::test]
async fn a_session_whose_mark_of_completion_is_damaged_is_completed_again_and_hides_nothing() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.completed(capture, 15).await;
    let container = app.container(&session.id).await;
    app.kill();
    std::fs::write(app.session_file(&session.id, "complete.json"), "{}").expect("a file");
    app = app.again();
    assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
    let frames = format!("/v1/sessions/{}/frames?first=15", session.id);
    app.post(&frames, crate::support::OCTETS, capture.raw(15..20)).await.problem(409, "session-completed");
    app.complete(&session.id, 15).await.expect(200);
    assert!(app.container(&session.id).await == container);
}

#[tokio::test]
async fn a_session_whose_frames_cannot_be_read_says_so_disturbs_no_other_and_can_be_deleted() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let (session, other, gone) = (app.ready(capture).await, app.ready(capture).await, app.ready(capture).await);
    let results = app.upload(&session.id, 0, capture.raw(0..20)).await;
    app.kill();
    let obstructed = Obstructed::new(app.session_file(&session.id, "frames.log"));
    let log = app.session_file(&gone.id, "frames.log");
    std::fs::remove_file(&log).expect("a log");
    std::fs::create_dir(&log).expect("a folder");
    app = app.again();
    let path = format!("/v1/sessions/{}", session.id);
    for _ in 0..2 {
        app.get(&path).await.problem(503, "storage-failed");
        app.get(&format!("{path}/errors")).await.problem(503, "storage-failed");
    }
    let listed: SessionList = app.get("/v1/sessions").await.is(200);
    let states: Vec<_> = listed.sessions.iter().map(|session| session.state).collect();
    assert_eq!(states, [SessionState::Failed, SessionState::Ready, SessionState::Failed]);
    app.upload(&other.id, 0, capture.raw(0..20)).await;
    app.delete(&format!("/v1/sessions/{}", gone.id)).await.expect(204);
    app.get(&format!("/v1/sessions/{}", gone.id)).await.problem(404, "not-found");
    obstructed.clear();
    assert_eq!(app.errors(&session.id).await, results);
}

#[tokio::test]
async fn a_session_whose_rest_pose_is_missing_says_so_until_it_is_back() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..20)).await;
    app.kill();
    let (there, away) = (app.session_file("", "../contents"), app.session_file("", "../away"));
    std::fs::rename(&there, &away).expect("a folder");
    // As when it was prepared by a process that ended before it could say so.
    std::fs::remove_file(app.session_file(&session.id, "outcome.json")).expect("a file");
    app = app.again();
    let failed = app.settled(&session.id).await;
    assert_eq!(failed.problem.expect("a problem").word(), "session-failed");
    app.kill();
    std::fs::remove_dir_all(&there).expect("a folder");
    std::fs::rename(&away, &there).expect("a folder");
    app = app.again();
    app.prepared(&session.id).await;
    app.complete(&session.id, 20).await.expect(200);
    assert!(app.container(&session.id).await == capture.encoded(20));
}

#[tokio::test]
async fn a_cage_design_that_cannot_be_read_is_kept_and_served_again() {
    let mut app = TestApp::start();
    let job = app.design(Capture::tiny(), &json!({"vertices": 32, "time_limit_s": 1.0})).await;
    let job = app.designed(&job.id).await;
    let lost = app.ready(Capture::tiny()).await;
    let path = format!("/v1/cages/{}", job.id);
    for name in ["job.json", "outcome.json"] {
        app.kill();
        // Where all could be read, its rest pose and cage would be nobody's.
        let _ = std::fs::remove_dir_all(app.session_file(&lost.id, ""));
        let obstructed = Obstructed::new(app.cage_file(&job.id, name));
        app = app.again();
        assert_eq!(contents(&app), 1, "{name}");
        told(&app, 0, 1).await;
        app.get(&path).await.problem(503, "storage-failed");
        obstructed.clear();
        assert_eq!(app.get(&path).await.is::<CageJob>(200), job, "{name}");
        app.get(&format!("{path}/cage.obj")).await.expect(200);
        told(&app, 0, 0).await;
    }
    app.kill();
    app = app.again();
    assert_eq!(contents(&app), 0, "all can be read");
    app.kill();
    let obstructed = Obstructed::new(app.cage_file(&job.id, "outcome.json"));
    app = app.again();
    app.delete(&path).await.expect(204);
    told(&app, 0, 0).await;
    assert_ne!(app.get(&path).await.status, 200);
    assert!(!obstructed.0.exists());
    assert_eq!(job.state, CageState::Completed);
}
