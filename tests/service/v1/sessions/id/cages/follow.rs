//! `follow=true`: cages as they come.

use crate::support::{Capture, RECORDS, Raw, TestApp, eventually, piece, records};
use bytes::Bytes;
use futures_util::StreamExt as _;
use futures_util::future::join_all;
use http::Method;
use std::time::Duration;

#[tokio::test]
async fn readers_at_every_pace_get_all_cages_in_order() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/cages?first=0&follow=true", session.id);
    let reader = async |pause: Duration, http2: bool| {
        let api = if http2 { app.http2() } else { app.stranger() };
        let mut response = api.open(&path).await;
        let mut all = Vec::new();
        while let Some(piece) = piece("more cages", &mut response).await.expect("a stream") {
            all.extend_from_slice(&piece);
            tokio::time::sleep(pause).await;
        }
        Bytes::from(all)
    };
    let late = async {
        tokio::time::sleep(Duration::from_millis(300)).await;
        reader(Duration::ZERO, false).await
    };
    let upload = async {
        // Backwards, so that order is the service's work.
        for k in (0..8).rev() {
            app.upload(&session.id, 5 * k, capture.raw(5 * k..5 * k + 5)).await;
            tokio::time::sleep(Duration::from_millis(40)).await;
        }
        app.complete(&session.id, 40).await.expect(200);
    };
    let pauses = [(0, false), (0, true), (1, false), (30, false), (100, true)];
    let readers = join_all(pauses.map(|(ms, http2)| reader(Duration::from_millis(ms), http2)));
    let ((), read, late) = tokio::join!(upload, readers, late);
    let expected = app.cages(&session.id).await;
    assert!(read.iter().all(|cages| *cages == expected), "every reader has all of them, in order");
    assert!(late == expected);
    // What is completed is followed to its end at once.
    assert!(app.get(&path).await.expect(200).body == expected);
}

#[tokio::test]
async fn a_cage_is_followed_as_soon_as_it_is_solved() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/cages?first=0&follow=true", session.id);
    let mut response = app.request(Method::GET, &path).header("accept", RECORDS).send().await.expect("an answer");
    for frame in 0..4 {
        app.upload(&session.id, frame, capture.frame(frame)).await;
        let piece = piece("the cage", &mut response).await.expect("a stream").expect("a cage");
        assert_eq!(records(&piece, session.unknowns.expect("known"))[0].frame, frame);
    }
    // A gap is waited for.
    app.upload(&session.id, 5, capture.frame(5)).await;
    assert!(tokio::time::timeout(Duration::from_millis(200), response.chunk()).await.is_err());
    app.upload(&session.id, 4, capture.frame(4)).await;
    let mut rest = Vec::new();
    app.complete(&session.id, 6).await.expect(200);
    while let Some(piece) = piece("the end", &mut response).await.expect("a stream") {
        rest.extend_from_slice(&piece);
    }
    assert!(records(&rest, session.unknowns.expect("known")).iter().map(|cage| cage.frame).eq([4, 5]));
}

#[tokio::test]
async fn following_ends_after_count_frames() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..10)).await;
    let all = app.cages(&session.id).await;
    let stride = all.len() / 10;
    let path = format!("/v1/sessions/{}/cages?first=2&count=5&follow=true", session.id);
    assert!(app.get(&path).await.expect(200).body == all[2 * stride..7 * stride]);
}

#[tokio::test]
async fn the_client_follows_to_the_end() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let follower = app.client().follow(&session.id, 0);
    let upload = async {
        app.upload(&session.id, 0, capture.raw(0..40)).await;
        app.complete(&session.id, 40).await.expect(200);
    };
    let (cages, ()) = tokio::join!(follower.collect::<Vec<_>>(), upload);
    let frames: Vec<u32> = cages.into_iter().map(|cage| cage.expect("a cage").frame).collect();
    assert!(frames.into_iter().eq(0..40));
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn followers_that_stop_reading_cost_no_memory_and_disturb_nobody() {
    const FRAMES: u32 = 2000;
    const STALLED: usize = 30;
    let capture = Capture::new(400, 300, 20);
    let app = TestApp::start();
    let session = app.ready(&capture).await;
    let path = format!("/v1/sessions/{}/cages?first=0&follow=true", session.id);
    let mut stalled = Vec::new();
    for _ in 0..STALLED {
        let mut raw = Raw::narrow(&app).await;
        raw.head("GET", &path, &[]).await;
        stalled.push(raw);
    }
    let before = app.resident_mib();
    let mut reader = app.open(&path).await;
    let body = capture.raw(0..20).repeat((FRAMES / 20) as usize);
    let upload = async {
        assert_eq!(app.upload(&session.id, 0, body).await.len(), FRAMES as usize);
        app.complete(&session.id, FRAMES).await.expect(200);
    };
    let read = async {
        let mut bytes = 0;
        while let Some(piece) = piece("more cages", &mut reader).await.expect("a stream") {
            bytes += piece.len();
        }
        bytes
    };
    let ((), bytes) = tokio::join!(upload, read);
    assert_eq!(bytes, FRAMES as usize * 12 * session.unknowns.expect("known") as usize);
    let grown = app.resident_mib().saturating_sub(before);
    eprintln!("{STALLED} stalled followers of {} MiB each: {grown} MiB", bytes >> 20);
    assert!(grown < 100, "memory grew by {grown} MiB");
    // One of them wakes up, and nothing is lost.
    let mut late = stalled.pop().expect("one");
    assert_eq!(late.reply().await.expect(200).body.len(), bytes);
    drop(stalled);
    eventually("their places are free", async || (app.metric("cager_streams").await == 0.0).then_some(())).await;
}
