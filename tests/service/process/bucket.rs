//! Files in a bucket: the service goes on with them on a machine that has nothing but the addresses of its database and its bucket.

use super::database::refused_with;
use crate::support::{Api, Capture, Database, OCTETS, TestApp, eventually, folder, form};
use cager_proto::messages::Session;
use serde_json::json;
use std::time::{Duration, Instant};

async fn coded_session(api: &Api, capture: &Capture) -> String {
    let created: Session = api.create_with(form(capture, &json!({ "max_error": 1e-3 })), None).await.is(201);
    api.prepared(&created.id).await.id
}

#[tokio::test(flavor = "multi_thread")]
async fn after_a_kill_another_machine_goes_on_with_all_sessions() {
    let Some(database) = Database::with_bucket() else { return };
    let mut app = TestApp::on(&database, &[]);
    let (capture, long) = (Capture::small(), Capture::new(200, 32, 300));
    let whole = app.completed(capture, 40).await;
    let container = app.container(&whole.id).await;
    let plain = app.ready(capture).await;
    let told = app.upload(&plain.id, 0, capture.raw(0..15)).await;
    let coded = coded_session(&app, &long).await;
    // A group, and frames that wait: they come in several writes.
    app.upload(&coded, 0, long.raw(0..256)).await;
    eventually("a group is coded", async || app.session(&coded).await.coding.filter(|coding| coding.frames == 256))
        .await;
    app.upload(&coded, 256, long.raw(256..270)).await;
    app.upload(&coded, 270, long.raw(270..280)).await;
    let gone = app.completed(capture, 10).await;
    app.delete(&format!("/v1/sessions/{}", gone.id)).await.expect(204);
    app.kill();

    let app = app.elsewhere().ready();
    assert!(app.container(&whole.id).await == container);
    assert_eq!(app.errors(&plain.id).await, told);
    app.upload(&plain.id, 15, capture.raw(15..40)).await;
    app.complete(&plain.id, 40).await.expect(200);
    assert!(app.container(&plain.id).await == capture.encoded(40));
    assert_eq!(app.session(&coded).await.frames.solved, 280);
    app.upload(&coded, 280, long.raw(280..300)).await;
    app.complete(&coded, 300).await.expect(200);
    assert!(app.container(&coded).await == long.encoded_with(300, &["--max-error", "0.001"]));
    app.get(&format!("/v1/sessions/{}", gone.id)).await.problem(404, "not-found");
    for id in [&whole.id, &plain.id, &coded] {
        app.delete(&format!("/v1/sessions/{id}")).await.expect(204);
    }
    for folder in ["sessions", "contents", "quarantine"] {
        assert_eq!(database.files(folder), [""; 0], "{folder}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn files_of_a_folder_are_taken_over_by_a_bucket() {
    let Some(database) = Database::with_bucket() else { return };
    let mut app = TestApp::in_folder();
    let capture = Capture::small();
    let whole = app.completed(capture, 40).await;
    let container = app.container(&whole.id).await;
    let begun = app.ready(capture).await;
    app.upload(&begun.id, 0, capture.raw(0..15)).await;
    app.terminate();
    assert!(app.ended().await.0.success());
    // A bucket needs a database.
    let said = refused_with(&app.data(), &["--blobs", "s3://bucket/x"], &[]);
    assert!(said.contains("blobs is set but catalog is not"), "{said}");
    let mut moved = app.moved_to(&database);
    assert!(moved.container(&whole.id).await == container);
    moved.upload(&begun.id, 15, capture.raw(15..40)).await;
    moved.kill();
    // The folder is a cache now, and knows it.
    let environment = database.environment();
    let said = refused_with(&moved.data(), &["--catalog", &database.url()], &environment);
    assert!(said.contains("are in a bucket: name it by --blobs s3://"), "{said}");
    let elsewhere = ["--catalog", &database.url(), "--blobs", "s3://cager/elsewhere"];
    let said = refused_with(folder().path(), &elsewhere, &environment);
    assert!(said.contains("which is new: is the right one mounted"), "{said}");
    let other = Database::start().expect("another one");
    let flags = database.flags();
    let said = refused_with(&moved.data(), &["--catalog", &other.url(), "--blobs", &flags[3]], &environment);
    assert!(said.contains("is empty, and the data folder"), "{said}");
    let moved = moved.elsewhere().ready();
    moved.complete(&begun.id, 40).await.expect(200);
    assert!(moved.container(&begun.id).await == container);
}

#[tokio::test(flavor = "multi_thread")]
async fn while_the_bucket_is_away_the_service_says_so_and_it_goes_on_afterwards() {
    let Some(database) = Database::with_bucket() else { return };
    let mut app = TestApp::on(&database, &[]);
    let capture = Capture::small();
    let (plain, coded) = (app.ready(capture).await, coded_session(&app, capture).await);
    app.upload(&coded, 0, capture.raw(0..5)).await;
    database.kill_bucket();
    // Frames that are not coded are in the database.
    app.upload(&plain.id, 0, capture.raw(0..40)).await;
    let clock = Instant::now();
    let path = format!("/v1/sessions/{coded}/frames?first=5");
    let refused = app.post(&path, OCTETS, capture.raw(5..10)).await.text();
    assert!(refused.contains("storage-failed"), "{refused}");
    app.complete(&plain.id, 40).await.problem(503, "storage-failed");
    assert!(clock.elapsed() < Duration::from_secs(40), "{:?}", clock.elapsed());
    assert_eq!(app.get("/readyz").await.status, 503);
    database.run_bucket();
    eventually("it is ready", async || (app.get("/readyz").await.status == 200).then_some(())).await;
    app.upload(&coded, 5, capture.raw(5..40)).await;
    for id in [&plain.id, &coded] {
        app.complete(id, 40).await.expect(200);
    }
    // The same folder is a cache after a restart too.
    app.kill();
    let app = app.again();
    assert!(app.container(&plain.id).await == capture.encoded(40));
    assert!(app.container(&coded).await == capture.encoded_with(40, &["--max-error", "0.001"]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bucket_that_refuses_writes_is_told_and_nothing_is_half_written() {
    let Some(database) = Database::with_bucket() else { return };
    let app = TestApp::on(&database, &[]);
    let capture = Capture::small();
    let (plain, coded) = (app.ready(capture).await, coded_session(&app, capture).await);
    app.upload(&coded, 0, capture.raw(0..5)).await;
    let before = database.files("sessions").len();
    database.set_bucket_read_only(true);
    app.upload(&plain.id, 0, capture.raw(0..40)).await;
    let path = format!("/v1/sessions/{coded}/frames?first=5");
    let refused = app.post(&path, OCTETS, capture.raw(5..10)).await.text();
    assert!(refused.contains("storage-failed"), "{refused}");
    app.complete(&plain.id, 40).await.problem(503, "storage-failed");
    assert_eq!(app.get("/readyz").await.status, 503);
    // What is there can be read.
    assert_eq!(app.session(&coded).await.frames.solved, 5);
    database.set_bucket_read_only(false);
    assert_eq!(database.files("sessions").len(), before);
    eventually("it is ready", async || (app.get("/readyz").await.status == 200).then_some(())).await;
    app.upload(&coded, 5, capture.raw(5..40)).await;
    for (id, more) in [(&plain.id, &[][..]), (&coded, &["--max-error", "0.001"])] {
        app.complete(id, 40).await.expect(200);
        assert!(app.container(id).await == capture.encoded_with(40, more));
    }
}
