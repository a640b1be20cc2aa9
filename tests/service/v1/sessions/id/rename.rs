//! `PATCH /v1/sessions/{id}`: another name, for good, and nothing else changes.

use crate::support::{Api, Capture, Reply, TestApp, form};
use cager_proto::messages::{Session, SessionList};
use reqwest::Method;
use serde_json::{Value, json};

async fn renamed(app: &Api, id: &str, body: &Value) -> Reply {
    app.send(app.request(Method::PATCH, &format!("/v1/sessions/{id}")).json(body)).await
}

#[tokio::test]
async fn a_name_is_changed_for_good() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let made = form(capture, &json!({ "name": "walk" }));
    let session: Session = app.create_with(made, Some("once")).await.is(201);
    app.prepared(&session.id).await;
    app.upload(&session.id, 0, capture.raw(0..3)).await;
    app.complete(&session.id, 3).await.expect(200);
    let (before, container) = (app.session(&session.id).await, app.container(&session.id).await);

    let said: Session = renamed(&app, &session.id, &json!({ "name": "Walk, take 2 é" })).await.is(200);
    assert_eq!(said, Session { name: Some("Walk, take 2 é".to_owned()), ..before });
    app.kill();
    let app = app.again();
    let listed: SessionList = app.get("/v1/sessions").await.is(200);
    assert_eq!(listed.sessions[0].name, said.name);
    assert!(container == app.container(&session.id).await);
    // What was asked for stays, so that a repetition is known again.
    let made = form(capture, &json!({ "name": "walk" }));
    let again: Session = app.create_with(made, Some("once")).await.is(201);
    assert_eq!((again.id, again.name), (session.id.clone(), said.name));

    let none: Session = renamed(&app, &session.id, &json!({ "name": "" })).await.is(200);
    assert_eq!(none.name, None);
}

#[tokio::test]
async fn names_that_are_no_names_and_sessions_that_are_not_there_are_refused() {
    let app = TestApp::start();
    let session = app.ready(Capture::tiny()).await;
    let problem = renamed(&app, &session.id, &json!({ "name": "n".repeat(201) })).await.problem(422, "invalid-options");
    assert_eq!(problem.detail, "name: is longer than 200 characters; shorten it");
    for body in [json!({}), json!({ "name": null }), json!({ "name": "a", "fps": 2 }), json!(["a"])] {
        renamed(&app, &session.id, &body).await.problem(422, "invalid-options");
    }
    assert_eq!(app.session(&session.id).await.name, session.name);
    app.delete(&format!("/v1/sessions/{}", session.id)).await.expect(204);
    renamed(&app, &session.id, &json!({ "name": "a" })).await.problem(404, "not-found");
}
