//! After a restart, however it came, the service goes on where it was.

use crate::support::{Capture, Raw, TestApp, chunked, lines};
use cager_proto::messages::{CacheUse, SessionState};

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
    let mut app = TestApp::start();
    let kept = app.ready(Capture::tiny()).await;
    let lost = app.ready(Capture::small()).await;
    app.kill();
    let contents = app.session_file(&kept.id, "../../contents");
    let count = || std::fs::read_dir(&contents).expect("a folder").count();
    assert_eq!(count(), 2);
    std::fs::remove_dir_all(app.session_file(&lost.id, "")).expect("a session");
    let app = app.again();
    app.prepared(&kept.id).await;
    assert_eq!(count(), 1);
}
