//! Webhooks: that a session was completed or failed is told at least once.

use crate::support::{Capture, Elsewhere, Heard, TestApp, eventually, folder};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use cager_proto::messages::SessionState;
use ring::hmac;
use serde_json::{Value, json};
use std::time::Duration;

const SECRET: &[u8] = b"a secret of thirty-two bytes....";

/// A service that tells `receiver`, and the folder of its file.
fn telling(receiver: &Elsewhere, more: &str) -> (tempfile::TempDir, TestApp) {
    let place = folder();
    let file = place.path().join("webhooks.toml");
    let secret = BASE64_STANDARD.encode(SECRET);
    let text =
        format!("[[webhook]]\nurl = \"{}/hook?of=farm\"\nsecret = \"whsec_{secret}\"\n{more}\n", receiver.address);
    std::fs::write(&file, text).expect("a file");
    let app = TestApp::with_its_files(&[&format!("webhooks={}", file.display())]);
    (place, app)
}

fn checked(heard: &Heard) -> Value {
    let key = hmac::Key::new(hmac::HMAC_SHA256, SECRET);
    let signed = [
        format!("{}.{}.", heard.header("webhook-id"), heard.header("webhook-timestamp")).into_bytes(),
        heard.body.to_vec(),
    ]
    .concat();
    let signature = heard.header("webhook-signature").strip_prefix("v1,").expect("version 1");
    let signature = BASE64_STANDARD.decode(signature).expect("base64");
    hmac::verify(&key, &signed, &signature).expect("the receiver's secret fits");
    assert_eq!(heard.header("content-type"), "application/json");
    serde_json::from_slice(&heard.body).expect("a message")
}

#[tokio::test]
async fn a_completed_session_is_told_of_once_the_receiver_takes_it() {
    let receiver = Elsewhere::with(&[500]).await;
    let (_place, app) = telling(&receiver, "");
    let session = app.completed(Capture::tiny(), 2).await;
    let (first, second) = (receiver.next().await, receiver.next().await);
    let message = checked(&first);
    assert_eq!(checked(&second), message, "the same again, after it was not taken");
    assert_eq!(first.header("webhook-id"), second.header("webhook-id"));
    assert_eq!((&message["type"], &message["data"]["tenant"]), (&json!("session.completed"), &json!("local")));
    assert_eq!(message["data"]["session"]["id"], json!(session.id));
    assert_eq!(message["data"]["session"]["state"], json!("completed"));
    assert_eq!(message["data"]["session"]["frames"]["solved"], json!(2));
    let at = message["timestamp"].as_str().expect("a time");
    assert!(at.starts_with("20") && at.ends_with('Z') && at.contains('T'), "{at}");
    // Completing it again changes nothing, and says nothing.
    app.complete(&session.id, 2).await.expect(200);
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(receiver.left(), 0);
    let delivered = async || app.metric("cager_webhooks_total{result=\"delivered\"}").await;
    eventually("that it is counted", async || (delivered().await == 1.0).then_some(())).await;
}

#[tokio::test]
async fn what_was_not_delivered_is_told_after_a_restart() {
    let receiver = Elsewhere::with(&[503]).await;
    let (_place, mut app) = telling(&receiver, "");
    let session = app.completed(Capture::tiny(), 2).await;
    let first = receiver.next().await;
    app.kill();
    let mut app = app.again();
    let second = receiver.next().await;
    assert_eq!(checked(&second), checked(&first));
    assert_eq!(checked(&second)["data"]["session"]["id"], json!(session.id));
    eventually("that it is delivered", async || {
        (app.metric("cager_webhooks_total{result=\"delivered\"}").await == 1.0).then_some(())
    })
    .await;
    app.kill();
    let app = app.again();
    app.session(&session.id).await;
    tokio::time::sleep(Duration::from_millis(500)).await;
    assert_eq!(receiver.left(), 0, "it was delivered");
}

#[tokio::test]
async fn what_is_found_completed_only_after_preparing_again_is_told_as_well() {
    let receiver = Elsewhere::with(&[503]).await;
    let (_place, mut app) = telling(&receiver, "");
    let session = app.completed(Capture::tiny(), 2).await;
    let first = receiver.next().await;
    app.kill();
    app.set_record(&session.id, "outcome = NULL");
    let _app = app.again();
    assert_eq!(receiver.next().await.header("webhook-id"), first.header("webhook-id"));
}

