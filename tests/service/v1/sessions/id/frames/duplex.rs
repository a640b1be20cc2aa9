//! Records come back while the upload runs, and wait where nobody reads them.

use crate::support::{
    Capture, HANG, OCTETS, RECORDS, Raw, Reply, TestApp, chunked, eventually, lines, piece, records, within,
};
use bytes::Bytes;
use cager_proto::messages::FrameResult;
use http::Method;
use reqwest::Body;
use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::time::Duration;
use tokio::sync::mpsc;

/// A body that is sent piece by piece.
fn open_body() -> (mpsc::UnboundedSender<Vec<u8>>, Body) {
    let (send, mut pieces) = mpsc::unbounded_channel();
    let stream = futures_util::stream::poll_fn(move |cx| {
        pieces.poll_recv(cx).map(|piece| piece.map(|piece| Ok::<_, Infallible>(Bytes::from(piece))))
    });
    (send, Body::wrap_stream(stream))
}

#[tokio::test]
async fn the_first_record_comes_while_the_upload_is_open() {
    let app = TestApp::start();
    let capture = Capture::small();
    for api in [app.stranger(), app.http2()] {
        let session = app.ready(capture).await;
        let (send, body) = open_body();
        send.send(capture.frame(0)).expect("open");
        let path = format!("/v1/sessions/{}/frames?first=0&live=true", session.id);
        let request = api.request(Method::POST, &path).header("content-type", OCTETS).body(body);
        let mut response = within("an answer to half an upload", HANG, request.send()).await.expect("an answer");
        for frame in 0..5 {
            let chunk = piece("a record", &mut response).await.expect("a stream").expect("a record");
            assert_eq!(lines(&chunk).iter().map(|result| result.frame).collect::<Vec<_>>(), [frame]);
            // It is on disk, so everybody can have it.
            assert_eq!(app.errors(&session.id).await.len(), frame as usize + 1);
            if frame < 4 {
                send.send(capture.frame(frame + 1)).expect("open");
            }
        }
        drop(send);
        assert_eq!(piece("the end", &mut response).await.expect("a stream"), None);
    }
}

#[tokio::test]
async fn the_first_record_comes_over_a_plain_socket_too() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let mut raw = Raw::connect(&app).await;
    let path = format!("/v1/sessions/{}/frames?first=0&live=true", session.id);
    raw.post_chunked(&path, &[("accept", RECORDS)]).await;
    for frame in 0..3 {
        raw.write(&chunked(&capture.frame(frame))).await;
        if frame == 0 {
            assert_eq!(raw.answer().await.expect(200).header("content-type"), RECORDS);
        }
        let piece = raw.piece().await.expect("a record");
        assert_eq!(records(&piece, session.unknowns.expect("known"))[0].frame, frame);
    }
    raw.write(b"0\r\n\r\n").await;
    assert!(raw.piece().await.is_none());
    // The connection is as good as new.
    raw.head("GET", "/healthz", &[]).await;
    raw.reply().await.expect(200);
}

#[tokio::test]
async fn an_answer_that_is_not_asked_for_earlier_begins_after_the_last_byte() {
    let app = TestApp::start();
    let capture = Capture::small();
    for accept in ["application/x-ndjson", RECORDS] {
        let session = app.ready(capture).await;
        let mut raw = Raw::connect(&app).await;
        let path = format!("/v1/sessions/{}/frames?first=0", session.id);
        raw.post_chunked(&path, &[("accept", accept)]).await;
        let mut events = app.open(&format!("/v1/sessions/{}/events", session.id)).await;
        raw.write(&chunked(&capture.raw(0..30))).await;
        // Frames are solved meanwhile, and can be watched.
        eventually("frames are solved", async || (app.errors(&session.id).await.len() == 30).then_some(())).await;
        piece("progress", &mut events).await.expect("a stream").expect("an event");
        let early = tokio::time::timeout(Duration::from_millis(5500), raw.answer()).await;
        assert!(early.is_err(), "{early:?}");
        raw.write(&[chunked(&capture.raw(30..40)), b"0\r\n\r\n".to_vec()].concat()).await;
        let reply = raw.reply().await.expect(200);
        let frames: Vec<u32> = match accept {
            RECORDS => records(&reply.body, session.unknowns.expect("known")).iter().map(|cage| cage.frame).collect(),
            _ => lines(&reply.body).iter().map(|result| result.frame).collect(),
        };
        assert!(frames.into_iter().collect::<BTreeSet<_>>().into_iter().eq(0..40));
    }
}

#[tokio::test]
async fn records_carry_the_numbers_that_can_be_asked_for_later() {
    let app = TestApp::start();
    let capture = Capture::small();
    for api in [app.stranger(), app.http2()] {
        let session = app.ready(capture).await;
        let path = format!("/v1/sessions/{}/frames?first=0", session.id);
        let as_lines = api.post(&path, OCTETS, capture.raw(0..10)).await.expect(200);
        assert_eq!(as_lines.header("content-type"), "application/x-ndjson");
        let mut results = lines(&as_lines.body);
        let path = format!("/v1/sessions/{}/frames?first=10", session.id);
        let request = api.request(Method::POST, &path).header("content-type", OCTETS).header("accept", RECORDS);
        let reply = Reply::of(request.body(capture.raw(10..40)).send().await.expect("an answer")).await.expect(200);
        let cages = records(&reply.body, session.unknowns.expect("known"));
        results.extend(cages.iter().map(|cage| FrameResult { frame: cage.frame, l2: cage.l2, linf: cage.linf }));
        results.sort_by_key(|result| result.frame);
        assert_eq!(results, app.errors(&session.id).await);
        let all = app.get(&format!("/v1/sessions/{}/cages?first=10", session.id)).await.expect(200).body;
        let later = crate::support::cages_of(&all, session.unknowns.expect("known"));
        let now: BTreeMap<u32, Vec<f32>> = cages.into_iter().map(|cage| (cage.frame, cage.values)).collect();
        assert!(now.into_values().eq(later), "the records are the cages");
    }
}

#[tokio::test]
async fn a_client_that_writes_everything_before_it_reads_gets_everything() {
    const FRAMES: u32 = 2000;
    // Seven megabytes come back: more than sockets hold, above all one that takes little.
    let capture = Capture::new(400, 300, 20);
    let app = TestApp::start();
    let session = app.ready(&capture).await;
    let mut raw = Raw::narrow(&app).await;
    let length = (FRAMES as usize * 12 * capture.points()).to_string();
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    raw.head("POST", &path, &[("content-type", OCTETS), ("content-length", &length), ("accept", RECORDS)]).await;
    let loop_of_20 = capture.raw(0..20);
    for _ in 0..FRAMES / 20 {
        raw.write(&loop_of_20).await;
    }
    let reply = raw.reply().await.expect(200);
    let mut cages = records(&reply.body, session.unknowns.expect("known"));
    cages.sort_by_key(|cage| cage.frame);
    assert!(cages.iter().map(|cage| cage.frame).eq(0..FRAMES), "one record for each frame");
    assert!(cages.iter().all(|cage| cage.values == cages[cage.frame as usize % 20].values));
    assert_eq!(app.session(&session.id).await.frames.solved, u64::from(FRAMES));
}

#[tokio::test]
async fn an_upload_of_nothing_is_answered_with_nothing() {
    let app = TestApp::start();
    let session = app.ready(Capture::tiny()).await;
    assert!(app.upload(&session.id, 0, Vec::new()).await.is_empty());
    assert_eq!(app.session(&session.id).await.frames.received, 0);
}
