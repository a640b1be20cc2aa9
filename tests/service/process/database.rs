//! What is known of sessions in a database: the service goes on with it as with its own file, a second one waits to take over, and what has been taken over
//! changes nothing any more.

use crate::support::{Capture, Database, OCTETS, TestApp, eventually, folder, service};
use cager_proto::messages::SessionState;
use reqwest::Method;
use rustix::process::{Pid, Signal, kill_process};
use std::process::Stdio;
use std::time::{Duration, Instant};

/// What a service that does not start says.
fn refused(data: &std::path::Path, catalog: Option<&str>) -> String {
    let flags: Vec<&str> = catalog.into_iter().flat_map(|url| ["--catalog", url]).collect();
    refused_with(data, &flags, &[])
}

/// As [`refused`], with these flags and variables.
pub(super) fn refused_with(data: &std::path::Path, flags: &[&str], environment: &[(&str, String)]) -> String {
    let mut command = service();
    command.args(["--listen", "127.0.0.1:0", "--data"]).arg(data).args(flags);
    command.envs(environment.iter().map(|(name, value)| (name, value)));
    let done = command.output().expect("the service");
    assert!(!done.status.success());
    String::from_utf8(done.stderr).expect("text")
}

#[tokio::test]
async fn sessions_in_a_database_go_on_after_a_kill_and_end_in_the_same_container() {
    let Some(database) = Database::start() else { return };
    let mut app = TestApp::on(&database, &[]);
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let first = app.upload(&session.id, 0, capture.raw(0..15)).await;
    let cages = app.cages(&session.id).await;
    app.kill();
    let app = app.again();
    assert_eq!(app.session(&session.id).await.frames.solved, 15);
    assert_eq!(app.errors(&session.id).await, first);
    assert!(app.cages(&session.id).await == cages);
    app.upload(&session.id, 15, capture.raw(15..40)).await;
    app.complete(&session.id, 40).await.expect(200);
    assert!(app.container(&session.id).await == capture.encoded(40));
    app.delete(&format!("/v1/sessions/{}", session.id)).await.expect(204);
    eventually("that nothing is left of it", async || {
        (database.sql("SELECT count(*) FROM chunks") == "0").then_some(())
    })
    .await;
}

#[tokio::test]
async fn a_second_service_waits_and_takes_over_when_the_first_one_ends() {
    let Some(database) = Database::start() else { return };
    let mut first = TestApp::on(&database, &[]);
    let capture = Capture::small();
    let session = first.ready(capture).await;
    let told = first.upload(&session.id, 0, capture.raw(0..15)).await;
    let waiting = first.beside();
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert!(waiting.log().contains("waits, to take over when that ends"), "{}", waiting.log());
    first.kill();
    let clock = Instant::now();
    let second = tokio::task::spawn_blocking(|| waiting.ready()).await.expect("it starts");
    assert!(clock.elapsed() < Duration::from_secs(10));
    assert_eq!(second.errors(&session.id).await, told);
    second.upload(&session.id, 15, capture.raw(15..40)).await;
    second.complete(&session.id, 40).await.expect(200);
    assert!(second.container(&session.id).await == capture.encoded(40));
}

#[tokio::test]
async fn a_service_that_was_taken_over_while_it_stood_still_changes_nothing_and_ends() {
    let Some(database) = Database::start() else { return };
    let mut first = TestApp::on(&database, &[]);
    let capture = Capture::small();
    let session = first.ready(capture).await;
    first.upload(&session.id, 0, capture.raw(0..15)).await;
    let waiting = first.beside();
    eventually("it waits", async || waiting.log().contains("waits, to take over").then_some(())).await;
    let process = Pid::from_raw(first.id() as i32).expect("it runs");
    kill_process(process, Signal::STOP).expect("it stands still");
    let clock = Instant::now();
    let second = tokio::task::spawn_blocking(|| waiting.ready()).await.expect("it starts");
    assert!(clock.elapsed() < Duration::from_secs(15), "{:?}", clock.elapsed());
    second.upload(&session.id, 15, capture.raw(15..20)).await;
    let other = second.completed(capture, 15).await;
    kill_process(process, Signal::CONT).expect("it goes on");
    let path = format!("/v1/sessions/{}/frames?first=20", session.id);
    let sent = first.request(Method::POST, &path).header("content-type", OCTETS).body(capture.raw(20..25)).send().await;
    // It may be gone already.
    if let Ok(answer) = sent {
        let said = answer.text().await.unwrap_or_default();
        assert!(said.contains("storage-failed"), "{said}");
    }
    // Nor does it remove what the other one has.
    let _ = first.request(Method::DELETE, &format!("/v1/sessions/{}", session.id)).send().await;
    let (status, _) = first.ended().await;
    assert!(!status.success());
    assert!(first.log().contains("another process has taken over the database"), "{}", first.log());
    assert_eq!(second.session(&session.id).await.frames.solved, 20);
    second.upload(&session.id, 20, capture.raw(20..40)).await;
    second.complete(&session.id, 40).await.expect(200);
    assert!(second.container(&session.id).await == capture.encoded(40));
    assert!(second.container(&other.id).await == capture.encoded(15));
}

