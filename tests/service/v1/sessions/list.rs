//! `GET /v1/sessions`: all of them, a page at a time.

use crate::support::{Capture, TestApp};
use cager_proto::messages::SessionList;

#[tokio::test]
async fn pages_hold_every_session_once_the_newest_first() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    app.ready(capture).await;
    for _ in 0..102 {
        app.create(capture).await;
    }
    let first: SessionList = app.get("/v1/sessions").await.is(200);
    assert_eq!(first.sessions.len(), 100);
    let next = first.next.expect("another page");
    let second: SessionList = app.get(&format!("/v1/sessions?after={next}")).await.is(200);
    assert_eq!((second.sessions.len(), second.next), (3, None));
    let ids: Vec<&str> = first.sessions.iter().chain(&second.sessions).map(|session| session.id.as_str()).collect();
    assert!(ids.is_sorted_by(|a, b| a > b), "in order, none twice");
    assert!(first.sessions.is_sorted_by(|a, b| a.created >= b.created));
    let all = app.client().sessions().await.expect("all of them");
    assert_eq!(all.len(), 103);
}

#[tokio::test]
async fn what_the_query_does_not_know_is_refused() {
    let app = TestApp::start();
    app.get("/v1/sessions?befor=1").await.problem(400, "bad-request");
    for list in ["sessions", "jobs", "cages", "recoveries", "transfers"] {
        for after in ["", "0", "zzz"] {
            let problem = app.get(&format!("/v1/{list}?after={after}")).await.problem(400, "bad-request");
            assert!(problem.detail.contains("the `next` of the page before"), "{}", problem.detail);
        }
    }
    // One that was deleted meanwhile is a place like any other.
    let empty: SessionList = app.get(&format!("/v1/sessions?after={}", "0".repeat(32))).await.is(200);
    assert!(empty.sessions.is_empty() && empty.next.is_none());
}
