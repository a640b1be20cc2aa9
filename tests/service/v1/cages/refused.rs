//! What no cage can be designed from, and what is said about it.

use crate::support::{Api, Capture, OCTETS, TestApp, cage_form, cage_form_of, eventually, file, text};
use cager_proto::cage_messages::CageJobList;
use reqwest::multipart::Form;
use serde_json::{Value, json};

async fn refused(api: &Api, form: Form, word: &str, words: &[&str]) {
    let problem = api.design_with(form, None).await.problem(422, word);
    for word in words {
        assert!(problem.detail.contains(word), "{word:?} is not in: {}", problem.detail);
    }
}

async fn nothing_is_left(app: &TestApp) {
    assert_eq!(app.get("/v1/cages").await.is::<CageJobList>(200).cages, []);
    // What was being written is removed apart from the answer.
    for folder in ["cages", "tmp"] {
        let entries = || std::fs::read_dir(app.cage_file("", "..").join(folder)).expect("a folder").count();
        eventually(folder, async || (entries() == 0).then_some(())).await;
    }
}

#[tokio::test]
async fn options_that_cannot_be_met_are_named() {
    let app = TestApp::start();
    let cases: [(Value, &[&str]); 10] = [
        (json!({"vertices": 100, "mean_error": 0.001}), &["vertices", "mean_error", "not both"]),
        (json!({"vertices": 3}), &["vertices", "is 3", "from 4"]),
        (json!({"vertices": 1_000_000}), &["vertices"]),
        (json!({"mean_error": 0.0}), &["mean_error", "positive"]),
        (json!({"coordinates": "harmonic"}), &["coordinates", "mvc", "harmonic"]),
        (json!({"style": "pretty"}), &["options", "pretty"]),
        (json!({"time_limit_s": -1.0}), &["time_limit_s"]),
        (json!({"time_limit_s": 1e6}), &["time_limit_s", "120"]),
        (json!({"name": "n".repeat(201)}), &["name", "200"]),
        (json!({"vertex": 5}), &["options", "vertex"]),
    ];
    for (options, words) in cases {
        refused(&app, cage_form(Capture::tiny(), &options), "invalid-options", words).await;
    }
}

#[tokio::test]
async fn a_rest_pose_that_cannot_be_enclosed_is_named() {
    let app = TestApp::start();
    let frame = [0; 36];
    for (rest, words) in [
        ("", &["rest", "empty"][..]),
        ("# nothing\n", &["rest", "no points"]),
        ("v 1 2 3\nv 1 2 3\nv 1 2 3\n", &["rest", "one place"]),
        ("v 0 0 0\nv nan 0 0\nv 0 1 0\n", &["rest"]),
    ] {
        let form = cage_form_of(rest.as_bytes(), "frames", &frame, &json!({"frames": 1}));
        refused(&app, form, "invalid-geometry", words).await;
    }
    nothing_is_left(&app).await;
}

#[tokio::test]
async fn frames_that_do_not_match_are_named() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let raw = capture.raw(0..20);
    let form = |name: &str, frames: &[u8], options: Value| cage_form_of(&capture.rest.obj, name, frames, &options);
    refused(&app, form("f.f32", &raw, json!({})), "invalid-options", &["options.frames"]).await;
    refused(&app, form("f.f32", &raw, json!({"frames": 19})), "invalid-frame", &["19 frames", "bytes"]).await;
    refused(&app, form("f.f32", &raw[4..], json!({"frames": 20})), "invalid-frame", &["20 frames"]).await;
    refused(&app, form("f.f32", &[], json!({"frames": 20})), "invalid-frame", &["0 were sent"]).await;
    refused(&app, form("f.npy", &raw, json!({})), "invalid-frame", &["f.npy"]).await;
    let mut broken = raw.clone();
    let at = 12 * capture.points() * 7 + 12 * 5;
    broken[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let reply = app.design_with(form("f.f32", &broken, json!({"frames": 20})), None).await;
    let problem = reply.problem(422, "invalid-frame");
    assert_eq!(problem.frame, Some(7));
    assert!(problem.detail.contains("point 5"), "{}", problem.detail);
    nothing_is_left(&app).await;
}

#[tokio::test]
async fn files_that_are_another_kind_than_they_are_sent_as_are_named() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n";
    let lfs = "Git LFS pointer, not the file itself; run git lfs pull";
    for name in ["f.npy", "f.pc2", "f.mdd", "f.f32"] {
        let form = cage_form_of(&capture.rest.obj, name, pointer, &json!({}));
        refused(&app, form, "invalid-frame", &[lfs]).await;
    }
    let form = cage_form_of(pointer, "f.npy", &capture.raw(0..20), &json!({}));
    refused(&app, form, "invalid-geometry", &["rest.obj", lfs]).await;
    // Of the length of whole frames, and for all that no numbers.
    let mut archive = b"PK\x03\x04".to_vec();
    archive.resize(12 * capture.points(), 0);
    let form = cage_form_of(&capture.rest.obj, "f.f32", &archive, &json!({"frames": 1}));
    refused(&app, form, "invalid-frame", &["not raw numbers"]).await;
    nothing_is_left(&app).await;
}

#[tokio::test]
async fn parts_that_are_missing_twice_or_unknown_are_named() {
    let app = TestApp::start();
    let rest = || file("rest.obj", &Capture::tiny().rest.obj);
    let cases = [
        (Form::new().part("rest", rest()), "frames"),
        (Form::new().part("frames", file("f.npy", b"x")), "rest"),
        (Form::new().part("rest", rest()).part("rest", rest()), "twice"),
        (Form::new().part("cage", rest()), "unknown"),
        (Form::new().part("rest", file("rest", b"x")), "file name"),
        (Form::new(), "multipart"),
    ];
    for (form, word) in cases {
        let problem = app.design_with(form, None).await.problem(400, "bad-request");
        assert!(problem.detail.contains(word), "{word}: {}", problem.detail);
    }
    app.post("/v1/cages", OCTETS, "x").await.problem(415, "media-type");
    let endless = app.post("/v1/cages", "multipart/form-data; boundary=x", vec![b'a'; 8 << 20]).await;
    endless.problem(400, "bad-request");
    let options = Form::new().part("options", text(&json!("x")));
    app.design_with(options, None).await.problem(422, "invalid-options");
}

#[tokio::test]
async fn more_than_may_be_sent_or_stored_is_refused_and_leaves_nothing() {
    let app = TestApp::with(&["max_frames_bytes=20 KiB", "max_rest_bytes=100 KiB"]);
    let capture = Capture::tiny();
    let problem = app.design_with(cage_form(capture, &json!({})), None).await.problem(413, "too-large");
    assert_eq!(problem.limit, Some(20 << 10));
    nothing_is_left(&app).await;
    let app = TestApp::with(&["tenant_max_bytes=1 MiB"]);
    let (small, options) = (Capture::small(), json!({"frames": 80}));
    let form = cage_form_of(&small.rest.obj, "frames", &small.raw(0..40).repeat(2), &options);
    app.design_with(form, None).await.problem(507, "quota-exceeded");
    nothing_is_left(&app).await;
    app.design(capture, &json!({"vertices": 32, "time_limit_s": 10.0})).await;
}
