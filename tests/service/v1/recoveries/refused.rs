//! What is no recovery, and what is no frame of one.

use super::{create, created, post, recovery, scans};
use crate::support::{TestApp, file, text};
use cager_proto::recovery_messages::RecoveryList;
use reqwest::multipart::Form;
use serde_json::json;
use std::process::{Command, Stdio};

#[tokio::test]
async fn templates_rigs_and_options_that_cannot_be_used_are_refused_at_once() {
    let app = TestApp::start();
    let template = &scans().template;
    let with = |part: &'static str, name: &str, bytes: &[u8]| {
        Form::new().part("template", file("rest.obj", template)).part(part, file(name, bytes))
    };
    for (form, status, word, said) in [
        (Form::new().part("options", text(&json!({}))), 400, "bad-request", "template is missing"),
        (with("frames", "a.ply", b"x"), 400, "bad-request", "\"frames\" is unknown"),
        (with("template", "a.obj", template), 400, "bad-request", "twice"),
        (Form::new().part("template", file("rest", template)), 400, "bad-request", "file name"),
        (Form::new().part("template", file("rest.obj", b"v 0 0 0\n")), 422, "invalid-geometry", "no faces"),
        (with("cage", "cage.obj", b"v 0 0 0\n"), 422, "invalid-geometry", "cage.obj: has no faces"),
        (with("rig", "rig.json", b"{}"), 422, "invalid-geometry", "manifold"),
        (
            with("rig", "rig.json", b"{}").part("manifold", file("m.json", b"{}")),
            422,
            "invalid-geometry",
            "rig: rig.json",
        ),
    ] {
        let problem = create(&app, form, None).await.problem(status, word);
        assert!(problem.detail.contains(said), "{}", problem.detail);
    }
    for (options, said) in [
        (json!({"up": "x"}), "up"),
        (json!({"points": 3}), "points"),
        (json!({"method": "robust"}), "method"),
        (json!({"max_error": 2.0}), "max_error"),
        (json!({"max_error": 0.1, "quality": "preview"}), "give one of them"),
        (json!({"frames": 0}), "frames"),
        (json!({"frames": 100_001}), "at most 100000"),
        (json!({"pints": 3}), "pints"),
        (json!({"align": "maybe"}), "maybe"),
    ] {
        let problem = create(&app, scans().form(&options), None).await.problem(422, "invalid-options");
        assert!(problem.detail.contains(said), "{}", problem.detail);
    }
    app.post("/v1/recoveries", "text/plain", "").await.problem(415, "media-type");
}

#[tokio::test]
async fn frames_without_a_surface_are_refused_by_number_and_name_and_those_before_are_kept() {
    let app = TestApp::start();
    let job = created(&app, &json!({"points": 800, "frames": 3})).await;
    let good = &scans().frames[0];
    let text = String::from_utf8(good.1.clone()).expect("text");
    let (head, points) = text.split_once("end_header\n").expect("a header");
    let flat: String = points.lines().map(|_| "1 2 3 0 1 0\n").collect();
    let without: String =
        points.lines().map(|line| line.split(' ').take(3).collect::<Vec<_>>().join(" ") + " 0 0 0\n").collect();
    let first = points.split(' ').next().expect("a number");
    for (name, bytes, said) in [
        ("b.ply", Vec::new(), "is empty"),
        ("b.ply", b"nothing".to_vec(), "b.ply"),
        ("b.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec(), "3 points"),
        ("b.ply", text.replacen(first, "nan", 1).into_bytes(), "NaN"),
        ("b.ply", format!("{head}end_header\n{flat}").into_bytes(), "one line only"),
        ("b.ply", format!("{head}end_header\n{without}").into_bytes(), "no normal at vertex"),
        ("b.mp4", good.1.clone(), "not a mesh format"),
        ("b", good.1.clone(), "file name"),
    ] {
        let form = Form::new().part("frame", file(&good.0, &good.1)).part("frame", file(name, &bytes));
        let problem = post(&app, &job.id, 0, form).await.problem(422, "invalid-frame");
        assert_eq!(problem.frame, Some(1), "{}", problem.detail);
        assert!(problem.detail.starts_with("frame 1: ") && problem.detail.contains(said), "{}", problem.detail);
        assert!(name == "b" || problem.detail.contains(name), "{}", problem.detail);
        assert_eq!(recovery(&app, &job.id).await.frames.received, 1);
    }
    let beyond = post(&app, &job.id, 100_000, scans().parts(3..4)).await.problem(422, "invalid-frame");
    assert!(beyond.detail.contains("at most 100000 frames"), "{}", beyond.detail);
    let beyond = post(&app, &job.id, 3, scans().parts(3..4)).await.problem(422, "invalid-frame");
    assert!(beyond.detail.contains("beyond the 3 frames"), "{}", beyond.detail);
    post(&app, &job.id, 0, Form::new()).await.problem(400, "bad-request");
    let other = Form::new().part("mesh", file("a.ply", &good.1));
    post(&app, &job.id, 0, other).await.problem(400, "bad-request");
}

#[tokio::test]
async fn the_command_line_leaves_nothing_on_a_service_that_refuses_a_frame() {
    let app = TestApp::start();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).expect("a file");
    write("rest.obj", &scans().template);
    write("scan_1.ply", &scans().frames[0].1);
    write("scan_2.ply", b"nothing");
    write("scan_3.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    for (pattern, said) in [("scan_*.ply", "scan_2.ply"), ("scan_3.obj", "--force")] {
        let done = Command::new(env!("CARGO_BIN_EXE_cager"))
            .args(["recover", "--template", "rest.obj", "--points", "800", "-o", "out.cager", "--frames", pattern])
            .args(["--server", &format!("http://{}", app.address)])
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .expect("the program runs");
        let told = String::from_utf8_lossy(&done.stderr);
        assert!(!done.status.success() && told.contains(said), "{told}");
        let list: RecoveryList = app.get("/v1/recoveries").await.is(200);
        assert!(list.recoveries.is_empty(), "{list:?}");
    }
}
