//! `Idempotency-Key`: a session is made once, however often it is asked for.

use crate::support::{Capture, TestApp, cage_form, file, form, text};
use cager_proto::cage_messages::CageJob;
use cager_proto::messages::{Session, SessionList};
use cager_service::store::{Idempotency, Kind, LocalDisk, Shared, Store};
use futures_util::future::join_all;
use serde_json::json;
use std::sync::Arc;

async fn count(app: &TestApp) -> usize {
    app.get("/v1/sessions").await.is::<SessionList>(200).sessions.len()
}

#[tokio::test]
async fn the_same_request_again_gives_the_same_session_even_after_a_restart() {
    let mut app = TestApp::start();
    let capture = Capture::tiny();
    let parts = || form(capture, &json!({"name": "once"}));
    let first: Session = app.create_with(parts(), Some("key-1")).await.is(201);
    let again = app.create_with(parts(), Some("key-1")).await.expect(201);
    assert_eq!(again.json::<Session>().id, first.id);
    assert_eq!(again.header("location"), format!("/v1/sessions/{}", first.id));
    assert_ne!(app.create_with(parts(), Some("key-2")).await.is::<Session>(201).id, first.id);
    assert_ne!(app.create_with(parts(), None).await.is::<Session>(201).id, first.id);
    assert_eq!(count(&app).await, 3);
    app.kill();
    let app = app.again();
    assert_eq!(app.create_with(parts(), Some("key-1")).await.is::<Session>(201).id, first.id);
    assert_eq!(count(&app).await, 3);
}

#[tokio::test]
async fn a_key_belongs_to_one_request() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let first: Session = app.create_with(form(capture, &json!({})), Some("k")).await.is(201);
    let others = [
        form(capture, &json!({"lambda": 2.0})),
        form(capture, &json!({"name": "another"})),
        form(Capture::small(), &json!({})),
    ];
    for other in others {
        app.create_with(other, Some("k")).await.problem(422, "idempotency-key-reused");
    }
    assert_eq!(count(&app).await, 1);
    // A session that is gone takes its key along.
    app.delete(&format!("/v1/sessions/{}", first.id)).await.expect(204);
    assert_ne!(app.create_with(form(capture, &json!({})), Some("k")).await.is::<Session>(201).id, first.id);
}

#[tokio::test]
async fn twenty_at_once_make_one_session() {
    let app = TestApp::start();
    let capture = Capture::small();
    let replies = join_all((0..20).map(|_| app.create_with(form(capture, &json!({})), Some("k")))).await;
    let mut ids = Vec::new();
    for reply in replies {
        if reply.status == 201 {
            ids.push(reply.json::<Session>().id);
        } else {
            reply.problem(409, "idempotency-key-in-use");
            reply.retry_after();
        }
    }
    ids.sort();
    ids.dedup();
    assert_eq!((ids.len(), count(&app).await), (1, 1));
}

#[tokio::test]
async fn a_request_that_failed_frees_its_key() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    app.create_with(form(capture, &json!({"lambda": -1.0})), Some("k")).await.problem(422, "invalid-options");
    let session: Session = app.create_with(form(capture, &json!({})), Some("k")).await.is(201);
    app.prepared(&session.id).await;
}

#[tokio::test]
async fn a_key_that_cannot_be_one_is_refused() {
    let app = TestApp::start();
    let long = "k".repeat(256);
    for key in ["", long.as_str()] {
        app.create_with(form(Capture::tiny(), &json!({})), Some(key)).await.problem(400, "bad-request");
    }
}

#[tokio::test]
async fn a_request_repeated_after_its_design_was_deleted_still_gets_its_session() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let design: CageJob =
        app.design_with(cage_form(capture, &json!({"vertices": 32, "time_limit_s": 10.0})), None).await.is(202);
    app.designed(&design.id).await;
    let parts = || {
        let options = text(&json!({"cage": {"id": design.id}}));
        reqwest::multipart::Form::new().part("rest", file("rest.obj", &capture.rest.obj)).part("options", options)
    };
    let first: Session = app.create_with(parts(), Some("k")).await.is(201);
    app.delete(&format!("/v1/cages/{}", design.id)).await.expect(204);
    // What was sent is the same, whatever the service would make of it now.
    assert_eq!(app.create_with(parts(), Some("k")).await.is::<Session>(201).id, first.id);
}

#[tokio::test]
async fn a_key_of_a_version_with_other_fingerprints_still_answers() {
    let mut app = TestApp::with_its_files(&[]);
    let capture = Capture::tiny();
    let first: Session = app.create_with(form(capture, &json!({})), Some("k")).await.is(201);
    app.kill();
    let (data, database) = (app.data(), app.catalog());
    // Calls of a store block.
    let rewritten = tokio::task::spawn_blocking(move || {
        let shared = Shared { catalog: database.as_deref(), ..Shared::default() };
        let opened = Store::open(&data, Arc::new(LocalDisk), shared).expect("a store");
        let mut meta = opened.sessions.first().expect("a session").clone();
        meta.idempotency = Some(Idempotency { key: "k".to_owned(), fingerprint: "0".repeat(64) });
        opened.store.delete(Kind::Session, &meta.id).expect("a deletion");
        opened.store.create_session(&meta).expect("a session");
    });
    rewritten.await.expect("a key of another version");
    let app = app.again();
    assert_eq!(app.create_with(form(capture, &json!({})), Some("k")).await.is::<Session>(201).id, first.id);
    let other = form(capture, &json!({"lambda": 2.0}));
    app.create_with(other, Some("k")).await.problem(422, "idempotency-key-reused");
    let other = form(Capture::small(), &json!({}));
    app.create_with(other, Some("k")).await.problem(422, "idempotency-key-reused");
}
