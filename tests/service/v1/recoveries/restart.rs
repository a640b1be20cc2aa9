//! Recoveries and restarts.

use super::{FRAMES, complete, completed, container, create, created, failed, post, recovery, scans, until};
use crate::support::{Database, TestApp};
use cager_proto::recovery_messages::Recovery;
use serde_json::json;
use std::time::Duration;

#[tokio::test]
async fn a_killed_service_keeps_every_frame_it_acknowledged_and_makes_the_same_file() {
    let mut app = TestApp::start();
    let scans = scans();
    let job = created(&app, &json!({"points": 800})).await;
    post(&app, &job.id, 0, scans.parts(0..2)).await.expect(200);
    until(&app, &job.id, |recovery| recovery.frames.followed >= 1).await;
    app.kill();
    let mut app = app.again();
    let found = recovery(&app, &job.id).await;
    assert_eq!((found.frames.received, found.created), (2, job.created));
    post(&app, &job.id, 1, scans.parts(0..1)).await.problem(409, "frame-conflict");
    post(&app, &job.id, 1, scans.parts(1..FRAMES)).await.expect(200);
    complete(&app, &job.id, FRAMES).await.expect(202);
    // In the midst of it.
    app.kill();
    let mut app = app.again();
    assert_eq!(recovery(&app, &job.id).await.frames.declared, Some(FRAMES));
    let done = completed(&app, &job.id).await;
    let made = container(&app, &job.id).await;
    assert!(made == scans.recovered("--points 800"), "another file than that of the command line");
    let cages = app.get(&format!("/v1/recoveries/{}/cages?first=1&count=2", job.id)).await.expect(200).body;
    // What is completed stays as it is.
    app.kill();
    let app = app.again();
    assert_eq!(recovery(&app, &job.id).await, done);
    assert_eq!(container(&app, &job.id).await, made);
    let again = app.get(&format!("/v1/recoveries/{}/cages?first=1&count=2", job.id)).await.expect(200).body;
    assert_eq!(again, cages);
}

#[tokio::test]
async fn a_recovery_that_waits_for_a_frame_outlives_any_number_of_restarts() {
    let scans = scans();
    for kills in [false, true] {
        let mut app = TestApp::start();
        let job: Recovery = create(&app, scans.caged_form(&json!({"points": 800})), None).await.is(202);
        post(&app, &job.id, 0, scans.parts(0..2)).await.expect(200);
        for _ in 0..6 {
            until(&app, &job.id, |recovery| recovery.frames.followed == 2).await;
            if kills {
                app.kill();
            } else {
                app.terminate();
                app.ended().await;
            }
            app = app.again();
        }
        let found = recovery(&app, &job.id).await;
        assert_eq!((found.frames.received, found.problem), (2, None), "killed: {kills}");
        post(&app, &job.id, 2, scans.parts(2..FRAMES)).await.expect(200);
        complete(&app, &job.id, FRAMES).await.expect(202);
        completed(&app, &job.id).await;
        let made = container(&app, &job.id).await;
        assert!(made == scans.recovered("--points 800 --cage cage.obj"), "another file than that of the command line");
    }
}

#[tokio::test]
async fn a_recovery_that_ends_the_service_again_and_again_is_given_up_and_keeps_its_frames() {
    let mut app = TestApp::start();
    let job = created(&app, &json!({"points": 800})).await;
    post(&app, &job.id, 0, scans().parts(0..2)).await.expect(200);
    until(&app, &job.id, |recovery| recovery.frames.followed == 2).await;
    app.kill();
    // As many beginnings as are allowed, none of which came as far as the one before.
    let folder = app.data().join("recoveries").join(&job.id);
    app.set_record(&job.id, "attempts = 5");
    let app = app.again();
    let failed = failed(&app, &job.id).await;
    assert!(failed.problem.is_some_and(|problem| problem.detail.contains("given up")));
    assert_eq!((failed.frames.received, folder.join("frame-1").exists()), (2, true));
    app.delete(&format!("/v1/recoveries/{}", job.id)).await.expect(204);
    assert!(!folder.exists());
}

#[tokio::test]
async fn a_damaged_frame_fails_the_recovery() {
    let mut app = TestApp::with_its_files(&[]);
    let job = created(&app, &json!({"points": 800})).await;
    post(&app, &job.id, 0, scans().parts(0..1)).await.expect(200);
    app.kill();
    let path = app.data().join("recoveries").join(&job.id).join("frame-0");
    let mut bytes = std::fs::read(&path).expect("a frame");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).expect("a frame");
    let app = app.again();
    let failed = failed(&app, &job.id).await;
    assert!(failed.problem.is_some_and(|problem| problem.detail.contains("damaged")));
    post(&app, &job.id, 1, scans().parts(1..2)).await.problem(409, "recovery-failed");
}

#[tokio::test]
async fn an_outage_of_the_database_holds_a_recovery_up_and_does_not_end_it() {
    let Some(database) = Database::start() else { return };
    let (app, scans) = (TestApp::on(&database, &[]), scans());
    let job = created(&app, &json!({"points": 800})).await;
    let waiting = created(&app, &json!({"points": 800})).await;
    for id in [&job.id, &waiting.id] {
        post(&app, id, 0, scans.parts(0..FRAMES)).await.expect(200);
        complete(&app, id, FRAMES).await.expect(202);
    }
    until(&app, &job.id, |recovery| recovery.frames.followed >= 1).await;
    database.kill();
    tokio::time::sleep(Duration::from_secs(4)).await;
    database.run();
    for id in [&job.id, &waiting.id] {
        completed(&app, id).await;
        assert!(container(&app, id).await == scans.recovered("--points 800"), "another file than the command line's");
    }
}
