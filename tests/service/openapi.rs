//! Every route that `/openapi.json` names, so that none can be forgotten, is closed to strangers.

use crate::support::{Api, Capture, OCTETS, Reply, TestApp};
use http::Method;
use serde_json::{Value, json};

const ANNA: &str = "anna-has-a-long-secret";
const BERT: &str = "bert-has-a-long-secret";
/// For operators; without captures in them.
const OPEN: [&str; 4] = ["/", "/healthz", "/readyz", "/openapi.json"];
/// For operators, with a token that says so.
const METRICS: &str = "/metrics";

async fn guarded() -> TestApp {
    TestApp::guarded(&[("anna", ANNA, ""), ("bert", BERT, "")])
}

/// All operations: method and path.
async fn operations(app: &TestApp) -> Vec<(Method, String)> {
    let document: Value = app.get("/openapi.json").await.is(200);
    let paths = document["paths"].as_object().expect("paths");
    let mut all = Vec::new();
    for (path, item) in paths {
        for method in item.as_object().expect("operations").keys() {
            let Ok(method) = Method::from_bytes(method.to_uppercase().as_bytes()) else { continue };
            if [Method::GET, Method::POST, Method::PUT, Method::PATCH, Method::DELETE].contains(&method) {
                all.push((method, path.clone()));
            }
        }
    }
    assert!(all.len() >= 15, "{all:?}");
    all
}

/// A request that would do something if it met its session.
async fn send(api: &Api, method: &Method, path: &str) -> Reply {
    let request = api.request(method.clone(), path);
    let request = match path.rsplit('/').next() {
        Some("complete") => request.json(&json!({"frames": 3})),
        Some("sessions" | "cages" | "recoveries" | "transfers" | "shapespaces") if method == Method::POST => {
            request.header("content-type", "multipart/form-data; boundary=x")
        }
        _ if method == Method::POST => request.header("content-type", OCTETS).body(vec![0; 2400]),
        _ => request,
    };
    api.send(request).await
}

#[tokio::test]
async fn without_a_token_no_route_says_more_than_that_it_needs_one() {
    let app = guarded().await;
    let session = app.completed(Capture::tiny(), 3).await;
    let known_short_and_wrong = [None, Some("short"), Some("this-token-is-not-known")];
    for (method, path) in operations(&app).await {
        let path = path.replace("{id}", &session.id);
        for token in known_short_and_wrong {
            let reply = send(&app.caller(token), &method, &path).await;
            if OPEN.contains(&path.as_str()) {
                assert_eq!(reply.status, 200, "{path}");
                assert!(!reply.text().contains(&session.id), "{path} tells ids");
                continue;
            }
            assert!(path.starts_with("/v1/") || path == METRICS, "{path} is neither guarded nor known to be open");
            reply.problem(401, "unauthorized");
            assert_eq!(reply.header("www-authenticate"), "Bearer", "{method} {path}");
        }
    }
}

#[tokio::test]
async fn another_tenants_session_is_unknown_on_every_route() {
    let app = guarded().await;
    let anna = app.caller(Some(ANNA));
    let bert = app.caller(Some(BERT));
    let capture = Capture::tiny();
    let completed = anna.completed(capture, 3).await;
    let running = anna.ready(capture).await;
    anna.upload(&running.id, 0, capture.raw(0..2)).await;
    let unknown = "0".repeat(running.id.len());
    // Without what differs between any two requests.
    let plain = |reply: &Reply| {
        let mut body: Value = reply.json();
        body.as_object_mut().expect("an object").remove("request_id");
        let mut headers = reply.headers.clone();
        headers.remove("x-request-id");
        headers.remove("date");
        // Its length includes that of the identifier, which is always the same.
        (reply.status, body, headers)
    };
    let mut looked_at = 0;
    for (method, path) in operations(&app).await.into_iter().filter(|(_, path)| path.contains("{id}")) {
        let never = send(&bert, &method, &path.replace("{id}", &unknown)).await;
        never.problem(404, "not-found");
        for id in [&completed.id, &running.id] {
            let reply = send(&bert, &method, &path.replace("{id}", id)).await;
            assert_eq!(plain(&reply), plain(&never), "{method} {path}");
        }
        looked_at += 1;
    }
    assert!(looked_at >= 11, "{looked_at} routes");
    let others = operations(&app).await.into_iter().map(|(_, path)| path).filter(|path| !path.contains("{id}"));
    let lists =
        ["/v1/sessions", "/v1/jobs", "/v1/cages", "/v1/recoveries", "/v1/transfers", "/v1/shapespaces", METRICS];
    let others: Vec<String> =
        others.filter(|path| !OPEN.contains(&path.as_str()) && !lists.contains(&path.as_str())).collect();
    assert!(others.is_empty(), "routes that no test scopes: {others:?}");
    // Nothing happened to them.
    assert_eq!(anna.session(&completed.id).await, completed);
    assert_eq!(anna.session(&running.id).await.frames.solved, 2);
    assert!(bert.get("/v1/sessions").await.text().contains("\"sessions\":[]"));
}

#[tokio::test]
async fn ids_that_are_none_are_unknown() {
    let app = TestApp::start();
    for id in ["x", "..", "%2e%2e", "..%2f..%2fetc", "%00", "a%20b", &"f".repeat(5000), "%F0%9F%92%83"] {
        let reply = app.get(&format!("/v1/sessions/{id}/errors")).await;
        assert!(matches!(reply.status, 400 | 404), "{id}: {}", reply.status);
    }
}
