//! Sessions whose cage is not sent.

use crate::support::{Capture, Mesh, TestApp, file, form, text};
use cager_geometry::mesh::Model;
use cager_proto::messages::{CacheUse, Session};
use futures_util::future::join_all;
use reqwest::multipart::Form;
use serde_json::{Value, json};

fn parts(capture: &Capture, options: &Value) -> Form {
    Form::new().part("rest", file("rest.obj", &capture.rest.obj)).part("options", text(options))
}

#[tokio::test]
async fn a_cage_is_made_around_the_rest_pose_and_encodes() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session: Session = app.create_with(parts(capture, &json!({"cage": {"vertices": 100}})), None).await.is(201);
    let session = app.prepared(&session.id).await;
    let vertices = session.cage_vertices.expect("known");
    assert!((4..=100).contains(&vertices), "{vertices}");
    app.upload(&session.id, 0, capture.raw(0..10)).await;
    app.complete(&session.id, 10).await.expect(200);
    let cage = app.get(&format!("/v1/sessions/{}/cage", session.id)).await.expect(200);
    assert_eq!(cage.header("cager-vertices"), vertices.to_string());
}

#[tokio::test]
async fn nothing_has_to_be_said_of_it() {
    let app = TestApp::start();
    let rest = || Form::new().part("rest", file("rest.obj", &Capture::small().rest.obj));
    let session: Session = app.create_with(rest(), None).await.is(201);
    assert!(app.prepared(&session.id).await.cage_vertices.is_some_and(|vertices| vertices <= 350));
    // Fewer points than usual have a smaller cage.
    let rest = Form::new().part("rest", file("rest.obj", &Capture::tiny().rest.obj));
    let session: Session = app.create_with(rest, None).await.is(201);
    app.prepared(&session.id).await;
}

#[tokio::test]
async fn the_same_again_prepares_nothing_also_after_a_restart() {
    let mut app = TestApp::start();
    let options = json!({"cage": {"vertices": 60}});
    let first: Session = app.create_with(parts(Capture::small(), &options), None).await.is(201);
    app.prepared(&first.id).await;
    let again: Session = app.create_with(parts(Capture::small(), &options), None).await.is(201);
    assert_eq!(app.prepared(&again.id).await.cache, Some(CacheUse::Hit));
    app.solver_stored().await;
    app.kill();
    let app = app.again();
    let later: Session = app.create_with(parts(Capture::small(), &options), None).await.is(201);
    assert_eq!(app.prepared(&later.id).await.cache, Some(CacheUse::Hit));
    let cage = async |id: &str| app.get(&format!("/v1/sessions/{id}/cage")).await.expect(200).body;
    assert_eq!(cage(&first.id).await, cage(&later.id).await);
}

#[tokio::test]
async fn ten_at_once_prepare_once() {
    let app = TestApp::start();
    let made = join_all((0..10).map(async |_| {
        let session: Session = app.create_with(parts(Capture::small(), &json!({})), None).await.is(201);
        app.prepared(&session.id).await
    }));
    assert_eq!(made.await.iter().filter(|session| session.cache == Some(CacheUse::Miss)).count(), 1);
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 1.0);
}

#[tokio::test]
async fn a_repeated_request_gives_the_same_session() {
    let app = TestApp::start();
    let one = || parts(Capture::tiny(), &json!({}));
    let first: Session = app.create_with(one(), Some("key")).await.is(201);
    assert_eq!(app.create_with(one(), Some("key")).await.is::<Session>(201).id, first.id);
}

#[tokio::test]
async fn what_contradicts_itself_or_cannot_be_enclosed_is_said_at_once() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let refusals: [(Form, &str, &[&str]); 7] = [
        (form(capture, &json!({"cage": {"vertices": 60}})), "invalid-options", &["cage", "sent as well"]),
        (parts(capture, &json!({"cage": {"vertices": 60, "id": "x"}})), "invalid-options", &["not both"]),
        (parts(capture, &json!({"cage": {"id": "nobody"}})), "invalid-options", &["nobody", "/v1/cages"]),
        (parts(capture, &json!({"cage": {"vertices": 3}})), "invalid-options", &["vertices", "3"]),
        (parts(capture, &json!({"cage": {"size": 3}})), "invalid-options", &["size"]),
        (Form::new().part("rest", file("rest.obj", b"v 1 1 1\nv 1 1 1\n")), "invalid-geometry", &["one place"]),
        (Form::new().part("rest", file("rest.obj", b"v 1 nan 1\n")), "invalid-geometry", &["rest"]),
    ];
    for (form, word, words) in refusals {
        let problem = app.create_with(form, None).await.problem(422, word);
        for word in words {
            assert!(problem.detail.contains(word), "{word:?} is not in: {}", problem.detail);
        }
    }
    // More vertices than points: known as soon as the cage is there.
    let few = Mesh::new(Model { points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]], ..Model::default() });
    let refused = app.create_with(Form::new().part("rest", file("rest.obj", &few.obj)), None).await;
    assert_eq!(refused.status, 422, "{}", refused.text());
    assert!(app.get("/v1/sessions").await.text().contains("\"sessions\":[]"));
}
