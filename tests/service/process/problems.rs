//! Errors look the same everywhere.

use crate::support::{Capture, Raw, TestApp};
use http::Method;

#[tokio::test]
async fn whatever_is_wrong_with_a_request_is_a_problem_with_its_id() {
    let app = TestApp::start();
    let session = app.ready(Capture::tiny()).await;
    for api in [app.stranger(), app.http2()] {
        for path in ["/nowhere", "/v1", "/v1/", "/v1/sessions/", "/v2/sessions", "/v1/sessions/x/y/z", "/healthz/x"] {
            api.get(path).await.problem(404, "not-found");
        }
        for (method, path, allowed) in [
            (Method::PUT, "/v1/sessions".to_owned(), "POST"),
            (Method::POST, format!("/v1/sessions/{}", session.id), "DELETE"),
            (Method::DELETE, format!("/v1/sessions/{}/frames", session.id), "POST"),
            (Method::GET, format!("/v1/sessions/{}/frames", session.id), "POST"),
            (Method::PATCH, format!("/v1/sessions/{}/cages", session.id), "GET"),
            (Method::POST, "/healthz".to_owned(), "GET"),
            (Method::DELETE, "/openapi.json".to_owned(), "GET"),
        ] {
            let reply = api.send(api.request(method.clone(), &path)).await;
            let problem = reply.problem(405, "method-not-allowed");
            assert!(problem.detail.contains(allowed), "{}", problem.detail);
            assert!(reply.header("allow").contains(allowed), "{method} {path}: {:?}", reply.header("allow"));
        }
        let path = format!("/v1/sessions/{}/complete", session.id);
        api.post(&path, "application/json", "{\"frames\" 3}").await.problem(400, "bad-request");
        api.post(&path, "application/json", "").await.problem(400, "bad-request");
        api.get(&format!("/v1/sessions/{}/cages?first=%zz", session.id)).await.problem(400, "bad-request");
        let wrong = api.get(&format!("/v1/sessions/{}/cages?first=x", session.id)).await.problem(400, "bad-request");
        assert_eq!(wrong.detail, "query: first: give a whole number, 0 or more");
    }
}

#[tokio::test]
async fn a_clients_own_request_id_is_kept_and_logged() {
    let app = TestApp::start();
    let problem = app.get_with("/v1/sessions/none", &[("x-request-id", "mine-0815")]).await.problem(404, "not-found");
    assert_eq!(problem.request_id.as_deref(), Some("mine-0815"));
    assert!(app.log().contains("mine-0815"));
    let odd = app.get_with("/v1/sessions/none", &[("x-request-id", "no id\", \"injected")]).await;
    assert!(!odd.header("x-request-id").contains("injected"));
}

#[tokio::test]
async fn what_works_has_an_id_too() {
    let app = TestApp::start();
    let mut ids = Vec::new();
    for path in ["/healthz", "/readyz", "/metrics", "/openapi.json", "/", "/v1/sessions"] {
        let reply = app.get(path).await.expect(200);
        ids.push(reply.header("x-request-id").to_owned());
    }
    assert!(ids.iter().all(|id| !id.is_empty()));
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), 6);
}

#[tokio::test]
async fn heads_that_cannot_be_read_are_refused_and_the_service_lives_on() {
    let app = TestApp::start();
    for bytes in [&b"NONSENSE\r\n\r\n"[..], b"GET / HTTP/9.9\r\n\r\n", b"\x16\x03\x01\x00\xa5\x01\x00\x00\xa1\x03\x03"]
    {
        let mut raw = Raw::connect(&app).await;
        raw.write(bytes).await;
        drop(raw);
    }
    let mut raw = Raw::connect(&app).await;
    raw.head("POST", "/v1/sessions", &[("content-length", "3"), ("transfer-encoding", "chunked")]).await;
    assert_eq!(raw.answer().await.status, 400, "a request whose length is ambiguous");
    let mut raw = Raw::connect(&app).await;
    raw.head("GET", "/healthz", &[("x-large", &"x".repeat(40_000))]).await;
    assert_eq!(raw.answer().await.status, 431);
    app.get("/healthz").await.expect(200);
}
