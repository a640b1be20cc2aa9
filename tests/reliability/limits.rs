//! Requests that are too large, or not what they say.

use crate::capture::Reference;
use crate::process::{HANG, Server, Setup};
use crate::wire::Wire;
use std::time::{Duration, Instant};
use tokio::io::AsyncWriteExt as _;
use tokio::time::timeout;

/// What can be known from a header is said at once.
const AT_ONCE: Duration = Duration::from_millis(800);

async fn server(folder: &tempfile::TempDir) -> Server {
    let settings = ["max_rest_bytes=8 MiB", "upload_bytes=24 MiB", "tenant_max_bytes=1 GiB"];
    Setup::new(&folder.path().join("data"), &settings).start().await
}

/// Sends chunks until the server has had enough; gives what it says and how many bytes it was sent.
async fn flood(mut wire: Wire, piece: &[u8]) -> (crate::wire::Heard, usize) {
    let (mut sent, mut chunk) = (0, format!("{:x}\r\n", piece.len()).into_bytes());
    chunk.extend_from_slice(piece);
    chunk.extend_from_slice(b"\r\n");
    let clock = Instant::now();
    while sent < 400 << 20 {
        // A server that has answered stops reading.
        match timeout(Duration::from_millis(1500), wire.0.write_all(&chunk)).await {
            Ok(Ok(())) => sent += piece.len(),
            _ => break,
        }
        assert!(clock.elapsed() < HANG);
    }
    (wire.hear("\r\n\r\n").await, sent)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_too_large_is_refused_before_it_comes() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = server(&folder).await;
    let reference = Reference::new(300, 40, 4);
    let session = server.client().create(&reference.session("limits", None)).await.expect("a session");
    let session = server.client().wait_ready(&session.id, HANG).await.expect("a session that is ready");
    let frames = format!("/v1/sessions/{}/frames", session.id);
    let complete = format!("/v1/sessions/{}/complete", session.id);
    let octets = "Content-Type: application/octet-stream\r\n";
    let form = "Content-Type: multipart/form-data; boundary=b\r\n";
    let cases = [
        ("/v1/sessions", form, "10000000000", 413),
        ("/v1/sessions", form, "18446744073709551613", 413),
        (&complete, "Content-Type: application/json\r\n", "1000000000", 413),
        (&frames, octets, "1000000000000", 507),
        (&frames, octets, "18446744073709551613", 507),
        (&format!("{frames}?rows=handles"), octets, "18446744073709551613", 507),
        (&frames, octets, "18446744073709551616", 400),
        (&frames, octets, "-1", 400),
        (&frames, octets, "12, 13", 400),
        (&frames, "Content-Type: application/octet-stream\r\nContent-Length: 7\r\n", "8", 400),
    ];
    for (path, lines, length, status) in cases {
        let mut wire = Wire::connect(server.address).await;
        wire.post(path, &format!("{lines}Content-Length: {length}\r\n")).await;
        let heard = wire.hear("\r\n\r\n").await;
        assert_eq!(heard.status(), status, "{path} {length}: {heard:?}");
        assert!(heard.after < AT_ONCE, "{path} {length}: {heard:?}");
    }
    let mut wire = Wire::connect(server.address).await;
    wire.send(format!("GET /v1/sessions HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "x".repeat(40_000))).await;
    assert_eq!(wire.hear("\r\n\r\n").await.status(), 431);
    let mut wire = Wire::connect(server.address).await;
    let lines: String = (0..150).map(|k| format!("X-{k}: 1\r\n")).collect();
    wire.send(format!("GET /v1/sessions HTTP/1.1\r\nHost: localhost\r\n{lines}\r\n")).await;
    assert_eq!(wire.hear("\r\n\r\n").await.status(), 431);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bodies_without_an_end_do_not_fill_the_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = server(&folder).await;
    let reference = Reference::new(300, 40, 4);
    let session = server.client().create(&reference.session("limits", None)).await.expect("a session");
    let before = server.rss();
    let complete = format!("/v1/sessions/{}/complete", session.id);
    let form = "Content-Type: multipart/form-data; boundary=b\r\n";
    let json = "Content-Type: application/json\r\n";
    let part = "--b\r\nContent-Disposition: form-data; name=\"rest\"; filename=\"rest.obj\"\r\n";
    let cases: [(&str, &str, &str, &[u16]); 5] = [
        // No part ever begins, a part's header never ends, a file never does, and a part of a name never does.
        ("/v1/sessions", form, "", &[400]),
        ("/v1/sessions", form, part, &[400]),
        ("/v1/sessions", form, &format!("{part}\r\n"), &[413]),
        ("/v1/sessions", form, "--b\r\nContent-Disposition: form-data; name=\"options\"\r\n\r\n", &[413]),
        (&complete, json, "", &[413, 400]),
    ];
    let piece = [b'x'; 64 << 10];
    for (path, lines, begin, statuses) in cases {
        let mut wire = Wire::connect(server.address).await;
        wire.post(path, &format!("{lines}Transfer-Encoding: chunked\r\n")).await;
        if !begin.is_empty() {
            wire.chunk(begin.as_bytes()).await;
        }
        let (heard, sent) = flood(wire, &piece).await;
        assert!(statuses.contains(&heard.status()), "{path} {begin:?} after {sent} bytes: {heard:?}");
        assert!(sent < 40 << 20, "{path} {begin:?}: {sent} bytes were taken");
    }
    // Together they may take what the service has for models; who comes then is told to wait.
    let wires = (0..12).map(|_| async {
        let mut wire = Wire::connect(server.address).await;
        wire.post("/v1/sessions", &format!("{form}Transfer-Encoding: chunked\r\n")).await;
        wire.chunk(format!("{part}\r\n").as_bytes()).await;
        flood(wire, &piece).await.0.status()
    });
    let statuses = futures_util::future::join_all(wires).await;
    assert!(statuses.iter().all(|status| matches!(status, 413 | 503)), "{statuses:?}");
    assert!(statuses.contains(&503), "{statuses:?}");
    let after = server.rss();
    println!("{before:.0} MiB before, {after:.0} MiB after; {statuses:?}");
    assert!(after < before + 96.0, "memory grew from {before:.0} to {after:.0} MiB");
    // All of it is free again.
    server.client().create(&reference.session("later", Some("later"))).await.expect("a session");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_body_of_another_length_than_declared_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = server(&folder).await;
    let reference = Reference::new(300, 40, 4);
    let session = server.client().create(&reference.session("lengths", None)).await.expect("a session");
    let session = server.client().wait_ready(&session.id, HANG).await.expect("a session that is ready");
    let path = format!("/v1/sessions/{}/frames", session.id);
    let octets = "Content-Type: application/octet-stream\r\n";
    let frame = reference.bytes(0).len();
    // More than declared: what follows is no request.
    let mut wire = Wire::connect(server.address).await;
    wire.post(&path, &format!("{octets}Content-Length: {frame}\r\n")).await;
    wire.send(reference.many(0..2)).await;
    let heard = wire.hear_all().await;
    assert_eq!(heard.text.matches("\"frame\":").count(), 1, "{heard:?}");
    // Less than declared, then the end: what came whole is kept.
    let mut wire = Wire::connect(server.address).await;
    wire.post(&path, &format!("{octets}Content-Length: {}\r\n", 3 * frame)).await;
    wire.send(reference.many(0..2)).await;
    wire.0.shutdown().await.expect("half a close");
    wire.hear_all().await;
    // Not whole frames.
    let mut wire = Wire::connect(server.address).await;
    wire.post(&path, &format!("{octets}Content-Length: {}\r\n", frame + 5)).await;
    wire.send(&reference.many(0..2)[..frame + 5]).await;
    let heard = wire.hear("bad-request").await;
    assert!(heard.text.contains("after 5 of"), "{heard:?}");
    assert_eq!(server.get("/readyz").await, Some(200));
}
