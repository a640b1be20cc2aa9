//! From a template and frames to an animation.

use super::{FRAMES, complete, completed, container, create, created, post, recovery, scans, until};
use crate::support::{TestApp, USD_UNITS, file, text, units_of, usd};
use cager_formats::{MeshFormat, read_model_bytes};
use cager_proto::recovery_messages::{
    FollowedFrame, PostedFrames, Recovery, RecoveryList, RecoveryProgress, RecoveryState,
};
use reqwest::multipart::Form;
use serde_json::{Value, json};
use std::path::Path;

/// The data of all events in a whole stream.
fn progress(text: &str) -> Vec<RecoveryProgress> {
    let data = text.lines().filter_map(|line| line.strip_prefix("data: "));
    data.map(|data| serde_json::from_str(data).expect("a progress")).collect()
}

#[tokio::test]
async fn what_is_recovered_is_byte_for_byte_what_the_command_line_recovers() {
    let app = TestApp::start();
    let scans = scans();
    let job = created(&app, &json!({"name": "dance", "points": 800, "frame_rate": 25.0})).await;
    assert_eq!((job.state, job.frames.received, job.joints), (RecoveryState::Ready, 0, false));
    let events = {
        let path = format!("/v1/recoveries/{}/events", job.id);
        let api = app.stranger();
        tokio::spawn(async move { api.get(&path).await.expect(200).text() })
    };
    let following = {
        let path = format!("/v1/recoveries/{}/cages?follow=true", job.id);
        let api = app.stranger();
        tokio::spawn(async move { api.get(&path).await.expect(200).body })
    };
    // Out of order, with a gap that is filled later.
    let posted: PostedFrames = post(&app, &job.id, 1, scans.parts(1..3)).await.is(200);
    assert_eq!(posted.frames.iter().map(|frame| frame.frame).collect::<Vec<_>>(), [1, 2]);
    assert_eq!((posted.frames[0].file.as_str(), posted.received), ("scan_6.ply", 2));
    assert_eq!(recovery(&app, &job.id).await.frames.missing, [[0, 1]]);
    complete(&app, &job.id, FRAMES).await.problem(409, "frames-missing");
    post(&app, &job.id, 0, scans.parts(0..1)).await.expect(200);
    let found = until(&app, &job.id, |recovery| recovery.frames.followed == 3).await;
    assert_eq!(found.state, RecoveryState::Ready);
    app.get(&format!("/v1/recoveries/{}/capture.cager", job.id)).await.problem(409, "not-completed");
    app.get(&format!("/v1/recoveries/{}/cages?first=2&count=2", job.id)).await.problem(409, "frames-missing");
    let live = app.get(&format!("/v1/recoveries/{}/cages?first=1", job.id)).await.expect(200).body;
    assert_eq!(live.len() as u32, 2 * 12 * found.cage_vertices.expect("a cage"));
    // The same again is known; other bytes are refused, and change nothing.
    post(&app, &job.id, 0, scans.parts(0..3)).await.expect(200);
    let refused = post(&app, &job.id, 2, scans.parts(0..1)).await.problem(409, "frame-conflict");
    assert_eq!(refused.frame, Some(2));
    post(&app, &job.id, 3, scans.parts(3..4)).await.expect(200);
    complete(&app, &job.id, 2).await.problem(409, "frame-conflict");
    complete(&app, &job.id, FRAMES).await.expect(202);
    let done = completed(&app, &job.id).await;
    assert_eq!((done.frames.followed, done.frames.refined, done.frames.missing.len()), (FRAMES, FRAMES, 0));

    let made = container(&app, &job.id).await;
    assert_eq!(done.container_bytes, Some(made.len() as u64));
    assert!(made == scans.recovered("--points 800 --fps 25"), "another file than that of the command line");
    let report: Value = app.get(&format!("/v1/recoveries/{}/report", job.id)).await.is(200);
    assert_eq!(report["frames"].as_array().map(Vec::len), Some(FRAMES as usize));
    assert_eq!((&report["frames"][0]["file"], &report["frames"][0]["number"]), (&json!("scan_5.ply"), &json!(5.0)));
    // As browsers ask for it.
    let packed = app.get_with(&format!("/v1/recoveries/{}/report", job.id), &[("accept-encoding", "gzip")]).await;
    assert_eq!(packed.expect(200).header("content-encoding"), "gzip");
    app.get(&format!("/v1/recoveries/{}/joints.bvh", job.id)).await.problem(404, "not-found");
    let stride = 12 * done.cage_vertices.expect("a cage") as usize;
    let cages = app.get(&format!("/v1/recoveries/{}/cages", job.id)).await.expect(200).body;
    assert_eq!(cages.len(), FRAMES as usize * stride);
    let path = format!("/v1/recoveries/{}/cages?first=1", job.id);
    let part = app.get_with(&path, &[("range", "bytes=12-35")]).await.expect(206);
    assert!(part.body == cages[stride + 12..stride + 36] && !part.header("etag").is_empty());
    let followed = following.await.expect("a stream");
    assert_eq!(followed.len(), FRAMES as usize * stride);
    assert!(followed[stride..3 * stride] == live, "other cages than those of the first pass");
    let told = progress(&events.await.expect("a stream"));
    let frames: Vec<&FollowedFrame> = told.iter().flat_map(|progress| &progress.frames).collect();
    assert_eq!(frames.len(), FRAMES as usize, "{told:?}");
    assert!(frames.iter().enumerate().all(|(k, frame)| frame.frame == k as u32), "{frames:?}");
    assert!(frames.iter().all(|frame| frame.score.is_some_and(|score| score < 0.1)), "{frames:?}");
    assert_eq!(told.last().map(|progress| progress.state), Some(RecoveryState::Completed));

    // It is over, and keeps what it made and nothing else.
    complete(&app, &job.id, FRAMES).await.expect(202);
    complete(&app, &job.id, 3).await.problem(409, "recovery-completed");
    post(&app, &job.id, 0, scans.parts(0..1)).await.problem(409, "recovery-completed");
    let folder = app.data().join("recoveries").join(&job.id);
    let names = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("a file").file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    assert_eq!(names, ["cages", "capture.cager", "report.json"]);
    assert_eq!(app.metric("cager_recoveries_total{result=\"completed\"}").await, 1.0);
    assert_eq!(app.metric("cager_recovering").await, 0.0);
}

