//! `POST …/complete`: when a capture is whole, and that it stays as it is.

use crate::support::{Capture, OCTETS, Raw, TestApp};
use cager_proto::messages::{Session, SessionState};
use futures_util::future::join_all;
use serde_json::json;
use std::time::Duration;

#[tokio::test]
async fn missing_frames_are_listed() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    app.upload(&session.id, 2, capture.raw(2..4)).await;
    app.upload(&session.id, 7, capture.raw(7..8)).await;
    let problem = app.complete(&session.id, 10).await.problem(409, "frames-missing");
    assert_eq!(problem.missing, Some(vec![[0, 2], [4, 7], [8, 10]]));
    assert_eq!(app.session(&session.id).await.frames.missing, [[0, 2], [4, 7]]);
    for range in [0..2, 4..7, 8..10] {
        app.upload(&session.id, range.start, capture.raw(range)).await;
    }
    let done: Session = app.complete(&session.id, 10).await.is(200);
    assert_eq!((done.state, done.frames.solved), (SessionState::Completed, 10));
    assert!(done.frames.missing.is_empty());
}

#[tokio::test]
async fn completing_twice_is_completing_once() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.completed(capture, 5).await;
    let container = app.container(&session.id).await;
    let again = join_all((0..4).map(|_| app.complete(&session.id, 5))).await;
    for reply in again {
        assert_eq!(reply.is::<Session>(200).state, SessionState::Completed);
    }
    for other in [4, 6] {
        app.complete(&session.id, other).await.problem(409, "session-completed");
    }
    assert!(app.container(&session.id).await == container);
}

#[tokio::test]
async fn several_completions_at_once_agree() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..40)).await;
    for reply in join_all((0..6).map(|_| app.complete(&session.id, 40))).await {
        reply.expect(200);
    }
    assert!(app.container(&session.id).await == capture.encoded(40));
}

#[tokio::test]
async fn a_capture_cannot_have_fewer_frames_than_were_posted() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..6)).await;
    let problem = app.complete(&session.id, 4).await.problem(409, "frame-conflict");
    assert_eq!(problem.frame, Some(5));
    assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
    app.complete(&session.id, 6).await.expect(200);
}

#[tokio::test]
async fn a_number_of_frames_that_cannot_be_is_refused() {
    let app = TestApp::start();
    let session = app.ready(Capture::tiny()).await;
    let path = format!("/v1/sessions/{}/complete", session.id);
    app.complete(&session.id, 0).await.problem(422, "invalid-options");
    for body in
        [json!({"frames": -1}), json!({"frames": "3"}), json!({}), json!({"frames": 1, "more": 2}), json!([3, true])]
    {
        app.post_json(&path, &body).await.problem(422, "invalid-options");
    }
    app.post(&path, "application/json", "{\"frames\":").await.problem(400, "bad-request");
    app.post(&path, "text/plain", "{\"frames\":1}").await.problem(415, "media-type");
    assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
}

#[tokio::test]
async fn a_request_to_complete_that_stops_arriving_is_given_up() {
    let app = TestApp::with(&["body_timeout_s=1"]);
    let session = app.ready(Capture::tiny()).await;
    let mut raw = Raw::connect(&app).await;
    let path = format!("/v1/sessions/{}/complete", session.id);
    raw.head("POST", &path, &[("content-type", "application/json"), ("content-length", "12")]).await;
    raw.write(b"{\"frames\"").await;
    raw.reply().await.problem(408, "request-timeout");
    assert_eq!(app.session(&session.id).await.state, SessionState::Ready);
}

#[tokio::test]
async fn a_completed_session_takes_no_new_frames() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.completed(capture, 5).await;
    let (errors, container) = (app.errors(&session.id).await, app.container(&session.id).await);
    // What is there may still be repeated: an upload whose answer was lost is.
    assert_eq!(app.upload(&session.id, 1, capture.raw(1..4)).await, errors[1..4]);
    let path = format!("/v1/sessions/{}/frames?first=5", session.id);
    app.post(&path, OCTETS, capture.frame(5)).await.problem(409, "session-completed");
    let path = format!("/v1/sessions/{}/frames?first=1", session.id);
    app.post(&path, OCTETS, capture.frame(5)).await.problem(409, "frame-conflict");
    assert_eq!(app.errors(&session.id).await, errors);
    assert_eq!(app.session(&session.id).await.frames.solved, 5);
    assert!(app.container(&session.id).await == container);
}

#[tokio::test]
async fn a_frame_that_comes_during_completion_is_in_the_container_or_refused() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    for round in 0..12 {
        let session = app.ready(capture).await;
        app.upload(&session.id, 0, capture.raw(0..10)).await;
        let path = format!("/v1/sessions/{}/frames?first=10", session.id);
        let late = async {
            tokio::time::sleep(Duration::from_micros(500 * round)).await;
            app.post(&path, OCTETS, capture.frame(10)).await
        };
        let (completed, late) = tokio::join!(app.complete(&session.id, 10), late);
        let expected = match completed.status {
            200 => {
                late.problem(409, "session-completed");
                10
            }
            _ => {
                completed.problem(409, "frame-conflict");
                late.expect(200);
                11
            }
        };
        assert_eq!(app.errors(&session.id).await.len(), expected, "round {round}");
    }
}

#[tokio::test]
async fn a_completed_session_takes_no_new_frames_after_a_restart() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.completed(capture, 5).await;
    app.kill();
    let app = app.again();
    let path = format!("/v1/sessions/{}/frames?first=5", session.id);
    app.post(&path, OCTETS, capture.frame(5)).await.problem(409, "session-completed");
    assert_eq!(app.errors(&session.id).await.len(), 5);
}

#[tokio::test]
async fn a_frame_posted_beyond_the_end_by_mistake_can_be_left_out() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..4)).await;
    app.upload(&session.id, 4_000_000_000, capture.raw(5..6)).await;
    let path = format!("/v1/sessions/{}/complete", session.id);
    let problem = app.complete(&session.id, 4).await.problem(409, "frame-conflict");
    assert_eq!(problem.frame, Some(4_000_000_000));
    assert!(problem.detail.contains("discard_beyond"), "{}", problem.detail);
    let done: Session = app.post_json(&path, &json!({"frames": 4, "discard_beyond": true})).await.is(200);
    assert_eq!((done.frames.solved, done.frames.missing.len()), (4, 0));
    assert!(app.container(&session.id).await == capture.encoded(4));
    app.kill();
    let app = app.again();
    assert_eq!(app.errors(&session.id).await.len(), 4, "it comes back after a restart");
}
