//! `GET …/capture.cager`: the container.

use crate::support::{Capture, TestApp};

#[tokio::test]
async fn the_container_is_there_when_the_session_is_completed() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/capture.cager", session.id);
    app.get(&path).await.problem(409, "not-completed");
    app.upload(&session.id, 0, capture.raw(0..40)).await;
    app.get(&path).await.problem(409, "not-completed");
    app.complete(&session.id, 40).await.expect(200);
    let reply = app.get(&path).await.expect(200);
    assert_eq!(reply.header("content-type"), "application/vnd.cager");
    assert!(reply.header("content-disposition").contains("capture.cager"));
    assert_eq!(reply.header("content-length"), reply.body.len().to_string());
    assert!(reply.body == capture.encoded(40));
    let mut downloaded = Vec::new();
    app.client().download(&session.id, &mut downloaded).await.expect("a container");
    assert!(downloaded == reply.body);
}
