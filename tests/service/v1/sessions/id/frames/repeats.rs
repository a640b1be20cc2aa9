//! Frames that are posted again: the same ones change nothing, others are refused.

use crate::support::{Capture, OCTETS, TestApp, lines};
use cager_proto::messages::Problem;
use futures_util::future::join_all;

#[tokio::test]
async fn the_same_frames_again_get_the_same_answer_and_cost_nothing() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let first = app.upload(&session.id, 0, capture.raw(0..10)).await;
    let (cages, written) = (app.cages(&session.id).await, app.metric("cager_log_bytes_total").await);
    assert!(written > 0.0);
    for range in [0..10, 3..5, 9..10] {
        let again = app.upload(&session.id, range.start, capture.raw(range.clone())).await;
        assert_eq!(again, first[range.start as usize..range.end as usize]);
    }
    assert_eq!(app.metric("cager_log_bytes_total").await, written, "nothing was written");
    assert!(app.cages(&session.id).await == cages);
    assert_eq!(app.session(&session.id).await.frames.solved, 10);
}

#[tokio::test]
async fn the_same_frames_over_many_connections_at_once_are_solved_once() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let connections: Vec<_> = (0..12).map(|_| app.stranger()).collect();
    let answers = join_all(connections.iter().map(|api| api.upload(&session.id, 0, capture.raw(0..20)))).await;
    assert!(answers.iter().all(|answer| *answer == answers[0] && answer.len() == 20), "all hear the same");
    assert_eq!(app.metric("cager_frames_total{tenant=\"local\",rows=\"all\"}").await, 20.0);
}

#[tokio::test]
async fn other_bytes_are_a_conflict_and_nothing_changes() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let handles = app.handles(&session.id).await;
    app.upload(&session.id, 0, capture.raw(0..5)).await;
    let (cages, errors) = (app.cages(&session.id).await, app.errors(&session.id).await);
    let at = |query: &str| format!("/v1/sessions/{}/frames?{query}", session.id);
    // Another frame; and one bit, in a point that the inversion does not even read.
    let mut nearly = capture.frame(3);
    let unread = (0..capture.points()).find(|&point| !handles.contains(&(point as u32))).expect("not all are handles");
    nearly[12 * unread] ^= 1;
    for body in [capture.frame(4), nearly] {
        let problem = app.post(&at("first=3"), OCTETS, body).await.problem(409, "frame-conflict");
        assert_eq!(problem.frame, Some(3));
        assert!(problem.detail.contains("frame 3"), "{}", problem.detail);
    }
    let other_rows = capture.handle_rows(4..5, &handles);
    app.post(&at("first=3&rows=handles"), OCTETS, other_rows).await.problem(409, "frame-conflict");
    assert!(app.cages(&session.id).await == cages);
    assert_eq!(app.errors(&session.id).await, errors);
    assert_eq!(app.session(&session.id).await.frames.received, 5);
    // The handle rows of what is there are the same frame.
    let same_rows = capture.handle_rows(3..4, &handles);
    let answer = app.post(&at("first=3&rows=handles"), OCTETS, same_rows).await.expect(200);
    assert_eq!(lines(&answer.body), errors[3..4]);
    // And the right frame still goes.
    assert_eq!(app.upload(&session.id, 3, capture.frame(3)).await, errors[3..4]);
}

#[tokio::test]
async fn whole_frames_after_their_handle_rows_are_measured() {
    let mut app = TestApp::start();
    let capture = Capture::small();
    let (session, whole) = (app.ready(capture).await, app.ready(capture).await);
    let measured = app.upload(&whole.id, 0, capture.raw(0..6)).await;
    let handles = app.handles(&session.id).await;
    let rows = format!("/v1/sessions/{}/frames?first=0&rows=handles", session.id);
    let unmeasured = lines(&app.post(&rows, OCTETS, capture.handle_rows(0..6, &handles)).await.expect(200).body);
    assert!(unmeasured.iter().all(|result| result.l2.is_none()));
    let cages = app.cages(&session.id).await;
    assert_eq!(app.upload(&session.id, 0, capture.raw(0..4)).await, measured[..4]);
    let expected = [&measured[..4], &unmeasured[4..]].concat();
    for again in [false, true] {
        if again {
            app.kill();
            app = app.again();
        }
        assert_eq!(app.errors(&session.id).await, expected, "restarted: {again}");
        let counts = app.session(&session.id).await.frames;
        assert_eq!((counts.solved, counts.received), (6, 6));
    }
    assert!(app.cages(&session.id).await.len() == cages.len());
    let unknowns = session.unknowns.expect("it is ready");
    assert_eq!(
        crate::support::cages_of(&app.cages(&session.id).await, unknowns),
        crate::support::cages_of(&cages, unknowns)
    );
    let path = format!("/v1/sessions/{}/frames?first=5", session.id);
    app.post(&path, OCTETS, capture.frame(7)).await.problem(409, "frame-conflict");
    app.complete(&session.id, 6).await.expect(200);
    // What was completed does not change.
    assert_eq!(app.upload(&session.id, 4, capture.frame(4)).await, unmeasured[4..5]);
}

#[tokio::test]
async fn a_conflict_within_an_upload_ends_it_with_the_reason() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    app.upload(&session.id, 20, capture.frame(21)).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    let reply = app.post(&path, OCTETS, capture.raw(0..30)).await;
    if reply.status != 200 {
        // Nothing was answered before it.
        reply.problem(409, "frame-conflict");
        return;
    }
    let text = reply.text();
    let last = text.lines().last().expect("a line");
    let problem: Problem = serde_json::from_str(last).expect("the last line is a problem");
    assert_eq!((problem.word(), problem.frame), ("frame-conflict", Some(20)));
    let told = lines(&reply.body[..reply.body.len() - last.len() - 1]);
    let kept: Vec<u32> = app.errors(&session.id).await.iter().map(|result| result.frame).collect();
    assert!(told.iter().all(|result| kept.contains(&result.frame)), "what was answered is kept");
}
