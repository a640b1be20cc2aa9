//! Frames that depend on the ones before them: they have to come in order, and go on where they ended after a restart.

use crate::support::{Capture, OCTETS, TestApp, form, lines};
use cager_proto::messages::Session;
use serde_json::{Value, json};

fn temporal() -> Value {
    json!({"regularizer": "temporal", "spectrum": 20})
}

async fn ready(app: &TestApp, capture: &Capture) -> Session {
    let session: Session = app.create_with(form(capture, &temporal()), None).await.expect(201).json();
    app.prepared(&session.id).await
}

#[tokio::test]
async fn a_frame_whose_predecessor_is_missing_is_refused_with_its_number() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = ready(&app, capture).await;
    let path = |query: &str| format!("/v1/sessions/{}/frames?{query}", session.id);
    let problem = app.post(&path("first=3"), OCTETS, capture.raw(3..5)).await.problem(409, "frames-missing");
    assert_eq!((problem.frame, problem.missing), (Some(3), Some(vec![[2, 3]])));
    assert!(problem.detail.contains("frame 3 depends on frame 2"), "{}", problem.detail);
    app.upload(&session.id, 0, capture.raw(0..3)).await;
    let answer = app.post(&path("first=3"), OCTETS, capture.raw(3..5)).await.expect(200);
    assert_eq!(lines(&answer.body).len(), 2);
    // What is there already needs no predecessor, and a gap stays one.
    app.upload(&session.id, 2, capture.raw(2..4)).await;
    app.post(&path("first=9"), OCTETS, capture.raw(9..10)).await.problem(409, "frames-missing");
    let frames = app.session(&session.id).await.frames;
    assert_eq!((frames.received, frames.solved), (5, 5));
}

#[tokio::test]
async fn any_pieces_in_order_give_the_same_cages_also_across_restarts() {
    let mut app = TestApp::start();
    let capture = Capture::small();
    let whole = ready(&app, capture).await;
    app.upload(&whole.id, 0, capture.raw(0..capture.count())).await;
    let expected = app.cages(&whole.id).await;

    let pieces = ready(&app, capture).await;
    let handles = app.handles(&pieces.id).await;
    app.upload(&pieces.id, 0, capture.raw(0..1)).await;
    app.upload(&pieces.id, 1, capture.raw(1..18)).await;
    app.kill();
    app = app.again();
    let path = format!("/v1/sessions/{}/frames?first=18&rows=handles", pieces.id);
    app.post(&path, OCTETS, capture.handle_rows(18..20, &handles)).await.expect(200);
    app.upload(&pieces.id, 20, capture.raw(20..21)).await;
    app.kill();
    app = app.again();
    app.upload(&pieces.id, 21, capture.raw(21..capture.count())).await;
    assert!(app.cages(&pieces.id).await == expected);
    app.complete(&pieces.id, capture.count()).await.expect(200);

    let single = ready(&app, capture).await;
    for frame in 0..capture.count() {
        app.upload(&single.id, frame, capture.raw(frame..frame + 1)).await;
    }
    assert!(app.cages(&single.id).await == expected);
}
