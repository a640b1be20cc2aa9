//! After a restart, however it came, the service goes on where it was.

use crate::support::{Capture, OCTETS, Raw, TestApp, chunked, eventually, form, lines};
use cager_proto::messages::{CacheUse, Session, SessionState};
use serde_json::json;

#[tokio::test]
async fn a_session_goes_on_after_a_restart_and_ends_in_the_same_container() {
    let mut app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let handles = app.handles(&session.id).await;
    let first = app.upload(&session.id, 0, capture.raw(0..15)).await;
    let cages = app.cages(&session.id).await;
    app.terminate();
    assert!(app.ended().await.0.success());
    let app = app.again();
    assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
    assert_eq!(app.session(&session.id).await.frames.solved, 15);
    assert_eq!(app.handles(&session.id).await, handles);
    assert_eq!(app.errors(&session.id).await, first);
    assert!(app.cages(&session.id).await == cages);
    // What was sent before is known.
    assert_eq!(app.upload(&session.id, 10, capture.raw(10..15)).await, first[10..]);
    app.upload(&session.id, 15, capture.raw(15..40)).await;
    app.complete(&session.id, 40).await.expect(200);
    assert!(app.container(&session.id).await == capture.encoded(40));
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 0.0, "nothing was prepared again");
    assert_eq!(app.metric("cager_cache_total{result=\"disk\"}").await, 1.0, "the solver came from disk");
}

#[tokio::test]
async fn a_new_session_on_the_same_pair_prepares_nothing_after_a_restart() {
    let mut app = TestApp::start();
    let capture = Capture::small();
    app.ready(capture).await;
    app.solver_stored().await;
    app.kill();
    let app = app.again();
    let session = app.ready(capture).await;
    assert_eq!(session.cache, Some(CacheUse::Hit));
    assert_eq!(session.seconds.coordinates + session.seconds.svd, 0.0);
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 0.0);
}

#[tokio::test]
async fn no_frame_whose_record_was_sent_is_lost_when_the_process_is_killed() {
    let capture = Capture::small();
    let reference = TestApp::start();
    let whole = reference.completed(capture, 40).await;
    let expected = reference.container(&whole.id).await;
    for after in [1, 7, 23] {
        let mut app = TestApp::start();
        let session = app.ready(capture).await;
        let mut raw = Raw::connect(&app).await;
        raw.post_chunked(&format!("/v1/sessions/{}/frames?first=0&live=true", session.id), &[]).await;
        raw.write(&chunked(&capture.raw(0..30))).await;
        raw.answer().await.expect(200);
        let mut told = Vec::new();
        while told.len() < after {
            told.extend(lines(&raw.piece().await.expect("a record")));
        }
        app.kill();
        let app = app.again();
        let kept = app.errors(&session.id).await;
        assert!(told.iter().all(|record| kept.contains(record)), "told {told:?}, kept {kept:?}");
        let missing = app.session(&session.id).await.frames.missing;
        app.upload(&session.id, 0, capture.raw(0..40)).await;
        app.complete(&session.id, 40).await.expect(200);
        assert!(app.container(&session.id).await == expected, "killed after {after} records; missing {missing:?}");
    }
}

#[tokio::test]
async fn what_was_being_prepared_is_prepared_after_a_restart() {
    let mut app = TestApp::start();
    let capture = Capture::new(6000, 250, 2);
    let session = app.create(&capture).await;
    app.kill();
    let app = app.again();
    app.prepared(&session.id).await;
    assert_eq!(app.upload(&session.id, 0, capture.raw(0..2)).await.len(), 2);
}

#[tokio::test]
async fn a_rest_pose_that_a_crash_left_without_a_session_is_removed() {
    let mut app = TestApp::with_its_files(&[]);
    let kept = app.ready(Capture::tiny()).await;
    let lost = app.ready(Capture::small()).await;
    app.kill();
    let contents = app.session_file(&kept.id, "../../contents");
    let count = || std::fs::read_dir(&contents).expect("a folder").count();
    assert_eq!(count(), 2);
    // As when the service ended before it made the record.
    app.set_record(&lost.id, "phase = 17");
    let app = app.again();
    app.prepared(&kept.id).await;
    assert_eq!(count(), 1);
}

#[tokio::test]
async fn a_damaged_container_is_found_written_again_and_counted_once() {
    let mut app = TestApp::with_its_files(&[]);
    let capture = Capture::small();
    let session = app.completed(capture, 40).await;
    let expected = app.container(&session.id).await;
    let stored = "cager_stored_bytes{tenant=\"local\"}";
    app.kill();
    app = app.again();
    let before = app.metric(stored).await;
    app.kill();
    let file = app.session_file(&session.id, "capture.cager");
    let mut bytes = std::fs::read(&file).expect("a container");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&file, bytes).expect("a container");
    let app = app.again();
    let found = async || (app.session(&session.id).await.state == SessionState::Ready).then_some(());
    eventually("that the damage is found", found).await;
    let problem = app.session(&session.id).await.problem.expect("a problem");
    assert!(problem.detail.contains("complete the session again"), "{}", problem.detail);
    app.get(&format!("/v1/sessions/{}/capture.cager", session.id)).await.problem(503, "storage-failed");
    assert_eq!(app.metric("cager_quarantined_total").await, 1.0);
    app.complete(&session.id, 40).await.expect(200);
    assert_eq!(app.session(&session.id).await.problem, None);
    assert!(app.container(&session.id).await == expected, "the same bytes");
    assert_eq!(app.metric(stored).await, before);
}

