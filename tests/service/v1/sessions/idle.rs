//! Frames of sessions that nobody uses leave memory, and are there again when they are asked for.

use crate::support::{Api, Capture, OCTETS, TestApp, eventually, form};
use cager_proto::messages::Session;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Asks the service to forget what it can, until so many sessions' frames are forgotten; what has just been answered may be in use for a moment.
async fn forgotten(operator: &Api, sessions: u64) {
    let sum = AtomicU64::new(0);
    eventually("frames are forgotten", async || {
        let told: Value = operator.post_json("/admin/evict", &json!({})).await.is(200);
        let more = told["sessions"].as_u64().expect("a number");
        (sum.fetch_add(more, Relaxed) + more == sessions).then_some(())
    })
    .await;
}

#[tokio::test]
async fn frames_that_nobody_uses_leave_memory_and_come_back() {
    let port = std::net::TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port").port();
    let app = TestApp::with(&[&format!("admin_listen=127.0.0.1:{port}")]);
    let operator = Api::new(std::net::SocketAddr::from(([127, 0, 0, 1], port)), None, false);
    let capture = Capture::tiny();
    let done = app.completed(capture, 15).await;
    let open = app.ready(capture).await;
    app.upload(&open.id, 0, capture.raw(0..10)).await;
    // Its frames wait to be coded, and are coded at completion.
    let coded: Session = app.create_with(form(capture, &json!({ "max_error": 1e-2 })), None).await.is(201);
    app.prepared(&coded.id).await;
    app.upload(&coded.id, 0, capture.raw(0..10)).await;
    let both = async |id: &str| (app.errors(id).await, app.cages(id).await);
    let before = (both(&done.id).await, both(&open.id).await, app.errors(&coded.id).await);
    let container = app.container(&done.id).await;

    forgotten(&operator, 3).await;
    assert!(before == (both(&done.id).await, both(&open.id).await, app.errors(&coded.id).await));
    assert!(container == app.container(&done.id).await);

    forgotten(&operator, 3).await;
    let path = |frame: u32| format!("/v1/sessions/{}/frames?first={frame}", open.id);
    app.post(&path(9), OCTETS, capture.frame(9)).await.expect(200);
    app.post(&path(8), OCTETS, capture.frame(9)).await.problem(409, "frame-conflict");
    forgotten(&operator, 1).await;
    for id in [&open.id, &coded.id] {
        app.upload(id, 10, capture.raw(10..15)).await;
        app.complete(id, 15).await.expect(200);
    }
    assert!(container == app.container(&open.id).await);
    assert!(app.container(&coded.id).await == capture.encoded_with(15, &["--max-error", "1e-2"]));

    // A completed session stays completed.
    forgotten(&operator, 2).await;
    app.post(&path(15), OCTETS, capture.frame(0)).await.expect(409);
    assert_eq!(app.session(&open.id).await.frames.solved, 15);
}
