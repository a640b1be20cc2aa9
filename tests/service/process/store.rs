//! `cager store`: what a service has stored, while it does not run.

use crate::support::{Capture, TestApp, folder};
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
        said(&copied).contains("wrote 2 containers, and 0 were there already; 1 sessions are"),
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
    assert!(said(&unknown).contains("there is no session x"), "{}", said(&unknown));

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
