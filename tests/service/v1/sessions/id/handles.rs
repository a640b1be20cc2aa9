//! `GET …/handles`: the points that the inversion reads.

use crate::support::{Capture, TestApp};

#[tokio::test]
async fn handles_are_the_same_in_numbers_and_in_json() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/handles", session.id);
    let handles = app.handles(&session.id).await;
    let reply = app.get_with(&path, &[("accept", "application/json")]).await.expect(200);
    assert_eq!(reply.header("content-type"), "application/json");
    assert_eq!(reply.json::<Vec<u32>>(), handles);
    assert_eq!(app.client().handles(&session.id).await.expect("handles"), handles);
    assert_eq!(Some(handles.len() as u32), session.handle_count);
    let mut sorted = handles.clone();
    sorted.sort_unstable();
    sorted.dedup();
    assert!(sorted.len() == handles.len() && sorted.last() < Some(&(capture.points() as u32)));
    app.get_with(&path, &[("accept", "text/html")]).await.problem(406, "not-acceptable");
}
