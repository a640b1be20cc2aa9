//! Transfers and restarts.

use super::{completed, created, ended, motion, running, transfer};
use crate::support::TestApp;
use cager_proto::messages::JobState;
use serde_json::json;

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
