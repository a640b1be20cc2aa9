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

#[tokio::test]
async fn a_container_that_was_cut_or_removed_is_told_and_written_again() {
    let app = TestApp::with_its_files(&[]);
    let session = app.completed(Capture::small(), 40).await;
    let expected = app.container(&session.id).await;
    let file = app.session_file(&session.id, "capture.cager");
    let cut = || std::fs::File::options().write(true).open(&file).and_then(|file| file.set_len(1000)).expect("cut");
    let removed = || std::fs::remove_file(&file).expect("removed");
    for (count, damage) in [(1.0, &cut as &dyn Fn()), (2.0, &removed)] {
        assert_eq!(app.metric("cager_quarantined_total").await, count - 1.0, "it is there from the start");
        damage();
        for what in ["capture.cager", "export?format=npy", "capture.cager"] {
            let reply = app.get(&format!("/v1/sessions/{}/{what}", session.id)).await;
            let problem = reply.problem(503, "storage-failed");
            assert!(problem.detail.contains("complete the session again"), "{}", problem.detail);
        }
        assert!(app.session(&session.id).await.problem.is_some());
        assert_eq!(app.metric("cager_quarantined_total").await, count);
        app.complete(&session.id, 40).await.expect(200);
        assert!(app.container(&session.id).await == expected);
        assert_eq!(app.session(&session.id).await.problem, None);
    }
}
