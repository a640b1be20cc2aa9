//! Many sessions at once.

use crate::support::{Api, Capture, TestApp, form};
use cager_proto::messages::{CacheUse, Session};
use futures_util::future::join_all;
use serde_json::json;
use std::sync::Arc;

const FRAMES: u32 = 5;

#[tokio::test(flavor = "multi_thread")]
async fn two_hundred_at_once_each_get_their_own_container() {
    let app = TestApp::with(&["tenant_max_streams=256"]);
    let kinds = [200, 260, 320, 380].map(|points| {
        let capture = Capture::new(points, 32, FRAMES as usize);
        let expected = capture.encoded(FRAMES);
        Arc::new((capture, expected))
    });
    let one = async |k: usize, api: Api| {
        let (capture, expected) = &*kinds[k % kinds.len()];
        let session = api.create(capture).await;
        // Posted without waiting: the service waits until the session is prepared.
        let results = api.upload(&session.id, 0, capture.raw(0..FRAMES)).await;
        assert_eq!(results.iter().map(|result| result.frame).collect::<Vec<_>>(), (0..FRAMES).collect::<Vec<_>>());
        api.complete(&session.id, FRAMES).await.expect(200);
        assert!(api.container(&session.id).await == *expected, "session {k} has another container than cager encode");
        session.id
    };
    let apis = [app.stranger(), app.http2(), app.http2()];
    let mut ids = join_all((0..200).map(|k| one(k, apis[k % apis.len()].clone()))).await;
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), 200, "every session has its own id");
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 4.0, "each content is prepared once");
}

#[tokio::test]
async fn ten_at_once_on_the_same_pair_prepare_once() {
    let app = TestApp::start();
    let capture = Capture::small();
    let created = join_all((0..10).map(|_| app.create(capture))).await;
    let sessions = join_all(created.iter().map(|session| app.prepared(&session.id))).await;
    let misses = sessions.iter().filter(|session| session.cache == Some(CacheUse::Miss)).count();
    assert_eq!(misses, 1, "one of them prepares, the others find it prepared");
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 1.0);
    let late = app.ready(capture).await;
    assert_eq!(late.cache, Some(CacheUse::Hit));
    assert_eq!(late.seconds.coordinates + late.seconds.maxvol + late.seconds.svd, 0.0, "nothing is prepared again");
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 1.0);
}

#[tokio::test]
async fn another_option_is_another_solver() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    app.ready(capture).await;
    let parts = form(capture, &json!({"regularizer": "none"}));
    let other: Session = app.create_with(parts, None).await.is(201);
    assert_eq!(app.prepared(&other.id).await.cache, Some(CacheUse::Miss));
    let named = form(capture, &json!({"name": "the same under a name"}));
    let named: Session = app.create_with(named, None).await.is(201);
    assert_eq!(app.prepared(&named.id).await.cache, Some(CacheUse::Hit), "a name changes no number");
}

#[tokio::test]
async fn defaults_that_are_written_out_are_the_same_content() {
    let app = TestApp::start();
    app.ready(Capture::small()).await;
    let options = json!({ "coordinates": "mvc", "handles": "spread", "regularizer": "differential", "lambda": 1.0, "name": "again" });
    let session: Session = app.create_with(form(Capture::small(), &options), None).await.is(201);
    app.prepared(&session.id).await;
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 1.0);
}
