//! `cager store`: what a service has stored, while it does not run.

use crate::support::{Capture, TestApp, folder};
use crate::v1::recoveries;
use serde_json::json;
use std::path::Path;
use std::process::{Command, Output};

fn store(data: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cager"));
    command.arg("store").args(arguments).arg("--data").arg(data).output().expect("it runs")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[tokio::test]
async fn what_is_stored_is_counted_checked_and_copied() {
    let mut app = TestApp::in_folder();
    let capture = Capture::small();
    let (whole, other) = (app.completed(capture, 40).await.id, app.completed(capture, 10).await.id);
    let container = app.container(&whole).await;
    let running = app.ready(capture).await.id;
    app.upload(&running, 0, capture.raw(0..15)).await;
    let data = app.data();
    let busy = store(&data, &["verify"]);
    assert!(!busy.status.success() && said(&busy).contains("is in use by another process"), "{}", said(&busy));
    app.terminate();
    assert!(app.ended().await.0.success());

    let usage = store(&data, &["usage"]);
    assert!(usage.status.success(), "{}", said(&usage));
    let local = said(&usage).lines().find(|line| line.starts_with("local ")).map(str::to_owned).expect("its line");
    let numbers: Vec<u64> = local.split_whitespace().skip(1).map(|word| word.parse().expect("a number")).collect();
    assert!(numbers[..2] == [3, 0] && numbers[2] > container.len() as u64, "{local}");
    let whole_one = store(&data, &["verify"]);
    assert!(whole_one.status.success() && said(&whole_one).contains("nothing is damaged"), "{}", said(&whole_one));

    let copies = folder();
    let copied = store(&data, &["export", &copies.path().display().to_string()]);
    assert!(copied.status.success(), "{}", said(&copied));
    assert!(
        said(&copied).contains("wrote 2 files, and 0 were there already; 1 sessions and jobs are"),
        "{}",
        said(&copied)
    );
    let path = copies.path().join(format!("local/{whole}.cager"));
    assert!(std::fs::read(&path).expect("a copy") == container);
    // It may be repeated, and what is there and differs is not replaced.
    let again = store(&data, &["export", &copies.path().display().to_string()]);
    assert!(again.status.success() && said(&again).contains("2 were there already"), "{}", said(&again));
    std::fs::write(&path, "mine").expect("written");
    let again = store(&data, &["export", "--session", &whole, &copies.path().display().to_string()]);
    assert!(!again.status.success() && said(&again).contains(&whole), "{}", said(&again));
    assert_eq!(std::fs::read(&path).expect("a file"), b"mine");
    let unknown = store(&data, &["export", "--session", "x", &copies.path().display().to_string()]);
    assert!(said(&unknown).contains("there is no session or job x"), "{}", said(&unknown));

    let path = app.session_file(&other, "capture.cager");
    let mut bytes = std::fs::read(&path).expect("a container");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).expect("written");
    let damaged = store(&data, &["verify"]);
    assert_eq!(damaged.status.code(), Some(1), "{}", said(&damaged));
    assert!(said(&damaged).contains(&format!("session {other} of local: ")), "{}", said(&damaged));
    assert!(said(&damaged).contains("1 of them are damaged") && !said(&damaged).contains(&whole), "{}", said(&damaged));
    assert!(said(&damaged).contains("complete the session again"), "{}", said(&damaged));
    let copies = folder();
    let copied = store(&data, &["export", &copies.path().display().to_string()]);
    assert_eq!(copied.status.code(), Some(1), "{}", said(&copied));
    assert!(said(&copied).contains(&format!("session {other} of local: ")), "{}", said(&copied));
    assert!(std::fs::read(copies.path().join(format!("local/{whole}.cager"))).expect("a copy") == container);
    assert!(!copies.path().join(format!("local/{other}.cager")).exists());
    let nowhere = store(&data.join("none"), &["usage"]);
    assert!(said(&nowhere).contains("there is no such folder"), "{}", said(&nowhere));
    let a_file = store(&data.join("catalog.db"), &["usage"]);
    assert!(said(&a_file).contains("is a file, not a folder"), "{}", said(&a_file));
    let empty = folder();
    for command in [&["verify"][..], &["usage"], &["export", "copies"]] {
        let elsewhere = store(empty.path(), command);
        assert_eq!(elsewhere.status.code(), Some(1), "{}", said(&elsewhere));
        assert!(said(&elsewhere).contains("no service's data is here"), "{}", said(&elsewhere));
        assert_eq!(std::fs::read_dir(empty.path()).expect("a folder").count(), 0, "nothing is made there");
    }
}

#[tokio::test]
async fn results_and_input_of_jobs_are_checked_and_results_copied() {
    let mut app = TestApp::in_folder();
    let capture = Capture::tiny();
    let done = app.design(capture, &json!({"vertices": 32, "time_limit_s": 10.0})).await;
    app.designed(&done.id).await;
    let cage = app.get(&format!("/v1/cages/{}/cage.obj", done.id)).await.expect(200).body;
    let recovery = recoveries::created(&app, &json!({"points": 800})).await;
    recoveries::post_first(&app, &recovery.id).await.expect(200);
    let data = app.data();
    app.terminate();
    assert!(app.ended().await.0.success());
    let whole = store(&data, &["verify"]);
    assert!(whole.status.success(), "{}", said(&whole));
    let copies = folder();
    let copied = store(&data, &["export", &copies.path().display().to_string()]);
    assert!(said(&copied).contains("wrote 1 files") && copied.status.success(), "{}", said(&copied));
    assert!(std::fs::read(copies.path().join(format!("local/{}.obj", done.id))).expect("a copy") == cage);
    for (path, of) in [
        (data.join("cages").join(&done.id).join("cage.obj"), format!("cage job {} of local: ", done.id)),
        (data.join("recoveries").join(&recovery.id).join("frame-0"), format!("recovery {} of local: ", recovery.id)),
    ] {
        let kept = std::fs::read(&path).expect("a file");
        let mut bytes = kept.clone();
        *bytes.last_mut().expect("bytes") ^= 1;
        std::fs::write(&path, bytes).expect("written");
        let damaged = store(&data, &["verify"]);
        assert!(damaged.status.code() == Some(1) && said(&damaged).contains(&of), "{}", said(&damaged));
        std::fs::write(&path, kept).expect("written");
    }
}
