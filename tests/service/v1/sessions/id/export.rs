//! `GET /v1/sessions/{id}/export`.

use crate::support::{Capture, OCTETS, TestApp, eventually, folder};
use http::Method;
use std::process::Command;

/// What `cager decode` makes of a container.
fn decoded(container: &[u8], format: &str) -> Vec<u8> {
    let folder = folder();
    let (input, output) = (folder.path().join("capture.cager"), folder.path().join(format!("capture.{format}")));
    std::fs::write(&input, container).expect("written");
    let done = Command::new(env!("CARGO_BIN_EXE_cager")).arg("decode").arg(&input).arg("-o").arg(&output).output();
    let done = done.expect("the program");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    std::fs::read(&output).expect("a file")
}

#[tokio::test]
async fn a_completed_session_is_written_in_the_formats_of_other_programs() {
    let app = TestApp::start();
    let session = app.completed(Capture::small(), 15).await;
    let container = app.container(&session.id).await;
    for (format, media_type) in [
        ("abc", "application/octet-stream"),
        ("glb", "model/gltf-binary"),
        ("mdd", "application/octet-stream"),
        ("npy", "application/octet-stream"),
        ("pc2", "application/octet-stream"),
        ("usdc", "model/vnd.usd"),
        ("usdz", "model/vnd.usdz+zip"),
    ] {
        let path = format!("/v1/sessions/{}/export?format={format}", session.id);
        let reply = app.get(&path).await.expect(200);
        assert_eq!(reply.header("content-type"), media_type);
        assert_eq!(reply.header("content-disposition"), format!("attachment; filename=\"capture.{format}\""));
        assert!(reply.body == decoded(&container, format), "{format} differs from that of the command line");
        let part = app.get_with(&path, &[("range", "bytes=10-19")]).await.expect(206);
        assert_eq!(part.body, reply.body[10..20]);
        app.get_with(&path, &[("if-none-match", reply.header("etag"))]).await.expect(304);
        if ["abc", "glb", "usdc"].contains(&format) {
            let same = app.get(&format!("/v1/sessions/{}/capture.{format}", session.id)).await.expect(200);
            assert!(
                same.body == reply.body && same.header("content-type") == media_type,
                "{format} by its own address"
            );
        }
    }
    let path = format!("/v1/sessions/{}/export?format=npy", session.id);
    let head = app.request(Method::HEAD, &path).header("range", "bytes=10-19");
    assert_eq!(app.send(head).await.expect(200).header("content-range"), "");
    // Nothing of them is left.
    let left = || std::fs::read_dir(app.data().join("tmp")).expect("a folder").count();
    eventually("that they are removed", async || (left() == 0).then_some(())).await;
}

#[tokio::test]
async fn what_cannot_be_written_is_refused_in_words() {
    let app = TestApp::start();
    let session = app.ready(Capture::tiny()).await;
    let path = format!("/v1/sessions/{}/export", session.id);
    let problem = app.get(&format!("{path}?format=abc")).await.problem(409, "not-completed");
    assert!(problem.detail.contains("to complete"), "{}", problem.detail);
    let problem = app.get(&format!("{path}?format=fbx")).await.problem(400, "bad-request");
    assert!(problem.detail.contains("usdc"), "{}", problem.detail);
    app.get(&path).await.problem(400, "bad-request");
    app.get("/v1/sessions/none/export?format=abc").await.problem(404, "not-found");
    // A folder that takes no files.
    let session = app.completed(Capture::tiny(), 5).await;
    std::fs::remove_dir_all(app.data().join("tmp")).expect("removed");
    let path = format!("/v1/sessions/{}/export?format=abc", session.id);
    app.get(&path).await.problem(503, "storage-failed");
    let path = format!("/v1/sessions/{}/decode", session.id);
    app.post(&path, OCTETS, vec![0; 12]).await.problem(503, "storage-failed");
}
