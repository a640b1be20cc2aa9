//! Clients that go away, or stop, in the middle of an upload.

use crate::support::{Capture, OCTETS, Raw, TestApp, chunked, eventually};
use std::time::{Duration, Instant};

/// Waits until nothing is left of an upload; gives the time that took.
async fn forgotten(app: &TestApp) -> Duration {
    let clock = Instant::now();
    eventually("the upload is forgotten", async || {
        let names = ["cager_queue_frames", "cager_streams", "cager_memory_bytes{use=\"frames\"}"];
        for name in names {
            if app.metric(name).await > 0.0 {
                return None;
            }
        }
        Some(())
    })
    .await;
    clock.elapsed()
}

#[tokio::test]
async fn a_client_that_vanishes_costs_nothing_any_more() {
    let capture = Capture::new(20_000, 200, 4);
    let app = TestApp::with(&["workers=1"]);
    let session = app.ready(&capture).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    let frames = capture.raw(0..4);
    let mut clients = Vec::new();
    for _ in 0..4 {
        let mut raw = Raw::connect(&app).await;
        raw.post_chunked(&path, &[]).await;
        for _ in 0..8 {
            raw.write(&chunked(&frames)).await;
        }
        clients.push(raw);
    }
    drop(clients);
    let took = forgotten(&app).await;
    eprintln!("forgotten after {took:?}");
    assert!(took < Duration::from_secs(5), "{took:?}");
    // What was solved before stays, and the rest can be posted again.
    let solved = app.session(&session.id).await.frames.solved;
    assert_eq!(app.errors(&session.id).await.len() as u64, solved);
    assert_eq!(app.upload(&session.id, 0, frames).await.len(), 4);
}

#[tokio::test]
async fn a_client_that_leaves_behind_much_that_is_packed_is_noticed() {
    let capture = Capture::tiny();
    let app = TestApp::with(&["workers=1"]);
    let session = app.ready(capture).await;
    let frame = capture.raw(0..1);
    let count = (24 << 20) / frame.len();
    let mut body = frame.repeat(count);
    // More of it when packed than the connection's own buffers hold.
    for (k, frame) in body.chunks_exact_mut(frame.len()).enumerate() {
        for (at, byte) in (k as u32).wrapping_mul(0x9e37_79b9).to_le_bytes().into_iter().take(3).enumerate() {
            frame[12 * 40 * at] = byte;
        }
    }
    let packed = super::encoded::gzip(&body);
    assert!(packed.len() > 300_000 && 100 * packed.len() > body.len(), "{}", packed.len());
    let mut raw = Raw::connect(&app).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    raw.post_chunked(&path, &[("content-encoding", "gzip")]).await;
    raw.write(&chunked(&packed)).await;
    raw.write(b"0\r\n\r\n").await;
    drop(raw);
    assert!(forgotten(&app).await < Duration::from_secs(5));
    let solved = app.session(&session.id).await.frames.solved;
    assert!(solved < count as u64 / 2, "{solved} of {count} were solved for nobody");
}

#[tokio::test]
async fn a_body_that_stops_arriving_is_given_up() {
    let app = TestApp::with(&["body_timeout_s=1"]);
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let mut raw = Raw::connect(&app).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    raw.head("POST", &path, &[("content-type", OCTETS), ("content-length", "18000")]).await;
    raw.write(&capture.frame(0)[..100]).await;
    raw.reply().await.problem(408, "request-timeout");
    forgotten(&app).await;
}
