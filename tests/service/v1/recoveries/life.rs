//! Recoveries are repeated, listed, deleted and counted as sessions are.

use super::{FRAMES, complete, create, created, post, recovery, scans, until};
use crate::support::{TestApp, piece};
use cager_proto::recovery_messages::{Recovery, RecoveryList};
use serde_json::json;

const ANNA: &str = "anna-has-a-long-secret";
const BERT: &str = "bert-has-a-long-secret";

#[tokio::test]
async fn the_same_request_again_gives_the_same_recovery() {
    let app = TestApp::start();
    let options = json!({"points": 800});
    let first: Recovery = create(&app, scans().form(&options), Some("k")).await.is(202);
    let again = create(&app, scans().form(&options), Some("k")).await.expect(202);
    assert_eq!(again.header("location"), format!("/v1/recoveries/{}", first.id));
    assert_eq!(again.json::<Recovery>().id, first.id);
    create(&app, scans().form(&json!({"points": 900})), Some("k")).await.problem(422, "idempotency-key-reused");
    let other: Recovery = create(&app, scans().form(&options), None).await.is(202);
    let list: RecoveryList = app.get("/v1/recoveries").await.is(200);
    assert_eq!(list.recoveries.iter().map(|job| &job.id).collect::<Vec<_>>(), [&other.id, &first.id]);
    app.delete(&format!("/v1/recoveries/{}", first.id)).await.expect(204);
    let anew: Recovery = create(&app, scans().form(&options), Some("k")).await.is(202);
    assert_ne!(anew.id, first.id);
}

#[tokio::test]
async fn a_recovery_that_is_deleted_while_it_runs_is_gone_and_its_followers_hear_of_it() {
    let app = TestApp::start();
    let job = created(&app, &json!({"points": 800})).await;
    let path = format!("/v1/recoveries/{}", job.id);
    let events = {
        let (api, path) = (app.stranger(), format!("{path}/events"));
        tokio::spawn(async move { api.get(&path).await.expect(200).text() })
    };
    post(&app, &job.id, 0, scans().parts(0..FRAMES)).await.expect(200);
    until(&app, &job.id, |recovery| recovery.frames.followed >= 1).await;
    let mut cages = app.open(&format!("{path}/cages?follow=true")).await;
    piece("a cage", &mut cages).await.expect("a stream").expect("a cage");
    app.delete(&path).await.expect(204);
    assert!(events.await.expect("a stream").ends_with("event: deleted\ndata: {}\n\n"));
    while let Ok(more) = piece("the end of the cages", &mut cages).await {
        more.expect("no good end");
    }
    app.get(&path).await.problem(404, "not-found");
    post(&app, &job.id, 0, scans().parts(0..1)).await.problem(404, "not-found");
    assert!(!app.data().join("recoveries").join(&job.id).exists());
    assert_eq!(app.metric("cager_recovering").await, 0.0);
}

#[tokio::test]
async fn tenants_have_recoveries_and_quotas_of_their_own() {
    let app =
        TestApp::guarded_with(&[("anna", ANNA, ""), ("bert", BERT, "max_sessions = 1\nmax_bytes = 100000\n")], &[]);
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    let job = created(&anna, &json!({})).await;
    bert.get(&format!("/v1/recoveries/{}", job.id)).await.problem(404, "not-found");
    post(&bert, &job.id, 0, scans().parts(0..1)).await.problem(404, "not-found");
    let own = created(&bert, &json!({})).await;
    create(&bert, scans().form(&json!({})), None).await.problem(429, "too-many-sessions");
    post(&bert, &own.id, 0, scans().parts(0..FRAMES)).await.problem(507, "quota-exceeded");
    post(&anna, &job.id, 0, scans().parts(0..FRAMES)).await.expect(200);
}

#[tokio::test]
async fn no_frame_is_acknowledged_beyond_the_end_that_was_declared_meanwhile() {
    let app = TestApp::start();
    for _ in 0..5 {
        let job = created(&app, &json!({"points": 800})).await;
        post(&app, &job.id, 0, scans().parts(0..1)).await.expect(200);
        let (beyond, end) = tokio::join!(post(&app, &job.id, 1, scans().parts(1..2)), async {
            tokio::time::sleep(std::time::Duration::from_millis(2)).await;
            complete(&app, &job.id, 1).await
        });
        assert!(beyond.status != 200 || end.status != 202, "both a frame and an end before it were taken");
        let found = recovery(&app, &job.id).await.frames;
        assert_eq!(found.received, if beyond.status == 200 { 2 } else { 1 });
        app.delete(&format!("/v1/recoveries/{}", job.id)).await.expect(204);
    }
}

#[tokio::test]
async fn only_some_of_many_recoveries_that_wait_are_kept_in_memory() {
    let app = TestApp::start();
    let mut jobs = Vec::new();
    for _ in 0..20 {
        let job: Recovery = create(&app, scans().caged_form(&json!({"points": 200})), None).await.is(202);
        post(&app, &job.id, 0, scans().parts(0..1)).await.expect(200);
        assert!(app.metric("cager_recoveries_in_memory").await <= 6.0);
        jobs.push(job.id);
    }
    for id in &jobs {
        until(&app, id, |recovery| recovery.frames.followed == 1).await;
    }
    assert!(app.metric("cager_recoveries_in_memory").await <= 6.0);
    // Also one that is not kept goes on when its next frame comes.
    for id in [&jobs[0], &jobs[19]] {
        post(&app, id, 1, scans().parts(1..2)).await.expect(200);
        until(&app, id, |recovery| recovery.frames.followed == 2).await;
    }
}