#[tokio::test]
async fn while_the_database_is_away_the_service_says_so_and_it_goes_on_afterwards() {
    let Some(database) = Database::start() else { return };
    let app = TestApp::on(&database, &[]);
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    let whole = app.completed(capture, 15).await;
    database.kill();
    // Before the first byte, not in the middle of an answer.
    app.get(&format!("/v1/sessions/{}/cages?first=0", whole.id)).await.problem(503, "storage-failed");
    let problem = app.post(&path, OCTETS, capture.raw(0..15)).await;
    assert!(problem.text().contains("storage-failed"), "{}", problem.text());
    assert_eq!(app.get("/readyz").await.status, 503);
    database.run();
    eventually("that it is ready", async || (app.get("/readyz").await.status == 200).then_some(())).await;
    app.upload(&session.id, 0, capture.raw(0..40)).await;
    app.complete(&session.id, 40).await.expect(200);
    assert!(app.container(&session.id).await == capture.encoded(40));
}

#[tokio::test]
async fn a_database_that_hangs_is_named_in_time() {
    let Some(database) = Database::start() else { return };
    let app = TestApp::on(&database, &[]);
    let tables = database.sql("SELECT schemaname FROM pg_tables WHERE tablename = 'catalogue'");
    let hanging = std::thread::spawn({
        let (database, lock) = (database.clone(), format!("LOCK TABLE {tables}.catalogue; SELECT pg_sleep(7)"));
        move || database.sql(&lock)
    });
    let clock = eventually("that it hangs", async || {
        tokio::time::sleep(Duration::from_millis(200)).await;
        let clock = Instant::now();
        let reply = app.get("/readyz").await;
        (reply.status != 200).then(|| (clock.elapsed(), reply.problem(503, "storage-failed").detail))
    });
    let (waited, detail) = clock.await;
    assert!(
        waited < Duration::from_secs(5) && detail.starts_with("the database does not answer"),
        "{waited:?} {detail}"
    );
    hanging.join().expect("it ends");
    eventually("that it is ready", async || (app.get("/readyz").await.status == 200).then_some(())).await;
}

#[tokio::test]
async fn a_folder_with_a_catalogue_of_its_own_is_taken_over_by_a_database() {
    let Some(database) = Database::start() else { return };
    let mut app = TestApp::in_folder();
    let capture = Capture::small();
    let whole = app.completed(capture, 40).await;
    let container = app.container(&whole.id).await;
    let begun = app.ready(capture).await;
    let told = app.upload(&begun.id, 0, capture.raw(0..15)).await;
    app.terminate();
    assert!(app.ended().await.0.success());
    let mut moved = app.moved_to(&database);
    assert!(moved.container(&whole.id).await == container);
    assert_eq!(moved.session(&whole.id).await.state, SessionState::Completed);
    assert_eq!(moved.errors(&begun.id).await, told);
    moved.upload(&begun.id, 15, capture.raw(15..40)).await;
    moved.kill();
    // Without the database nothing of it is known.
    let said = refused(&moved.data(), None);
    assert!(said.contains("is in a database: name it by --catalog"), "{said}");
    let moved = moved.again();
    moved.complete(&begun.id, 40).await.expect(200);
    assert!(moved.container(&begun.id).await == container);
}

#[tokio::test]
async fn a_database_and_a_folder_that_do_not_belong_together_are_refused() {
    let Some(database) = Database::start() else { return };
    let mut app = TestApp::on(&database, &[]);
    let capture = Capture::small();
    let session = app.ready(capture).await;
    app.kill();
    let new = folder();
    let said = refused(new.path(), Some(&database.url()));
    assert!(said.contains("which is new: is the right one mounted"), "{said}");
    let mut other = TestApp::on(&Database::start().expect("another one"), &[]);
    other.kill();
    let said = refused(&other.data(), Some(&database.url()));
    assert!(said.contains("do not belong together"), "{said}");
    let said = refused(new.path(), Some("postgres://nobody:secret@127.0.0.1:1/none"));
    assert!(said.contains("cannot be reached") && !said.contains("secret"), "{said}");
    let said = refused(new.path(), Some("mysql://somewhere"));
    assert!(said.contains("write the address of a database, such as postgres://"), "{said}");
    assert_eq!(app.again().session(&session.id).await.frames.solved, 0);
}

#[test]
fn the_password_of_a_database_is_not_shown() {
    let mut command = service();
    let done =
        command.args(["--check-config", "--catalog", "postgres://me:secret@db/cager"]).stdin(Stdio::null()).output();
    let said = String::from_utf8(done.expect("the program").stdout).expect("text");
    assert!(said.contains("catalog = \"postgres://me:***@db/cager\"") && !said.contains("secret"), "{said}");
}

#[tokio::test]
async fn a_service_at_work_is_left_alone_by_one_that_is_started_wrongly() {
    let Some(database) = Database::start() else { return };
    // With its catalogue in a database, by one that was not told so.
    let app = TestApp::on(&database, &[]);
    let (capture, being_written) = (Capture::tiny(), app.data().join("tmp/spool"));
    let session = app.ready(capture).await;
    std::fs::write(&being_written, "what is being written").expect("written");
    let said = refused(&app.data(), None);
    assert!(said.contains("is in a database: name it by --catalog"), "{said}");
    assert!(being_written.exists());
    // By one with a database that knows nothing of it.
    let empty = Database::start().expect("another one");
    let said = refused(&app.data(), Some(&empty.url()));
    assert!(said.contains("is empty, and the data folder") && being_written.exists(), "{said}");
    app.upload(&session.id, 0, capture.raw(0..15)).await;
    // With a catalogue of its own, by one that would move it to a database.
    let app = TestApp::in_folder();
    let session = app.ready(capture).await;
    let said = refused(&app.data(), Some(&empty.url()));
    assert!(said.contains("is in use by another process"), "{said}");
    app.upload(&session.id, 0, capture.raw(0..15)).await;
}
