//! `DELETE /v1/sessions/{id}`: what is gone is gone, and streams of it say so.

use crate::support::{Capture, OCTETS, RECORDS, Raw, TestApp, chunked, eventually, piece};
use cager_proto::messages::{Problem, SessionState};
use http::Method;

#[tokio::test]
async fn a_deleted_session_is_unknown_everywhere_and_takes_no_space() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.completed(capture, 5).await;
    let at = format!("/v1/sessions/{}", session.id);
    assert!(app.metric("cager_stored_bytes{tenant=\"local\"}").await > 0.0);
    assert_eq!(app.delete(&at).await.expect(204).body.len(), 0);
    for what in ["", "/cages?first=0", "/errors", "/cage", "/handles", "/coordinates", "/events", "/capture.cager"] {
        app.get(&format!("{at}{what}")).await.problem(404, "not-found");
    }
    app.post(&format!("{at}/frames?first=0"), OCTETS, capture.frame(0)).await.problem(404, "not-found");
    app.delete(&at).await.problem(404, "not-found");
    assert_eq!(app.metric("cager_stored_bytes{tenant=\"local\"}").await, 0.0);
    let mut app = app;
    app.kill();
    let app = app.again();
    app.get(&at).await.problem(404, "not-found");
}

#[tokio::test]
async fn deleting_ends_uploads_followers_and_events() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let at = |what: &str| format!("/v1/sessions/{}{what}", session.id);
    let mut upload = Raw::connect(&app).await;
    upload.post_chunked(&at("/frames?first=0&live=true"), &[]).await;
    upload.write(&chunked(&capture.frame(0))).await;
    upload.answer().await.expect(200);
    upload.piece().await.expect("a record");
    let mut follower = app.open(&at("/cages?first=0&follow=true")).await;
    piece("a beginning", &mut follower).await.expect("a stream").expect("a cage");
    let records = app.request(Method::GET, &at("/cages?first=0&follow=true")).header("accept", RECORDS);
    let mut records = records.send().await.expect("an answer");
    piece("a beginning", &mut records).await.expect("a stream").expect("a record");
    let mut events = app.http2().open(&at("/events")).await;
    piece("a beginning", &mut events).await.expect("a stream").expect("an event");
    let mut decoding = Raw::connect(&app).await;
    decoding.post_chunked(&at("/decode"), &[]).await;

    app.delete(&at("")).await.expect(204);

    let last = upload.piece().await.expect("a last line");
    let problem: Problem = serde_json::from_slice(&last).expect("a problem");
    assert_eq!((problem.status, problem.word()), (410, "session-deleted"));
    assert!(upload.piece().await.is_none());
    // Who ends in good order has all there is.
    piece("the end of the cages", &mut follower).await.expect_err("cut off");
    piece("the end of the records", &mut records).await.expect_err("cut off");
    let told = piece("a last event", &mut events).await.expect("a stream").expect("an event");
    assert!(std::str::from_utf8(&told).expect("UTF-8").contains("event: deleted"), "{told:?}");
    assert_eq!(piece("the end of the events", &mut events).await.expect("a clean end"), None);
    decoding.reply().await.problem(410, "session-deleted");
    eventually("all places are free", async || (app.metric("cager_streams").await == 0.0).then_some(())).await;
}

#[tokio::test]
async fn deleting_under_an_upload_is_no_fault_of_the_disk() {
    let app = TestApp::start();
    let capture = Capture::small();
    for _ in 0..5 {
        let session = app.ready(capture).await;
        let (api, id) = (app.stranger(), session.id.clone());
        let path = format!("/v1/sessions/{id}/frames?first=0");
        let upload = tokio::spawn(async move { api.post(&path, OCTETS, capture.raw(0..40).repeat(100)).await });
        eventually("frames are solved", async || (app.session(&id).await.frames.solved > 0).then_some(())).await;
        app.delete(&format!("/v1/sessions/{id}")).await.expect(204);
        upload.await.expect("an answer");
    }
    assert!(!app.log().contains(" WARN "), "{}", app.log());
}

#[tokio::test]
async fn a_session_can_be_deleted_while_it_is_prepared() {
    let app = TestApp::start();
    let capture = Capture::new(8000, 300, 1);
    let session = app.create(&capture).await;
    app.delete(&format!("/v1/sessions/{}", session.id)).await.expect(204);
    app.get(&format!("/v1/sessions/{}", session.id)).await.problem(404, "not-found");
    // The same content can come again.
    let again = app.create(&capture).await;
    assert_eq!(app.settled(&again.id).await.state, SessionState::Ready);
}

#[tokio::test]
async fn deleting_one_leaves_another_of_the_same_content() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let (one, other) = (app.ready(capture).await, app.ready(capture).await);
    app.delete(&format!("/v1/sessions/{}", one.id)).await.expect(204);
    app.upload(&other.id, 0, capture.raw(0..5)).await;
    app.complete(&other.id, 5).await.expect(200);
    assert!(app.container(&other.id).await == capture.encoded(5));
}
