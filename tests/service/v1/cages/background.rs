//! Designs run a few at a time, in turn, and hold nobody up.

use crate::support::{Capture, Inside, SlowDesigns, TestApp, cage_form, eventually};
use cager_proto::cage_messages::CageState;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::Ordering::SeqCst;
use std::time::{Duration, Instant};

#[tokio::test]
async fn one_is_designed_at_a_time_and_the_queue_ends_somewhere() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |config| config.max_design_queue = 2).await;
    let seeded = |seed: u32| json!({ "seed": seed });
    let first = app.design(Capture::tiny(), &seeded(0)).await;
    eventually("it runs", async || (app.cage_job(&first.id).await.state == CageState::Running).then_some(())).await;
    let waiting = [app.design(Capture::tiny(), &seeded(1)).await, app.design(Capture::tiny(), &seeded(2)).await];
    let reply = app.design_with(cage_form(Capture::tiny(), &seeded(3)), None).await;
    reply.problem(429, "too-many-jobs");
    assert!(reply.retry_after() > Duration::ZERO);
    // Its frames are read after it is said to run.
    eventually("it is designed", async || (slow.running.load(SeqCst) == 1).then_some(())).await;
    slow.release();
    for job in waiting {
        assert_eq!(app.designed(&job.id).await.state, CageState::Completed);
    }
}

#[tokio::test]
async fn the_same_input_while_it_is_designed_is_designed_once() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |config| config.max_designs = 4).await;
    let first = app.design(Capture::tiny(), &json!({"name": "a"})).await;
    let second = app.design(Capture::tiny(), &json!({"name": "b"})).await;
    eventually("it runs", async || (app.cage_job(&first.id).await.state == CageState::Running).then_some(())).await;
    slow.release();
    for job in [&first, &second] {
        assert_eq!(app.designed(&job.id).await.state, CageState::Completed);
    }
    assert_eq!(slow.begun.load(SeqCst), 1);
}

#[tokio::test]
async fn a_design_that_takes_too_long_is_stopped() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |_| ()).await;
    let job = app.design(Capture::tiny(), &json!({"time_limit_s": 0.1})).await;
    // It ignores its limit, so the service ends it some seconds later.
    let ended = app.designed(&job.id).await;
    assert_eq!(ended.state, CageState::Failed);
    assert!(ended.timed_out && ended.seconds > 5.0, "{ended:?}");
    assert_eq!(ended.problem.expect("a problem").word(), "busy");
    assert_eq!(slow.running.load(SeqCst), 0);
}

#[tokio::test]
async fn frames_are_answered_promptly_while_a_cage_is_designed() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let job = app.design(&Capture::new(6000, 32, 60), &json!({"time_limit_s": 30.0})).await;
    eventually("it is designed", async || (app.cage_job(&job.id).await.state == CageState::Running).then_some(()))
        .await;
    let mut slowest = Duration::ZERO;
    for frame in 0..40 {
        let clock = Instant::now();
        app.upload(&session.id, frame, capture.raw(frame..frame + 1)).await;
        slowest = slowest.max(clock.elapsed());
    }
    assert!(slowest < Duration::from_secs(10), "{slowest:?}");
    assert_eq!(app.cage_job(&job.id).await.state, CageState::Running, "designed all the while");
    app.delete(&format!("/v1/cages/{}", job.id)).await.expect(204);
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn background_work_gives_way_to_frames_and_still_ends_beside_other_programs() {
    let app = TestApp::start();
    let [usual, frames] = ["cager", "solve-0"].map(|thread| app.niceness(thread));
    for thread in ["design-0", "code-0", "complete-0", "prepare-0"] {
        let nice = app.niceness(thread);
        assert!((frames + 5..=usual + 10).contains(&nice), "{thread}: {nice}, not {usual} and {frames}");
    }
}
