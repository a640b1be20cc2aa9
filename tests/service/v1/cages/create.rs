//! `POST /v1/cages`: a cage is designed from a motion, and sessions use it.

use crate::support::{Capture, TestApp, cage_form, cage_form_of, file, text};
use cager_formats::{FrameOptions, MeshFormat, create_frames, read_model_bytes};
use cager_geometry::mesh::Polygons;
use cager_proto::cage_messages::{CageJob, CageState};
use cager_proto::messages::Session;
use reqwest::multipart::Form;
use serde_json::json;
use std::path::Path;

#[tokio::test]
async fn a_cage_is_designed_and_encodes_the_capture_it_was_designed_from() {
    let app = TestApp::start();
    let capture = Capture::small();
    let form = cage_form(capture, &json!({"name": "walk", "vertices": 60, "time_limit_s": 3.0}));
    let reply = app.design_with(form, None).await.expect(202);
    let job: CageJob = reply.json();
    assert_eq!(reply.header("location"), format!("/v1/cages/{}", job.id));
    assert_eq!((job.name.as_deref(), job.points, job.frames), (Some("walk"), capture.points() as u32, 40));
    let done = app.designed(&job.id).await;
    assert_eq!(done.state, CageState::Completed, "{:?}", done.problem);
    assert_eq!((done.fraction, done.sampled_frames), (1.0, 40));
    assert!(done.seconds > 0.0 && done.stage.is_none());
    let obj = app.get(&format!("/v1/cages/{}/cage.obj", job.id)).await.expect(200).body;
    let cage = read_model_bytes(MeshFormat::Obj, Path::new("cage.obj"), &obj).expect("a cage");
    assert_eq!(Some(cage.points.len() as u32), done.vertices);

    let parts = Form::new().part("rest", file("rest.obj", &capture.rest.obj));
    let parts = parts.part("options", text(&json!({"cage": {"id": job.id}})));
    let session: Session = app.create_with(parts, None).await.is(201);
    // The session has a cage of its own from here on.
    app.delete(&format!("/v1/cages/{}", job.id)).await.expect(204);
    app.get(&format!("/v1/cages/{}", job.id)).await.problem(404, "not-found");
    let session = app.prepared(&session.id).await;
    assert_eq!(session.cage_vertices, done.vertices);
    app.upload(&session.id, 0, capture.raw(0..40)).await;
    app.complete(&session.id, 40).await.expect(200);
    assert!(app.container(&session.id).await.len() > 1000);
}

#[tokio::test]
async fn frames_may_be_a_numpy_array() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("f.npy");
    let mut writer =
        create_frames(&path, capture.points(), 20, &Polygons::new(), &FrameOptions::default()).expect("frames");
    for frame in &capture.frames {
        writer.write_frame(frame).expect("a frame");
    }
    writer.finish().expect("frames");
    let frames = std::fs::read(path).expect("frames");
    let options = json!({"vertices": 32, "time_limit_s": 2.0});
    let job: CageJob = app.design_with(cage_form_of(&capture.rest.obj, "f.npy", &frames, &options), None).await.is(202);
    assert_eq!(job.frames, 20);
    assert_eq!(app.designed(&job.id).await.state, CageState::Completed);
}

#[tokio::test]
async fn the_same_again_is_answered_from_the_completed_design() {
    let app = TestApp::start();
    let options = json!({"vertices": 32, "time_limit_s": 2.0});
    let first = app.design(Capture::tiny(), &options).await;
    let first = app.designed(&first.id).await;
    let second = app.design(Capture::tiny(), &options).await;
    assert_ne!(second.id, first.id);
    assert_eq!((second.state, second.vertices, second.error), (CageState::Completed, first.vertices, first.error));
    let obj = async |id: &str| app.get(&format!("/v1/cages/{id}/cage.obj")).await.expect(200).body;
    let cage = obj(&first.id).await;
    // Each is its own: deleting one leaves the other.
    app.delete(&format!("/v1/cages/{}", first.id)).await.expect(204);
    assert_eq!(obj(&second.id).await, cage);
    assert_eq!(app.metric("cager_designs_total{result=\"completed\"}").await, 1.0);
    assert_eq!(app.metric("cager_designs_total{result=\"known\"}").await, 1.0);
}

#[tokio::test]
async fn a_completed_design_keeps_its_cage_and_not_its_input() {
    let app = TestApp::start();
    let job = app.design(Capture::tiny(), &json!({"vertices": 32, "time_limit_s": 2.0})).await;
    app.designed(&job.id).await;
    assert!(app.cage_file(&job.id, "cage.obj").exists());
    assert!(!app.cage_file(&job.id, "frames").exists() && !app.cage_file(&job.id, "rest").exists());
    let stored = app.metric("cager_stored_bytes{tenant=\"local\"}").await;
    assert!(stored > 0.0 && stored < 20_000.0, "{stored}");
}

#[tokio::test]
async fn frames_in_numbers_beyond_memory_go_to_the_disk() {
    let app = TestApp::with(&["max_design_bytes=1 MiB"]);
    let capture = Capture::small();
    let frames = capture.raw(0..40).repeat(100);
    let options = json!({"vertices": 32, "time_limit_s": 0.5, "frames": 4000});
    #[cfg(target_os = "linux")]
    let before = app.resident_mib();
    let form = cage_form_of(&capture.rest.obj, "frames", &frames, &options);
    let job: CageJob = app.design_with(form, None).await.is(202);
    #[cfg(target_os = "linux")]
    assert!(app.resident_mib() < before + 30, "{} MiB after {before}", app.resident_mib());
    let done = app.designed(&job.id).await;
    // As many as a megabyte holds.
    assert_eq!((done.frames, done.sampled_frames), (4000, (1 << 20) / (24 * capture.points() as u32)));
}