#[tokio::test]
async fn a_session_that_cannot_be_prepared_is_told_of_with_its_reason() {
    let receiver = Elsewhere::with(&[]).await;
    let (_place, mut app) = telling(&receiver, "events = [\"session.failed\"]");
    app.completed(Capture::tiny(), 1).await;
    let session = app.ready(Capture::small()).await;
    app.kill();
    // Nothing of its preparation is left, nor of its rest pose.
    app.set_record(&session.id, "outcome = NULL");
    for folder in ["prepared", "contents"] {
        let folder = app.session_file("", &format!("../{folder}"));
        std::fs::remove_dir_all(&folder).expect("a folder");
        std::fs::create_dir(&folder).expect("a folder");
    }
    let app = app.again();
    assert_eq!(app.settled(&session.id).await.state, SessionState::Failed);
    let message = checked(&receiver.next().await);
    assert_eq!((&message["type"], &message["data"]["session"]["id"]), (&json!("session.failed"), &json!(session.id)));
    assert!(message["data"]["session"]["problem"]["detail"].is_string());
    assert_eq!(receiver.left(), 0, "what was completed was not asked for");
}

#[tokio::test]
async fn damage_is_told_of() {
    let receiver = Elsewhere::with(&[]).await;
    let (_place, mut app) = telling(&receiver, "events = [\"session.failed\"]");
    let session = app.ready(Capture::tiny()).await;
    app.upload(&session.id, 0, Capture::tiny().raw(0..2)).await;
    app.kill();
    app.damage_frames(&session.id);
    let _app = app.again();
    let message = checked(&receiver.next().await);
    assert_eq!((&message["type"], &message["data"]["session"]["state"]), (&json!("session.failed"), &json!("failed")));
}

#[tokio::test]
async fn a_receiver_that_is_gone_is_left_alone() {
    let receiver = Elsewhere::with(&[410]).await;
    let (_place, app) = telling(&receiver, "");
    app.completed(Capture::tiny(), 1).await;
    receiver.next().await;
    app.completed(Capture::tiny(), 1).await;
    eventually("both are given up", async || {
        (app.metric("cager_webhooks_total{result=\"gone\"}").await == 2.0).then_some(())
    })
    .await;
    assert_eq!(receiver.left(), 0);
}

#[test]
fn a_file_that_is_wrong_stops_the_start_and_shows_no_secret() {
    let place = folder();
    let file = place.path().join("webhooks.toml");
    std::fs::write(&file, "[[webhook]]\nurl = \"http://hooks.example/\"\nsecret = \"whsec_c2VjcmV0\"\n")
        .expect("a file");
    let mut command = crate::support::service();
    command.args(["--listen", "127.0.0.1:0", "--data"]).arg(place.path().join("data"));
    command.arg("--set").arg(format!("webhooks={}", file.display()));
    let output = command.output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && said.contains("webhooks.toml: line 2") && said.contains("https"), "{said}");
    assert!(!said.contains("c2Vj"), "{said}");
}

#[tokio::test]
async fn a_job_that_ends_is_told_of_also_after_a_restart() {
    let receiver = Elsewhere::with(&[500, 500]).await;
    let (_place, mut app) = telling(&receiver, "events = [\"job.completed\", \"job.failed\"]");
    let capture = Capture::tiny();
    let job = app.design(capture, &json!({"vertices": 32, "time_limit_s": 10.0, "name": "a cage"})).await;
    let first = checked(&receiver.next().await);
    assert_eq!((&first["type"], &first["data"]["tenant"]), (&json!("job.completed"), &json!("local")));
    let told = &first["data"]["job"];
    let expected = (json!("cage"), json!(job.id), json!("a cage"), json!("completed"));
    assert_eq!(
        (&told["kind"], &told["id"], &told["name"], &told["state"]),
        (&expected.0, &expected.1, &expected.2, &expected.3)
    );
    assert_eq!(told["url"], json!(format!("/v1/cages/{}", job.id)));
    // It was not taken, and the service ends before it is sent again.
    app.kill();
    let app = app.again();
    assert_eq!(checked(&receiver.next().await), first, "the same again");
    assert_eq!(checked(&receiver.next().await), first, "until it is taken");
    // A session is not what was asked for.
    app.completed(capture, 2).await;
    let delivered = async || app.metric("cager_webhooks_total{result=\"delivered\"}").await;
    eventually("that it is counted", async || (delivered().await == 1.0).then_some(())).await;
    assert_eq!(receiver.left(), 0);
}