#[tokio::test]
async fn offsets_and_a_guaranteed_error_are_those_of_the_command_line() {
    let app = TestApp::start();
    let job = created(&app, &json!({"points": 800, "offsets": true, "max_error": 1e-3, "start": 7.0})).await;
    post(&app, &job.id, 0, scans().parts(0..FRAMES)).await.expect(200);
    complete(&app, &job.id, FRAMES).await.expect(202);
    completed(&app, &job.id).await;
    let expected = scans().recovered("--points 800 --offsets --max-error 1e-3 --start 7");
    assert!(container(&app, &job.id).await == expected, "another file than that of the command line");
}

#[tokio::test]
async fn a_template_keeps_its_unit_and_the_axis_that_points_up() {
    let app = TestApp::start();
    let model = read_model_bytes(MeshFormat::Obj, Path::new("rest.obj"), &scans().template).expect("a model");
    let template = usd(&model);
    let form =
        Form::new().part("template", file("rest.usda", &template)).part("options", text(&json!({"points": 800})));
    let job: Recovery = create(&app, form, None).await.is(202);
    post(&app, &job.id, 0, scans().parts(0..FRAMES)).await.expect(200);
    complete(&app, &job.id, FRAMES).await.expect(202);
    completed(&app, &job.id).await;
    let made = container(&app, &job.id).await;
    assert_eq!(units_of(&made), USD_UNITS);
    let expected = scans().recovered_from(("rest.usda", &template), "--points 800");
    assert!(made == expected, "another file than that of the command line");
}

#[tokio::test]
async fn the_command_line_has_a_service_recover_the_same_file_and_leaves_it_there() {
    let app = TestApp::start();
    let made = scans().recovered(&format!("--points 800 --fps 25 --server http://{}", app.address));
    assert!(made == scans().recovered("--points 800 --fps 25"), "another file than without a service");
    let list: RecoveryList = app.get("/v1/recoveries").await.is(200);
    assert_eq!(list.recoveries.len(), 1, "{list:?}");
    let kept = &list.recoveries[0];
    assert_eq!((kept.state, kept.name.as_deref()), (RecoveryState::Completed, Some("out")));
    assert!(container(&app, &kept.id).await == made);
}
