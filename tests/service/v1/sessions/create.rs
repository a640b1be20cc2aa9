//! `POST /v1/sessions`: what it takes and what it refuses.

use crate::support::{Capture, Raw, TestApp, chunked, file, form, text};
use cager_proto::messages::{CacheUse, Session, SessionState};
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
    let pointer = || file("lfs.ply", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n");
    let is_pointer = "lfs.ply: is a Git LFS pointer, not the file itself; run git lfs pull";
    let cases = [
        (Form::new().part("rest", pointer()).part("cage", cage()), 422, "invalid-geometry", is_pointer),
        (Form::new().part("rest", rest()).part("cage", pointer()), 422, "invalid-geometry", is_pointer),
        (Form::new().part("cage", cage()), 400, "bad-request", "rest"),
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
async fn options_that_do_not_fit_the_cage_are_refused_at_once() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let (m, n) = (capture.cage.model.points.len(), capture.points());
    let spread = |count: usize| json!({"handles": "spread", "handle_count": count});
    for (options, words) in [
        (json!({"spectrum": 5000}), vec!["spectrum: ".to_owned(), "5000".to_owned()]),
        (spread(m - 1), vec!["handle_count: ".to_owned(), format!("{m} unknowns")]),
        (spread(u32::MAX as usize), vec!["handle_count: ".to_owned(), format!("{n} points")]),
        (spread(n + 1), vec!["handle_count: ".to_owned(), format!("{n} points")]),
        (json!({"handles": "maxvol", "handle_count": m}), vec!["handle_count: ".to_owned(), "leave it out".to_owned()]),
        (json!({"handles": "most"}), vec!["handles: ".to_owned(), "maxvol, rectangular, spread, all".to_owned()]),
        (json!({"regularizer": "matrix"}), vec!["regularizer_matrix: ".to_owned(), "send it".to_owned()]),
        (json!({"spectrum": "auto"}), vec!["spectrum auto".to_owned(), "give a number".to_owned()]),
        (json!({"spectrum": "much"}), vec!["\"much\"".to_owned(), "a number of singular directions".to_owned()]),
        (json!(["walk"]), vec!["an object".to_owned()]),
        (json!({"cage": [300]}), vec!["an object".to_owned()]),
        (json!({"spectrum": -1}), vec!["-1".to_owned(), "a number of singular directions".to_owned()]),
    ] {
        let problem = app.create_with(form(capture, &options), None).await.problem(422, "invalid-options");
        for word in words {
            assert!(problem.detail.contains(&word), "{options}: {word}: {}", problem.detail);
        }
    }
    assert_eq!(app.get("/v1/sessions").await.expect(200).json::<serde_json::Value>()["sessions"], json!([]));
}

/// A matrix of one row, with as many columns.
fn matrix(columns: usize, value: &str) -> Vec<u8> {
    format!("%%MatrixMarket matrix coordinate real general\n1 {columns} 2\n1 1 {value}\n1 2 -1\n").into_bytes()
}

#[tokio::test]
async fn a_matrix_of_the_users_own_is_a_part_of_its_own() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let m = capture.cage.model.points.len();
    let options = json!({"regularizer": "matrix", "lambda": 100.0});
    let with = |bytes: Vec<u8>| form(capture, &options).part("regularizer_matrix", file("d.mtx", &bytes));
    for (bytes, word) in [
        (b"v 0 0 0\n".to_vec(), "line 1"),
        (matrix(m, "nan"), "line 3"),
        (matrix(m + 1, "1"), "columns"),
        (matrix(99_999_999_999, "1"), "larger than any"),
    ] {
        let problem = app.create_with(with(bytes), None).await.problem(422, "invalid-options");
        assert!(problem.detail.starts_with("regularizer_matrix: ") && problem.detail.contains(word), "{problem:?}");
    }
    let unwanted = form(capture, &json!({})).part("regularizer_matrix", file("d.mtx", &matrix(m, "1")));
    app.create_with(unwanted, None).await.problem(422, "invalid-options");
    let twice = with(matrix(m, "1")).part("regularizer_matrix", file("d.mtx", &matrix(m, "1")));
    app.create_with(twice, None).await.problem(400, "bad-request");

    // Another matrix is another solver; the same again is found prepared, whatever its name.
    let mut cages = Vec::new();
    for (value, name) in [("1", "d.mtx"), ("2", "d.mtx"), ("1", "differences")] {
        let named = form(capture, &options).part("regularizer_matrix", file(name, &matrix(m, value)));
        let session: Session = app.create_with(named, None).await.expect(201).json();
        let session = app.prepared(&session.id).await;
        assert_eq!(session.regularizer, "matrix");
        app.upload(&session.id, 0, capture.raw(0..2)).await;
        cages.push((app.cages(&session.id).await, session.cache));
    }
    assert!(cages[0].0 != cages[1].0 && cages[0].0 == cages[2].0);
    assert_eq!(cages[1].1, Some(CacheUse::Miss));
    assert_eq!(cages[2].1, Some(CacheUse::Hit));
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
