//! `DELETE /v1/cages/{id}`: what runs stops.

use crate::support::{Capture, Inside, SlowDesigns, TestApp, eventually, piece};
use cager_proto::cage_messages::CageState;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::Ordering::SeqCst;
use std::time::{Duration, Instant};

#[tokio::test]
async fn a_design_that_runs_stops_at_once_and_the_next_begins() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |_| ()).await;
    let running = app.design(Capture::tiny(), &json!({})).await;
    let waiting = app.design(Capture::tiny(), &json!({"seed": 1})).await;
    let last = app.design(Capture::tiny(), &json!({"seed": 2})).await;
    let is = async |id: &str, state: CageState| {
        eventually("it comes to that", async || (app.cage_job(id).await.state == state).then_some(())).await;
    };
    is(&running.id, CageState::Running).await;
    // It is running before its work has begun.
    let work = async |begun| ((slow.begun.load(SeqCst), slow.running.load(SeqCst)) == (begun, 1)).then_some(());
    eventually("its work begins", async || work(1).await).await;
    let mut events = app.open(&format!("/v1/cages/{}/events", running.id)).await;
    let clock = Instant::now();
    // One that waits goes as well.
    app.delete(&format!("/v1/cages/{}", waiting.id)).await.expect(204);
    app.delete(&format!("/v1/cages/{}", running.id)).await.expect(204);
    app.get(&format!("/v1/cages/{}", running.id)).await.problem(404, "not-found");
    is(&last.id, CageState::Running).await;
    // A second, and what a busy machine adds.
    assert!(clock.elapsed() < Duration::from_secs(5), "{:?}", clock.elapsed());
    let mut heard = String::new();
    while let Some(more) = piece("an event", &mut events).await.expect("a stream") {
        heard.push_str(std::str::from_utf8(&more).expect("UTF-8"));
    }
    assert!(heard.ends_with("event: deleted\ndata: {}\n\n"), "{heard}");
    eventually("the last one works, and the first no longer", async || work(2).await).await;
}

#[tokio::test]
async fn a_design_that_computes_frees_its_memory_soon_after_it_is_deleted() {
    let app = TestApp::start();
    let job = app.design(&Capture::new(6000, 32, 60), &json!({})).await;
    let taken = async || app.metric("cager_memory_bytes{use=\"designs\"}").await;
    eventually("it runs, or is over", async || {
        (taken().await > 0.0 || app.cage_job(&job.id).await.state == CageState::Completed).then_some(())
    })
    .await;
    let clock = Instant::now();
    app.delete(&format!("/v1/cages/{}", job.id)).await.expect(204);
    eventually("it stops", async || (taken().await == 0.0).then_some(())).await;
    assert!(clock.elapsed() < Duration::from_secs(5), "{:?}", clock.elapsed());
}
