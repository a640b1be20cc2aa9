//! The data folder is the service's own: nobody else on the machine looks into it.

use crate::support::{Capture, OCTETS, TestApp, form};
use serde_json::json;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

/// Every folder and file with its mode, where it is not as it should be.
fn open_to_others(path: &Path, wrong: &mut Vec<String>) -> usize {
    // What is written moves to its place meanwhile.
    let Ok(metadata) = std::fs::symlink_metadata(path) else { return 0 };
    let (mode, expected) = (metadata.permissions().mode() & 0o7777, if metadata.is_dir() { 0o700 } else { 0o600 });
    if mode != expected {
        wrong.push(format!("{} has {mode:o}", path.display()));
    }
    if !metadata.is_dir() {
        return 1;
    }
    let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
    entries.map(|entry| open_to_others(&entry.path(), wrong)).sum()
}

#[tokio::test]
async fn what_is_stored_is_for_the_services_user_alone() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    app.completed(capture, 3).await;
    // Coded frames wait in files of their own, and a second one is only begun.
    let coded = app.create_with(form(capture, &json!({"max_error": 0.01})), None).await;
    let coded: cager_proto::messages::Session = coded.is(201);
    app.prepared(&coded.id).await;
    app.upload(&coded.id, 0, capture.raw(0..2)).await;
    app.post(&format!("/v1/sessions/{}/decode", coded.id), OCTETS, vec![0; 12]).await;
    let job = app.design(capture, &json!({"vertices": 20, "time_limit_s": 1})).await;
    app.solver_stored().await;
    let mut wrong = Vec::new();
    let files = open_to_others(&app.data(), &mut wrong);
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(files > 10, "{files} files");
    app.delete(&format!("/v1/cages/{}", job.id)).await.expect(204);
}

#[tokio::test]
async fn a_folder_that_is_open_to_all_is_pointed_out() {
    let mut app = TestApp::with_its_files(&[]);
    let said = "every user of this machine may look into the data folder";
    assert!(!app.log().contains(said), "{}", app.log());
    app.kill();
    // A volume may belong to somebody else, and be open; what lies in it is closed.
    let open = |folder: &Path| std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755));
    open(&app.data()).expect("permissions");
    let mut app = app.again();
    assert!(!app.log().contains(said), "{}", app.log());
    app.kill();
    open(&app.data().join("contents")).expect("permissions");
    let app = app.again();
    assert!(app.log().contains(said) && app.log().contains("chmod"), "{}", app.log());
}
