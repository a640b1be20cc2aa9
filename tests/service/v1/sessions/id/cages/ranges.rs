//! Parts and versions of what never changes: cages, coordinates and the container.

use crate::support::{Capture, RECORDS, Reply, TestApp};
use cager_proto::messages::Session;
use http::Method;

/// Everything that is immutable, with the accepted type.
fn immutable(session: &Session) -> Vec<(String, &'static str)> {
    let at = |what: &str| format!("/v1/sessions/{}/{what}", session.id);
    vec![
        (at("cages?first=0"), "*/*"),
        (at("cages?first=2&count=5"), "*/*"),
        (at("cages?first=0"), RECORDS),
        (at("coordinates"), "*/*"),
        (at("capture.cager"), "*/*"),
    ]
}

#[tokio::test]
async fn any_part_can_be_asked_for() {
    let app = TestApp::start();
    let session = app.completed(Capture::small(), 30).await;
    for (path, accept) in immutable(&session) {
        let ask = async |range: &str| app.get_with(&path, &[("accept", accept), ("range", range)]).await;
        let whole = app.get_with(&path, &[("accept", accept)]).await.expect(200);
        let length = whole.body.len();
        assert_eq!(whole.header("accept-ranges"), "bytes");
        assert!(whole.header("cache-control").contains("immutable"), "{path}");
        for (range, part) in [
            ("bytes=0-0", 0..1),
            ("bytes=5-1003", 5..1004),
            ("bytes=100-", 100..length),
            ("bytes=-77", length - 77..length),
            ("bytes=10-999999999", 10..length),
            ("bytes=-999999999", 0..length),
        ] {
            let reply = ask(range).await.expect(206);
            let expected = format!("bytes {}-{}/{length}", part.start, part.end - 1);
            assert_eq!(reply.header("content-range"), expected, "{path}");
            assert!(reply.body == whole.body[part], "{path} {range}");
            assert_eq!(reply.header("etag"), whole.header("etag"));
        }
        // What is not understood, or asks for several parts, gets everything.
        for range in ["bytes=0-1,5-6", "lines=0-1", "bytes=9-3", "bytes=x"] {
            assert!(ask(range).await.expect(200).body == whole.body, "{path} {range}");
        }
        for range in [format!("bytes={length}-"), "bytes=-0".to_owned()] {
            let refused = ask(&range).await;
            assert_eq!(refused.problem(416, "range").limit, Some(length as u64));
            assert_eq!(refused.header("content-range"), format!("bytes */{length}"), "{path} {range}");
        }
        let head = app.send(app.request(Method::HEAD, &path).header("accept", accept)).await.expect(200);
        assert_eq!(head.header("content-length"), length.to_string());
        assert_eq!(head.header("etag"), whole.header("etag"));
    }
}

#[tokio::test]
async fn a_version_that_is_known_is_not_sent_again() {
    let app = TestApp::start();
    let session = app.completed(Capture::small(), 30).await;
    let mut tags = Vec::new();
    for (path, accept) in immutable(&session) {
        let ask =
            async |headers: &[(&str, &str)]| app.get_with(&path, &[&[("accept", accept)], headers].concat()).await;
        let whole = ask(&[]).await.expect(200);
        let tag = whole.header("etag");
        assert!(tag.len() > 2 && tag.starts_with('"') && tag.ends_with('"'), "{tag}");
        let known = |reply: Reply| {
            assert!(reply.body.is_empty() && reply.header("etag") == tag, "{reply:?}");
        };
        known(ask(&[("if-none-match", tag)]).await.expect(304));
        known(ask(&[("if-none-match", &format!("\"other\", W/{tag}"))]).await.expect(304));
        known(ask(&[("if-none-match", "*")]).await.expect(304));
        known(ask(&[("if-none-match", tag), ("range", "bytes=0-9")]).await.expect(304));
        assert!(ask(&[("if-none-match", "\"other\"")]).await.expect(200).body == whole.body);
        let part = ask(&[("if-range", tag), ("range", "bytes=4-9")]).await.expect(206);
        assert!(part.body == whole.body[4..10]);
        let changed = ask(&[("if-range", "\"other\""), ("range", "bytes=4-9")]).await.expect(200);
        assert!(changed.body == whole.body, "what changed is sent whole");
        tags.push(tag.to_owned());
    }
    tags.sort();
    tags.dedup();
    assert_eq!(tags.len(), 5, "different bytes have different tags");
}

#[tokio::test]
async fn versions_last_through_a_restart() {
    let mut app = TestApp::start();
    let session = app.completed(Capture::small(), 10).await;
    let mut before = Vec::new();
    for (path, accept) in immutable(&session) {
        before.push(app.get_with(&path, &[("accept", accept)]).await.expect(200));
    }
    app.kill();
    let app = app.again();
    for ((path, accept), before) in immutable(&session).into_iter().zip(before) {
        app.get_with(&path, &[("accept", accept), ("if-none-match", before.header("etag"))]).await.expect(304);
        assert!(app.get_with(&path, &[("accept", accept)]).await.expect(200).body == before.body, "{path}");
    }
}
