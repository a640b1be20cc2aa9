//! What is no transfer.

use super::{create, created, motion};
use crate::support::{Capture, TestApp, file, text};
use cager_proto::transfer_messages::TransferList;
use reqwest::multipart::Form;
use serde_json::json;

#[tokio::test]
async fn files_and_options_that_cannot_be_used_are_refused_at_once() {
    let app = TestApp::start();
    let motion = motion();
    let cloud = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let target = || Form::new().part("target", file("copy.obj", &motion.target));
    let framed = || target().part("source_frames", file("frames.npy", &motion.frames));
    let whole = || framed().part("source_rest", file("rest.obj", &motion.capture.rest.obj));
    let other = Capture::tiny();
    for (form, status, word, said) in [
        (target(), 400, "bad-request", "the source is missing"),
        (framed(), 400, "bad-request", "source_rest is missing"),
        (whole().part("source", file("a.cager", b"x")), 400, "bad-request", "exclude each other"),
        (whole().part("target", file("b.obj", &motion.target)), 400, "bad-request", "twice"),
        (whole().part("rest", file("b.obj", &motion.target)), 400, "bad-request", "\"rest\" is unknown"),
        (target().part("source", file("a.cager", b"nothing")), 422, "invalid-geometry", "source: a.cager"),
        (framed().part("source_rest", file("other.obj", &other.rest.obj)), 422, "invalid-frame", "frames"),
        (whole().part("cage", file("cage.obj", cloud)), 422, "invalid-geometry", "cage.obj: has no faces"),
        (whole().part("pairs", file("p.txt", b"1 1\n2\n")), 422, "invalid-geometry", "pairs: p.txt: line 2: a pair is"),
        (whole().part("pairs", file("p.txt", b"1 99999")), 422, "invalid-geometry", "no vertex 99999 in the target"),
        (whole().part("pairs", file("p.txt", b"\xff")), 422, "invalid-geometry", "p.txt: is no text"),
        (
            whole().part("pairs", file("p.txt", b"1 1")).part("options", text(&json!({"method": "public"}))),
            422,
            "invalid-options",
            "pairs: belong to the method fitted",
        ),
        (
            Form::new()
                .part("source_rest", file("rest.obj", &motion.capture.rest.obj))
                .part("source_frames", file("frames.npy", &motion.frames))
                .part("target", file("cloud.obj", cloud))
                .part("options", text(&json!({"method": "rigid", "detail": true}))),
            422,
            "invalid-geometry",
            "target: cloud.obj: the target has no faces",
        ),
        (
            target()
                .part("source_rest", file("cloud.obj", cloud))
                .part("source_frames", file("frames", &[0; 36]))
                .part("options", text(&json!({"frames": 1}))),
            422,
            "invalid-geometry",
            "cloud.obj: the source has no faces",
        ),
    ] {
        let problem = create(&app, form, None).await.problem(status, word);
        assert!(problem.detail.contains(said), "{}", problem.detail);
    }
    for (options, said) in [
        (json!({"method": "magic"}), "magic"),
        (json!({"public": "ico"}), "public"),
        (json!({"detail": true}), "detail"),
        (json!({"rigidity": 1.0}), "rigidity"),
        (json!({"method": "rigid", "rigidity": -1.0}), "rigidity"),
        (json!({"method": "rigid", "coordinates": "green"}), "green"),
        (json!({"method": "public", "coordinates": "blue"}), "blue"),
        (json!({"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]}), "mirroring"),
        (json!({"align": "none", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}), "one of them"),
        (json!({"up": "w"}), "unknown variant"),
        (json!({"max_error": 2.0}), "max_error"),
        (json!({"cage_vertices": 3}), "cage_vertices"),
        (json!({"source_session": "x"}), "no session \"x\""),
    ] {
        let problem = create(&app, motion.form(&options), None).await.problem(422, "invalid-options");
        assert!(problem.detail.contains(said), "{}", problem.detail);
    }
    app.post("/v1/transfers", "text/plain", "").await.problem(415, "media-type");
    let session = app.ready(other).await;
    let named = target().part("options", text(&json!({"source_session": session.id})));
    create(&app, named, None).await.problem(409, "not-completed");
    let list: TransferList = app.get("/v1/transfers").await.is(200);
    assert!(list.transfers.is_empty(), "{list:?}");
    // None of them kept what it had reserved.
    created(&app, &json!({})).await;
}
