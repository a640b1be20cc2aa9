//! `Idempotency-Key`: a design is begun once, however often it is asked for.

use crate::support::{Capture, TestApp, cage_form};
use cager_proto::cage_messages::{CageJob, CageJobList};
use serde_json::json;

#[tokio::test]
async fn the_same_request_again_gives_the_same_design_even_after_a_restart() {
    let mut app = TestApp::start();
    let parts = |seed| cage_form(Capture::tiny(), &json!({"vertices": 32, "time_limit_s": 10.0, "seed": seed}));
    let first: CageJob = app.design_with(parts(1), Some("key")).await.is(202);
    assert_eq!(app.design_with(parts(1), Some("key")).await.is::<CageJob>(202).id, first.id);
    app.design_with(parts(2), Some("key")).await.problem(422, "idempotency-key-reused");
    app.kill();
    let app = app.again();
    assert_eq!(app.design_with(parts(1), Some("key")).await.is::<CageJob>(202).id, first.id);
    assert_eq!(app.get("/v1/cages").await.is::<CageJobList>(200).cages.len(), 1);
    app.delete(&format!("/v1/cages/{}", first.id)).await.expect(204);
    assert_ne!(app.design_with(parts(2), Some("key")).await.is::<CageJob>(202).id, first.id);
    for key in ["", &"k".repeat(256)] {
        app.design_with(parts(1), Some(key)).await.problem(400, "bad-request");
    }
}
