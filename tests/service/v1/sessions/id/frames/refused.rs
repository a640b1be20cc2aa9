//! Frames that cannot be taken: what is said, and that nothing is kept.

use crate::support::{Capture, OCTETS, RECORDS, Reply, TestApp, lines};
use cager_proto::messages::Problem;
use cager_proto::record::{self, Kind};
use http::Method;

#[tokio::test]
async fn numbers_that_are_none_are_refused_with_frame_and_point() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/frames?first=7", session.id);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut frame = capture.frame(7);
        frame[12 * 1234 + 4..][..4].copy_from_slice(&bad.to_le_bytes());
        let problem = app.post(&path, OCTETS, frame).await.problem(422, "invalid-frame");
        assert_eq!(problem.frame, Some(7));
        assert!(problem.detail.contains("frame 7") && problem.detail.contains("point 1234"), "{}", problem.detail);
    }
    // Numbers whose cage has none in single precision.
    let sign = |k: usize| if k.is_multiple_of(2) { f32::MAX } else { f32::MIN };
    let large: Vec<u8> = (0..3 * capture.points()).flat_map(|k| sign(k / 3).to_le_bytes()).collect();
    app.post(&path, OCTETS, large).await.problem(422, "invalid-frame");
    assert!(app.errors(&session.id).await.is_empty(), "nothing is kept of it");
    assert_eq!(app.upload(&session.id, 7, capture.frame(7)).await.len(), 1, "and the right frame can still come");
}

#[tokio::test]
async fn a_body_that_ends_within_a_frame_is_refused_and_says_where() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    let problem = app.post(&path, OCTETS, capture.frame(0)[..1000].to_vec()).await.problem(400, "bad-request");
    assert!(problem.detail.contains("frame 0") && problem.detail.contains("1000 of"), "{}", problem.detail);
    let record = capture.records([0]);
    app.post(&path, RECORDS, record[..20].to_vec()).await.problem(400, "bad-request");
    // Whole frames before it are answered, and kept.
    let mut body = capture.raw(0..3);
    body.truncate(body.len() - 1);
    let reply = app.post(&path, OCTETS, body).await;
    let text = reply.text();
    let last: Problem = serde_json::from_str(text.lines().last().expect("a line")).expect("a problem");
    assert_eq!((last.status, last.word()), (400, "bad-request"));
    if reply.status == 200 {
        assert_eq!(lines(text.rsplit_once("{\"type\"").expect("two parts").0.as_bytes()).len(), 2);
    }
    assert_eq!(app.errors(&session.id).await.len(), 2);
}

#[tokio::test]
async fn what_is_no_upload_is_refused_before_it_is_read() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    let at = |query: &str| format!("/v1/sessions/{}/frames?{query}", session.id);
    let frame = || capture.frame(0);
    for media_type in ["application/json", "text/plain", "multipart/form-data; boundary=x", "application/octet-streams"]
    {
        app.post(&at("first=0"), media_type, frame()).await.problem(415, "media-type");
    }
    let untyped = app.request(Method::POST, &at("first=0")).body(frame());
    app.send(untyped).await.problem(415, "media-type");
    for query in ["first=0&rwos=all", "first=-1", "first=x", "first=4294967296", "first=0&rows=some", "frame=0"] {
        let problem = app.post(&at(query), OCTETS, frame()).await.problem(400, "bad-request");
        assert!(problem.detail.contains("query"), "{}", problem.detail);
    }
    let picky = app.request(Method::POST, &at("first=0")).header("content-type", OCTETS).header("accept", "text/html");
    app.send(picky.body(frame())).await.problem(406, "not-acceptable");
    assert!(app.errors(&session.id).await.is_empty());
    // Parameters of a media type and capitals are no reason to refuse.
    let reply = app.post(&at("first=0"), "Application/Octet-Stream; charset=binary", frame()).await;
    assert_eq!(lines(&reply.expect(200).body).len(), 1);
}

#[tokio::test]
async fn records_that_do_not_belong_here_are_refused() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/frames", session.id);
    let good = capture.records([0]);
    let change = |at: usize| {
        let mut record = good.clone();
        record[at] ^= 0x10;
        record
    };
    let mut cage = Vec::new();
    record::encode(Kind::Cage, 0, 0.0, 0.0, &capture.frames[0], &mut cage).expect("a record");
    for (what, body) in [
        ("magic", change(0)),
        ("version", change(4)),
        ("kind", change(6)),
        ("rows", change(12)),
        ("checksum", change(24)),
        ("values", change(100)),
        ("a cage", cage),
        ("raw frames", capture.raw(0..1)),
    ] {
        let problem = app.post(&path, RECORDS, body).await.problem(422, "invalid-frame");
        assert!(problem.detail.len() > 20, "{what}: {}", problem.detail);
    }
    assert!(app.errors(&session.id).await.is_empty());
}

#[tokio::test]
async fn an_error_after_the_first_record_cuts_a_stream_of_records_off() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    let mut body = capture.raw(0..40);
    body.truncate(body.len() - 1);
    for api in [app.stranger(), app.http2()] {
        let request = api.request(Method::POST, &path).header("content-type", OCTETS).header("accept", RECORDS);
        // Over HTTP/2 the cut may overtake the header.
        let Ok(response) = request.body(body.clone()).send().await else { continue };
        if response.status() == 200 {
            assert!(response.bytes().await.is_err(), "a stream that is not whole must not look whole");
        } else {
            Reply::of(response).await.problem(400, "bad-request");
        }
    }
}

#[tokio::test]
async fn numbers_beyond_the_declared_frames_are_refused_at_once() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let form = |frames: u32| crate::support::form(capture, &serde_json::json!({ "frames": frames }));
    let none = app.create_with(form(0), None).await.problem(422, "invalid-options");
    assert!(none.detail.contains("at least one frame"), "{}", none.detail);
    let session: cager_proto::messages::Session = app.create_with(form(3), None).await.is(201);
    app.settled(&session.id).await;
    app.upload(&session.id, 0, capture.raw(0..3)).await;
    let path = format!("/v1/sessions/{}/frames?first=4000000", session.id);
    let problem = app.post(&path, OCTETS, capture.frame(1)).await.problem(422, "invalid-frame");
    assert_eq!(problem.frame, Some(4_000_000));
    assert!(problem.detail.contains("the 3 frames"), "{}", problem.detail);
    app.complete(&session.id, 3).await.expect(200);
}
