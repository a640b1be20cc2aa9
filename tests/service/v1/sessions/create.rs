//! `POST /v1/sessions`: what it takes and what it refuses.

use crate::support::{Capture, Raw, TestApp, chunked, file, form, text};
use cager_proto::messages::{Session, SessionState};
use reqwest::multipart::{Form, Part};
use serde_json::json;

#[tokio::test]
async fn a_session_has_an_address_and_says_what_it_is_made_of() {
    let app = TestApp::start();
    let capture = Capture::small();
    let options =
        json!({"name": "dancer", "regularizer": "laplacian", "spectrum": 12, "lambda": 0.5, "frame_rate": 25.0});
    let reply = app.create_with(form(capture, &options), None).await.expect(201);
    let session: Session = reply.json();
    assert_eq!(reply.header("location"), format!("/v1/sessions/{}", session.id));
    let session = app.prepared(&session.id).await;
    assert_eq!(session.name.as_deref(), Some("dancer"));
    assert_eq!(session.points, Some(capture.points() as u32));
    assert_eq!(session.cage_vertices, Some(capture.cage.model.points.len() as u32));
    assert_eq!((session.spectrum, session.lambda), (Some(12), 0.5));
    assert!(session.affine_reproduction_error.is_some_and(|error| error < 1e-9), "{session:?}");
    assert!(session.condition_number.is_some_and(|numbers| numbers.full >= 1.0 && numbers.handles >= 1.0));
    assert_eq!((session.frames.received, session.frames.solved), (0, 0));
    let same: Session = app.get(reply.header("location")).await.is(200);
    assert_eq!(same.state, SessionState::Ready);
}

#[tokio::test]
async fn parts_that_are_missing_unknown_or_twice_are_named() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let rest = || file("rest.obj", &capture.rest.obj);
    let cage = || file("cage.obj", &capture.cage.obj);
    let both = || Form::new().part("rest", rest()).part("cage", cage());
    let cases = [
        (Form::new().part("cage", cage()), 400, "bad-request", "rest"),
        (Form::new().part("rest", rest()), 422, "invalid-options", "cage"),
        (both().part("cage", cage()), 400, "bad-request", "twice"),
        (both().part("extra", Part::text("x")), 400, "bad-request", "extra"),
        (Form::new().part("rest", file("rest", b"v 0 0 0")).part("cage", cage()), 400, "bad-request", "extension"),
        (Form::new().part("rest", Part::bytes(vec![1])).part("cage", cage()), 400, "bad-request", "rest"),
        (both().part("options", text(&json!({"no_such_option": 1}))), 422, "invalid-options", "no_such_option"),
        (both().part("options", text(&json!({"regularizer": "magic"}))), 422, "invalid-options", "magic"),
        (both().part("options", text(&json!({"lambda": -1.0}))), 422, "invalid-options", "lambda"),
        (both().part("options", text(&json!({"coordinates": "psychic"}))), 422, "invalid-options", "psychic"),
        (both().part("options", text(&json!({"name": "x".repeat(201)}))), 422, "invalid-options", "name"),
        (both().part("options", Part::text("{\"lambda\":")), 422, "invalid-options", "options"),
    ];
    for (form, status, word, named) in cases {
        let problem = app.create_with(form, None).await.problem(status, word);
        assert!(problem.detail.contains(named), "{named}: {}", problem.detail);
    }
    assert_eq!(app.get("/v1/sessions").await.expect(200).json::<serde_json::Value>()["sessions"], json!([]));
}

#[tokio::test]
async fn a_spectrum_beyond_the_cage_fails_the_session_with_the_reason() {
    let app = TestApp::start();
    let problem = app.refusal(form(Capture::tiny(), &json!({"spectrum": 5000}))).await;
    assert_eq!((problem.status, problem.word()), (422, "invalid-options"));
    assert!(problem.detail.contains("spectrum"), "{}", problem.detail);
}

#[tokio::test]
async fn only_a_form_makes_a_session() {
    let app = TestApp::start();
    app.post("/v1/sessions", "application/json", "{}").await.problem(415, "media-type");
    app.post("/v1/sessions", "multipart/form-data; boundary=x", "no parts").await.problem(400, "bad-request");
    app.post("/v1/sessions", "multipart/form-data", "no boundary").await.problem(400, "bad-request");
}

/// Two parts, the rest pose of this size.
fn body(size: usize) -> Vec<u8> {
    let part = |name: &str, file: &str, bytes: &[u8]| {
        let head = format!("--x\r\ncontent-disposition: form-data; name=\"{name}\"; filename=\"{file}\"\r\n\r\n");
        [head.as_bytes(), bytes, b"\r\n"].concat()
    };
    let cage = part("cage", "cage.obj", &Capture::tiny().cage.obj);
    [part("rest", "rest.obj", &vec![b'#'; size]), cage, b"--x--\r\n".to_vec()].concat()
}

#[tokio::test]
async fn what_is_too_large_is_refused_however_its_length_is_told() {
    let app = TestApp::with(&["max_rest_bytes=65536"]);
    let media_type = "multipart/form-data; boundary=x";
    for size in [100 << 10, 3 << 20] {
        let body = body(size);
        // With its length, told before the body is there: nobody has to send it all to be refused.
        let mut raw = Raw::connect(&app).await;
        let length = body.len().to_string();
        raw.head("POST", "/v1/sessions", &[("content-type", media_type), ("content-length", &length)]).await;
        if size < 1 << 20 {
            raw.write(&body).await;
        }
        let problem = raw.reply().await.problem(413, "too-large");
        assert_eq!(problem.limit, Some(65536));
        // In chunks, without a length. Raw, since clients seldom hear an answer while they still send.
        let mut raw = Raw::connect(&app).await;
        raw.head("POST", "/v1/sessions", &[("content-type", media_type), ("transfer-encoding", "chunked")]).await;
        for piece in body.chunks(32 << 10) {
            if !raw.try_write(&chunked(piece)).await {
                break;
            }
        }
        raw.reply().await.problem(413, "too-large");
    }
    assert_eq!(app.metric("cager_memory_bytes{use=\"uploads\"}").await, 0.0, "nothing is kept of it");
    // What is small enough still goes.
    app.create(Capture::tiny()).await;
}
