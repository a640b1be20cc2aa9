//! Transfers and restarts.

use super::{completed, created, ended, motion, running, transfer};
use crate::support::{Database, TestApp};
use cager_proto::messages::JobState;
use serde_json::json;
use std::time::Duration;

#[tokio::test]
async fn a_killed_service_goes_on_with_those_that_ran_and_waited() {
    let mut app = TestApp::start();
    let options = json!({"align": "none"});
    let (first, second) = (created(&app, &options).await, created(&app, &options).await);
    running(&app, &first.id).await;
    app.kill();
    let mut app = app.again();
    assert_eq!(transfer(&app, &second.id).await.created, second.created);
    let expected = motion().moved("--align none");
    for id in [&first.id, &second.id] {
        assert!(completed(&app, id).await == expected, "another file than that of the command line");
    }
    // What is completed stays as it is.
    let done = transfer(&app, &first.id).await;
    app.kill();
    let app = app.again();
    assert_eq!(transfer(&app, &first.id).await, done);
    assert!(completed(&app, &first.id).await == expected);
}

#[tokio::test]
async fn one_that_ends_the_service_again_and_again_is_given_up() {
    let mut app = TestApp::with_its_files(&[]);
    let [_, waiting] = [created(&app, &json!({})).await, created(&app, &json!({})).await];
    app.kill();
    let folder = app.data().join("transfers").join(&waiting.id);
    app.set_record(&waiting.id, "attempts = 5");
    let app = app.again();
    let failed = ended(&app, &waiting.id).await;
    assert_eq!(failed.state, JobState::Failed);
    assert!(failed.problem.is_some_and(|problem| problem.detail.contains("given up")));
    assert!(folder.join("target").exists());
    app.delete(&format!("/v1/transfers/{}", waiting.id)).await.expect(204);
    assert!(!folder.exists());
}

#[tokio::test]
async fn an_outage_of_the_database_holds_those_that_run_and_wait_up_and_ends_none() {
    let Some(database) = Database::start() else { return };
    let app = TestApp::on(&database, &[]);
    let mut jobs = Vec::new();
    for _ in 0..3 {
        jobs.push(created(&app, &json!({"align": "none"})).await);
    }
    running(&app, &jobs[0].id).await;
    database.kill();
    // The first one comes to its end meanwhile, the others to their beginning.
    tokio::time::sleep(Duration::from_secs(4)).await;
    for job in &jobs {
        let found = transfer(&app, &job.id).await;
        assert!(!found.state.is_final(), "{found:?}");
    }
    database.run();
    let expected = motion().moved("--align none");
    for job in &jobs {
        assert!(completed(&app, &job.id).await == expected, "another file than that of the command line");
    }
}
