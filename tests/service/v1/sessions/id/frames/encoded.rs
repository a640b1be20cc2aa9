//! Compressed bodies, and compressed answers.

use crate::support::{Capture, OCTETS, TestApp, lines};
use http::Method;
use std::io::Write as _;

pub(super) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    out.write_all(bytes).expect("compressed");
    out.finish().expect("compressed")
}

#[tokio::test]
async fn compressed_frames_are_the_frames_in_them() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let plain = app.completed(capture, 4).await;
    let zstd = |bytes: &[u8]| zstd::stream::encode_all(bytes, 1).expect("compressed");
    for (coding, bytes) in [("gzip", gzip(&capture.raw(0..4))), ("zstd", zstd(&capture.raw(0..4)))] {
        let session = app.ready(capture).await;
        let post = app.request(Method::POST, &format!("/v1/sessions/{}/frames", session.id));
        let post = post.header("content-type", OCTETS).header("content-encoding", coding).body(bytes);
        let reply = app.send(post).await.expect(200);
        assert_eq!(lines(&reply.body).len(), 4, "{coding}: {}", reply.text());
        assert_eq!(app.cages(&session.id).await, app.cages(&plain.id).await, "{coding}");
    }
}

#[tokio::test]
async fn unknown_codings_and_broken_ones_are_refused() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    let send = async |coding: &str, bytes: Vec<u8>| {
        let post = app.request(Method::POST, &format!("/v1/sessions/{}/frames", session.id));
        app.send(post.header("content-type", OCTETS).header("content-encoding", coding).body(bytes)).await
    };
    send("br", capture.raw(0..1)).await.problem(415, "media-type");
    let reply = send("gzip", capture.raw(0..1)).await;
    assert_eq!(reply.problem(400, "bad-request").status, 400);
    let mut cut = gzip(&capture.raw(0..4));
    cut.truncate(cut.len() / 2);
    let reply = send("gzip", cut).await;
    assert!(reply.status == 400 || reply.text().contains("bad-request"), "{}", reply.text());
    assert!(app.session(&session.id).await.frames.solved < 4);
}

#[tokio::test]
async fn a_small_body_that_unpacks_to_a_large_one_is_bounded() {
    let app = TestApp::with(&["max_rest_bytes=1 MiB"]);
    let form = b"--b\r\nContent-Disposition: form-data; name=\"rest\"; filename=\"rest.obj\"\r\n\r\n";
    let bomb = gzip(&[&form[..], &vec![b'#'; 64 << 20]].concat());
    assert!(bomb.len() < 1 << 20);
    let post = app.request(Method::POST, "/v1/sessions").header("content-encoding", "gzip");
    let reply = app.send(post.header("content-type", "multipart/form-data; boundary=b").body(bomb)).await;
    reply.problem(413, "too-large");
}

#[tokio::test]
async fn frames_that_unpack_to_very_much_are_refused_at_some_point() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    let still = capture.raw(0..1).repeat((40 << 20) / capture.raw(0..1).len());
    let bomb = zstd::stream::encode_all(&still[..], 1).expect("compressed");
    assert!(100 * bomb.len() < still.len());
    let post = app.request(Method::POST, &format!("/v1/sessions/{}/frames", session.id));
    let reply = app.send(post.header("content-type", OCTETS).header("content-encoding", "zstd").body(bomb)).await;
    assert!(reply.text().contains("unpacks to more than 100 times its length"), "{}", reply.text().len());
}

#[tokio::test]
async fn a_window_that_is_too_large_is_refused() {
    let app = TestApp::start();
    let session = app.ready(Capture::tiny()).await;
    let mut out = zstd::stream::write::Encoder::new(Vec::new(), 1).expect("an encoder");
    out.set_parameter(zstd::zstd_safe::CParameter::WindowLog(27)).expect("a window");
    for _ in 0..64 {
        out.write_all(&vec![7; 1 << 20]).expect("compressed");
    }
    let bytes = out.finish().expect("compressed");
    let post = app.request(Method::POST, &format!("/v1/sessions/{}/frames", session.id));
    let reply = app.send(post.header("content-type", OCTETS).header("content-encoding", "zstd").body(bytes)).await;
    reply.problem(400, "bad-request");
}

#[tokio::test]
async fn texts_are_compressed_for_who_wants_it_and_numbers_are_not() {
    let app = TestApp::start();
    let session = app.completed(Capture::small(), 3).await;
    let list = app.get_with("/v1/sessions", &[("accept-encoding", "gzip")]).await.expect(200);
    assert_eq!(list.header("content-encoding"), "gzip");
    assert!(list.body.starts_with(&[0x1f, 0x8b]));
    let cages = app.get_with(&format!("/v1/sessions/{}/cages", session.id), &[("accept-encoding", "gzip, zstd")]).await;
    assert!(!cages.expect(200).headers.contains_key("content-encoding"));
}
