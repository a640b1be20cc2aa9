//! Frames may come in any order, over any connections, cut into any pieces: the result is the same to the bit.

use crate::support::{Api, Capture, OCTETS, RECORDS, Raw, TestApp, chunked, form, lines};
use cager_proto::messages::{FrameResult, Session};
use futures_util::future::join_all;
use serde_json::json;
use std::ops::Range;

/// Pseudorandom numbers below `bound` (splitmix64).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % bound
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        for k in (1..items.len()).rev() {
            items.swap(k, self.below(k as u64 + 1) as usize);
        }
    }

    /// All frames in ranges of one to six, in no order.
    fn ranges(&mut self, frames: u32) -> Vec<Range<u32>> {
        let mut ranges = Vec::new();
        let mut next = 0;
        while next < frames {
            let end = frames.min(next + 1 + self.below(6) as u32);
            ranges.push(next..end);
            next = end;
        }
        self.shuffle(&mut ranges);
        ranges
    }
}

/// Posts a range as it is, as records, or as records of which the handles came before.
async fn post(api: &Api, id: &str, capture: &Capture, range: Range<u32>, form: u64) -> Vec<FrameResult> {
    if form == 0 {
        return api.upload(id, range.start, capture.raw(range)).await;
    }
    let body = capture.records(range.rev());
    lines(&api.post(&format!("/v1/sessions/{id}/frames"), RECORDS, body).await.expect(200).body)
}

#[tokio::test]
async fn random_ranges_over_ten_connections_give_the_container_of_cager_encode() {
    let app = TestApp::start();
    let capture = Capture::small();
    let expected = capture.encoded(capture.count());
    for (seed, http2) in [(1, false), (2, true), (3, false)] {
        let session = app.ready(capture).await;
        let mut random = Random(seed);
        let mut ranges = random.ranges(capture.count());
        // Some frames come twice.
        ranges.extend(random.ranges(capture.count()).into_iter().take(3));
        let mut shares = vec![Vec::new(); 10];
        for (k, range) in ranges.into_iter().enumerate() {
            shares[k % 10].push((range, random.below(2)));
        }
        let connection = async |share: Vec<(Range<u32>, u64)>| {
            let api = if http2 { app.http2() } else { app.stranger() };
            for (range, form) in share {
                assert_eq!(post(&api, &session.id, capture, range.clone(), form).await.len(), range.len());
            }
        };
        join_all(shares.into_iter().map(connection)).await;
        app.complete(&session.id, capture.count()).await.expect(200);
        let container = app.container(&session.id).await;
        assert!(container == expected, "seed {seed}: {} and {} bytes differ", container.len(), expected.len());
    }
}

#[tokio::test]
async fn handle_rows_alone_give_the_same_cages_to_the_bit() {
    let app = TestApp::start();
    let capture = Capture::small();
    for handles in ["maxvol", "rectangular", "spread"] {
        let ready = async || {
            let options = json!({ "handles": handles });
            let session: Session = app.create_with(form(capture, &options), None).await.expect(201).json();
            app.prepared(&session.id).await
        };
        let whole = ready().await;
        let measured = app.upload(&whole.id, 0, capture.raw(0..capture.count())).await;
        assert!(measured.iter().all(|result| result.l2.is_some() && result.linf.is_some()));
        let light = ready().await;
        let handles = app.handles(&light.id).await;
        assert_eq!(light.handle_count, Some(handles.len() as u32));
        let path = format!("/v1/sessions/{}/frames?first=0&rows=handles", light.id);
        let rows = capture.handle_rows(0..20, &handles);
        let results = lines(&app.post(&path, OCTETS, rows).await.expect(200).body);
        assert!(results.iter().all(|result| result.l2.is_none() && result.linf.is_none()), "nothing could be measured");
        let path = format!("/v1/sessions/{}/frames", light.id);
        let rows = capture.handle_records(20..capture.count(), &handles);
        app.http2().post(&path, RECORDS, rows).await.expect(200);
        assert!(app.cages(&light.id).await == app.cages(&whole.id).await);
    }
}

#[tokio::test]
async fn the_body_may_be_cut_anywhere() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let reference = app.ready(capture).await;
    app.upload(&reference.id, 0, capture.raw(0..4)).await;
    let expected = app.cages(&reference.id).await;
    for (media_type, body, pieces) in [
        (OCTETS, capture.raw(0..4), vec![1, 11, 2400, 2401, 100_000]),
        (RECORDS, capture.records(0..4), vec![1, 27, 29, 5000]),
    ] {
        for size in pieces {
            let session = app.ready(capture).await;
            let mut raw = Raw::connect(&app).await;
            let path = format!("/v1/sessions/{}/frames?first=0", session.id);
            raw.head("POST", &path, &[("transfer-encoding", "chunked"), ("content-type", media_type)]).await;
            for some in body.chunks(64 * size) {
                let chunks: Vec<u8> = some.chunks(size).flat_map(chunked).collect();
                raw.write(&chunks).await;
            }
            raw.write(b"0\r\n\r\n").await;
            assert_eq!(lines(&raw.reply().await.expect(200).body).len(), 4, "chunks of {size}");
            assert!(app.cages(&session.id).await == expected, "chunks of {size}");
        }
    }
}

#[tokio::test]
async fn the_client_and_a_plain_request_agree() {
    let app = TestApp::start();
    let capture = Capture::small();
    let plain = app.completed(capture, capture.count()).await;
    let session = app.create(capture).await;
    let client = app.client();
    let frames = cager_client::MemoryFrames::new(capture.points(), capture.frames.concat());
    let uploaded = client.upload(&session, frames, Default::default()).await.expect("an upload");
    assert_eq!(uploaded.frames, capture.count());
    client.complete(&session.id, uploaded.frames).await.expect("completed");
    let mut container = Vec::new();
    client.download(&session.id, &mut container).await.expect("a container");
    assert!(container == app.container(&plain.id).await);
}
