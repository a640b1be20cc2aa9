//! `GET …/cage.obj`: the best cage so far, and in the end the result.

use crate::support::{Capture, Inside, SlowDesigns, TestApp, eventually, file, text};
use reqwest::multipart::Form;
use serde_json::json;
use std::sync::Arc;

#[tokio::test]
async fn the_best_cage_so_far_is_there_while_the_design_runs() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |_| ()).await;
    let job = app.design(Capture::tiny(), &json!({})).await;
    let queued = app.design(Capture::tiny(), &json!({"seed": 1})).await;
    let path = |id: &str| format!("/v1/cages/{id}/cage.obj");
    let none = app.get(&path(&queued.id)).await;
    none.problem(409, "cage-not-ready");
    none.retry_after();
    let view =
        eventually("a cage", async || Some(app.cage_job(&job.id).await).filter(|job| job.vertices.is_some())).await;
    assert!(view.error.held_back.is_some() && view.stage.as_deref() == Some("descent"), "{view:?}");
    let best = app.get(&path(&job.id)).await.expect(200);
    assert_eq!((best.header("content-type"), best.header("cache-control")), ("model/obj", "no-cache"));
    let known = app.get_with(&path(&job.id), &[("if-none-match", best.header("etag"))]).await;
    assert_eq!(known.status, 304);
    // A session takes a result only: the best so far may change.
    let parts = Form::new().part("rest", file("rest.obj", &Capture::tiny().rest.obj));
    let parts = parts.part("options", text(&json!({"cage": {"id": job.id}})));
    let early = app.create_with(parts, None).await;
    assert!(early.problem(409, "cage-not-ready").detail.contains("cage.obj"));
    slow.release();
    app.designed(&job.id).await;
    let result = app.get(&path(&job.id)).await.expect(200);
    assert!(result.header("cache-control").contains("immutable"));
    assert_eq!((result.header("etag"), &result.body), (best.header("etag"), &best.body));
}

#[tokio::test]
async fn parts_of_a_result_can_be_fetched() {
    let app = TestApp::start();
    let job = app.design(Capture::tiny(), &json!({"vertices": 32, "time_limit_s": 10.0})).await;
    app.designed(&job.id).await;
    let path = format!("/v1/cages/{}/cage.obj", job.id);
    let whole = app.get(&path).await.expect(200);
    let part = app.get_with(&path, &[("range", "bytes=2-5")]).await.expect(206);
    assert_eq!(part.body, whole.body[2..6]);
    app.get_with(&path, &[("range", "bytes=9999999-")]).await.problem(416, "range");
}
