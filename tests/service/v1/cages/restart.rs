//! Designs and restarts.

use crate::support::{Capture, Inside, SlowDesigns, TestApp, eventually};
use cager_proto::cage_messages::{CageJob, CageState};
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::Ordering::SeqCst;

#[tokio::test]
async fn a_design_that_a_restart_interrupts_is_begun_anew_and_ends() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |_| ()).await;
    let running = app.design(Capture::tiny(), &json!({})).await;
    let queued = app.design(Capture::small(), &json!({})).await;
    eventually("it runs", async || (app.cage_job(&running.id).await.state == CageState::Running).then_some(())).await;
    assert_eq!(app.cage_job(&queued.id).await.state, CageState::Queued);
    let slow = Arc::<SlowDesigns>::default();
    let app = app.again(&slow).await;
    eventually("it runs again", async || (app.cage_job(&running.id).await.state == CageState::Running).then_some(()))
        .await;
    slow.release();
    for job in [&running, &queued] {
        let done: CageJob = app.designed(&job.id).await;
        assert_eq!((done.state, done.warnings), (CageState::Completed, vec!["slow".to_owned()]));
    }
    assert_eq!(slow.begun.load(SeqCst), 2);
}

#[tokio::test]
async fn a_killed_service_designs_what_it_was_asked_and_keeps_what_it_had() {
    let mut app = TestApp::start();
    let options = json!({"vertices": 32, "time_limit_s": 10.0});
    let done = app.design(Capture::tiny(), &options).await;
    let done = app.designed(&done.id).await;
    let path = format!("/v1/cages/{}/cage.obj", done.id);
    let cage = app.get(&path).await.expect(200);
    let begun = app.design(Capture::small(), &options).await;
    app.kill();
    let app = app.again();
    assert_eq!(app.cage_job(&done.id).await, done);
    let again = app.get(&path).await.expect(200);
    assert_eq!((again.header("etag"), &again.body), (cage.header("etag"), &cage.body));
    assert_eq!(app.designed(&begun.id).await.state, CageState::Completed);
}

#[tokio::test]
async fn a_damaged_cage_is_found_and_its_design_has_failed_from_then_on() {
    let mut app = TestApp::with_its_files(&[]);
    let job = app.design(Capture::tiny(), &json!({"vertices": 32, "time_limit_s": 10.0})).await;
    app.designed(&job.id).await;
    let file = app.cage_file(&job.id, "cage.obj");
    let mut bytes = std::fs::read(&file).expect("a cage");
    bytes[5] ^= 1;
    std::fs::write(&file, bytes).expect("a cage");
    app.get(&format!("/v1/cages/{}/cage.obj", job.id)).await.problem(409, "cage-failed");
    assert_eq!(app.cage_job(&job.id).await.state, CageState::Failed);
    assert_eq!(app.metric("cager_quarantined_total").await, 1.0);
    app.kill();
    app = app.again();
    assert_eq!(app.cage_job(&job.id).await.state, CageState::Failed);
}
