//! Transfers are repeated, listed, deleted and counted as other jobs are.

use super::{PATIENCE, completed, create, created, motion, running, transfer};
use crate::support::{Inside, SlowDesigns, TestApp, eventually, within};
use cager_proto::messages::JobState;
use cager_proto::transfer_messages::{Transfer, TransferList, TransferStage};
use futures_util::future::join_all;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::Ordering::SeqCst;
use std::time::Duration;

const ANNA: &str = "anna-has-a-long-secret";
const BERT: &str = "bert-has-a-long-secret";

#[tokio::test]
async fn the_same_request_again_gives_the_same_transfer() {
    let app = TestApp::start();
    let options = json!({"align": "none"});
    let first: Transfer = create(&app, motion().form(&options), Some("k")).await.is(202);
    let again = create(&app, motion().form(&options), Some("k")).await.expect(202);
    assert_eq!(again.header("location"), format!("/v1/transfers/{}", first.id));
    create(&app, motion().form(&json!({})), Some("k")).await.problem(422, "idempotency-key-reused");
    let list: TransferList = app.get("/v1/transfers").await.is(200);
    assert_eq!(list.transfers.len(), 1);
}

#[tokio::test]
async fn one_that_is_deleted_while_it_runs_makes_room_for_the_next() {
    let slow = Arc::<SlowDesigns>::default();
    let app = Inside::start(&slow, |config| config.max_transfer_queue = 1).await;
    let options = json!({"align": "none"});
    let first = created(&app, &options).await;
    running(&app, &first.id).await;
    // However many come at once, one may wait.
    let at_once = join_all((0..4).map(|_| create(&app, motion().form(&options), None))).await;
    let (taken, refused): (Vec<_>, Vec<_>) = at_once.into_iter().partition(|reply| reply.status == 202);
    assert_eq!(taken.len(), 1);
    let second: Transfer = taken[0].json();
    for reply in refused {
        reply.problem(429, "too-many-jobs");
        assert!(reply.retry_after() > Duration::ZERO);
    }
    let designing = async || {
        let found = transfer(&app, &first.id).await;
        (found.stage == Some(TransferStage::Designing) && slow.running.load(SeqCst) == 1).then_some(found)
    };
    // It is laid onto the target before, which takes its time on a busy machine.
    let found = within("its cage is designed", PATIENCE, async {
        loop {
            if let Some(found) = designing().await {
                return found;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    });
    assert_eq!(found.await.moved, first.frames);
    let path = format!("/v1/transfers/{}", first.id);
    let events = {
        let (api, path) = ((*app).clone(), format!("{path}/events"));
        tokio::spawn(async move { api.get(&path).await.expect(200).text() })
    };
    app.get(&format!("{path}/capture.cager")).await.problem(409, "not-completed");
    app.delete(&path).await.expect(204);
    assert!(events.await.expect("a stream").ends_with("event: deleted\ndata: {}\n\n"));
    app.get(&path).await.problem(404, "not-found");
    eventually("its design stops", async || {
        (slow.begun.load(SeqCst) == 2 || slow.running.load(SeqCst) == 0).then_some(())
    })
    .await;
    slow.release();
    assert!(!completed(&app, &second.id).await.is_empty());
}

#[tokio::test]
async fn tenants_have_transfers_and_quotas_of_their_own() {
    let app =
        TestApp::guarded_with(&[("anna", ANNA, ""), ("bert", BERT, "max_sessions = 1\nmax_bytes = 20000\n")], &[]);
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    let job = created(&anna, &json!({})).await;
    for rest in ["", "/events", "/frames", "/report", "/capture.cager"] {
        bert.get(&format!("/v1/transfers/{}{rest}", job.id)).await.problem(404, "not-found");
    }
    bert.delete(&format!("/v1/transfers/{}", job.id)).await.problem(404, "not-found");
    let list: TransferList = bert.get("/v1/transfers").await.is(200);
    assert!(list.transfers.is_empty());
    let session = anna.completed(&motion().capture, 2).await;
    let stolen = json!({"source_session": session.id});
    let form = reqwest::multipart::Form::new()
        .part("target", crate::support::file("copy.obj", &motion().target))
        .part("options", crate::support::text(&stolen));
    assert!(create(&bert, form, None).await.problem(422, "invalid-options").detail.contains("no session"));
    create(&bert, motion().form(&json!({})), None).await.problem(507, "quota-exceeded");
    assert_ne!(transfer(&anna, &job.id).await.state, JobState::Failed);
}