/// As after an upgrade: the session was made by an older version, and the solvers that it prepared are gone.
fn age(app: &TestApp, id: &str) {
    app.rewrite(id, "meta", |body| body["solver_version"] = 1.into());
    for solver in std::fs::read_dir(app.session_file(id, "../../prepared")).expect("a folder") {
        std::fs::remove_file(solver.expect("a file").path()).expect("a file");
    }
}

#[tokio::test]
async fn an_open_session_goes_on_after_an_upgrade() {
    let mut app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let first = app.upload(&session.id, 0, capture.raw(0..10)).await;
    app.kill();
    age(&app, &session.id);
    let app = app.again();
    assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
    assert_eq!(app.errors(&session.id).await, first);
    app.upload(&session.id, 10, capture.raw(10..20)).await;
    app.complete(&session.id, 20).await.expect(200);
    assert!(app.container(&session.id).await == capture.encoded(20));
}

#[tokio::test]
async fn a_session_whose_handles_are_others_after_an_upgrade_says_so_and_keeps_its_frames() {
    let mut app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..10)).await;
    let cages = app.cages(&session.id).await;
    app.kill();
    age(&app, &session.id);
    app.rewrite(&session.id, "outcome", |body| {
        body["ready"]["handles_digest"] = blake3::hash(b"others").to_hex().to_string().into();
    });
    let app = app.again();
    let path = format!("/v1/sessions/{}/frames?first=10", session.id);
    let problem = app.post(&path, OCTETS, capture.raw(10..11)).await.problem(409, "session-failed");
    assert!(problem.detail.contains("upgraded"), "{}", problem.detail);
    assert!(app.cages(&session.id).await == cages, "what was answered stays");
}

#[tokio::test]
async fn a_session_that_codes_frames_goes_on_as_it_began_after_what_is_usual_changed() {
    let mut app = TestApp::start();
    let capture = Capture::small();
    let usual_then = json!({ "max_error": 1e-2, "handles": "spread", "lambda": 1.0 });
    let made = async |app: &TestApp| {
        let created: Session = app.create_with(form(capture, &usual_then), None).await.is(201);
        app.prepared(&created.id).await
    };
    let (session, whole) = (made(&app).await, made(&app).await);
    app.upload(&whole.id, 0, capture.raw(0..20)).await;
    app.complete(&whole.id, 20).await.expect(200);
    let expected = app.container(&whole.id).await;
    app.upload(&session.id, 0, capture.raw(0..10)).await;
    app.kill();
    age(&app, &session.id);
    app.rewrite(&session.id, "meta", |body| {
        body["options"] = json!({ "max_error": 1e-2 });
    });
    let app = app.again();
    let view = app.session(&session.id).await;
    assert_eq!((view.handles.as_str(), view.spectrum, view.lambda), ("spread", session.spectrum, 1.0));
    app.upload(&session.id, 10, capture.raw(10..20)).await;
    app.complete(&session.id, 20).await.expect(200);
    assert!(app.container(&session.id).await == expected);
}

#[tokio::test]
async fn a_session_whose_mark_of_completion_is_damaged_is_completed_again_and_hides_nothing() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.completed(capture, 15).await;
    let container = app.container(&session.id).await;
    app.kill();
    app.set_bytes(&session.id, "completion", "7b7d");
    app = app.again();
    assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
    assert!(app.session(&session.id).await.problem.is_some());
    assert_eq!(app.metric("cager_quarantined_total").await, 1.0);
    let frames = format!("/v1/sessions/{}/frames?first=15", session.id);
    app.post(&frames, OCTETS, capture.raw(15..20)).await.problem(409, "session-completed");
    app.complete(&session.id, 15).await.expect(200);
    assert!(app.container(&session.id).await == container);
}

#[tokio::test]
async fn a_session_whose_rest_pose_is_missing_says_so_until_it_is_back() {
    let mut app = TestApp::with_its_files(&[]);
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..20)).await;
    app.kill();
    let (there, away) = (app.data().join("contents"), app.data().join("away"));
    std::fs::rename(&there, &away).expect("a folder");
    // As when it was prepared by a process that ended before it could say so.
    app.set_record(&session.id, "outcome = NULL");
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
async fn a_container_that_cannot_be_read_is_served_when_it_can() {
    let mut app = TestApp::with_its_files(&[]);
    let session = app.completed(Capture::tiny(), 15).await;
    let container = app.container(&session.id).await;
    app.kill();
    // A folder in its place, which nobody can read, not even an administrator.
    let (file, aside) = (app.session_file(&session.id, "capture.cager"), app.data().join("aside"));
    std::fs::rename(&file, &aside).expect("a file");
    std::fs::create_dir(&file).expect("a folder");
    app = app.again();
    assert_eq!(app.session(&session.id).await.state, SessionState::Completed);
    app.get(&format!("/v1/sessions/{}/capture.cager", session.id)).await.expect(503);
    std::fs::remove_dir(&file).expect("a folder");
    std::fs::rename(&aside, &file).expect("a file");
    assert!(app.container(&session.id).await == container);
}
