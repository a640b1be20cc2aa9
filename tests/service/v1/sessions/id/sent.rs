//! `GET …/sent`: what a session was sent.

use crate::support::{Capture, OCTETS, TestApp, cage_form_of, file, form, text};
use cager_proto::messages::{Sent, Session};
use serde_json::json;

fn half_digest(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex()[..32].to_owned()
}

#[tokio::test]
async fn options_and_digests_of_what_was_sent_are_told_even_after_a_restart() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let options = json!({"name": "told", "lambda": 0.5});
    let created: Session = app.create_with(form(capture, &options), None).await.is(201);
    let id = app.prepared(&created.id).await.id;
    let path = format!("/v1/sessions/{id}/sent");
    app.upload(&id, 3, capture.raw(3..6)).await;
    let handles = app.handles(&id).await;
    let rows = capture.handle_rows(9..10, &handles);
    app.post(&format!("/v1/sessions/{id}/frames?first=9&rows=handles"), OCTETS, rows.clone()).await.expect(200);
    let sent: Sent = app.get(&path).await.is(200);
    assert_eq!((sent.options.name.as_deref(), sent.options.lambda), (Some("told"), Some(0.5)));
    assert_eq!((sent.rest.name.as_str(), sent.rest.bytes), ("rest.obj", capture.rest.obj.len() as u64));
    assert_eq!(sent.rest.blake3, blake3::hash(&capture.rest.obj).to_hex().as_str());
    assert_eq!(sent.cage.as_ref().expect("a cage").blake3, blake3::hash(&capture.cage.obj).to_hex().as_str());
    assert_eq!(sent.regularizer_matrix, None);
    let digests = |sent: &Sent| -> Vec<(u32, bool, String)> {
        sent.frames.iter().map(|frame| (frame.frame, frame.handles_only, frame.blake3.clone())).collect()
    };
    let mut expected: Vec<_> = (3..6).map(|frame| (frame, false, half_digest(&capture.frame(frame)))).collect();
    expected.push((9, true, half_digest(&rows)));
    assert_eq!((digests(&sent), sent.next), (expected.clone(), None));
    app.kill();
    let app = app.again();
    assert_eq!(app.get(&path).await.is::<Sent>(200), sent);
    assert_eq!(app.client().sent(&id).await.expect("what was sent"), sent);
    let rest: Sent = app.get(&format!("{path}?first=5")).await.is(200);
    assert_eq!(digests(&rest), expected[2..]);
    app.get(&format!("{path}?frist=5")).await.problem(400, "bad-request");
    app.get("/v1/sessions/none/sent").await.problem(404, "not-found");
}

#[tokio::test]
async fn a_cage_that_was_not_sent_is_not_told_as_one() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let made = reqwest::multipart::Form::new().part("rest", file("rest.obj", &capture.rest.obj));
    let made: Session =
        app.create_with(made.part("options", text(&json!({"cage": {"vertices": 60}}))), None).await.is(201);
    let options = json!({"frames": 2, "vertices": 32, "time_limit_s": 10.0});
    let design = cage_form_of(&capture.rest.obj, "frames.f32", &capture.raw(0..2), &options);
    let design: cager_proto::cage_messages::CageJob = app.design_with(design, None).await.is(202);
    app.designed(&design.id).await;
    let designed = reqwest::multipart::Form::new().part("rest", file("rest.obj", &capture.rest.obj));
    let options = text(&json!({"cage": {"id": design.id}}));
    let designed: Session = app.create_with(designed.part("options", options), None).await.is(201);
    for session in [made, designed] {
        let sent: Sent = app.get(&format!("/v1/sessions/{}/sent", session.id)).await.is(200);
        assert!(sent.cage.is_none() && sent.options.cage.is_some(), "{sent:?}");
    }
}
