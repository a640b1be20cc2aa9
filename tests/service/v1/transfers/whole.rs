//! From a motion and another model to an animation of that.

use super::{CAGE_VERTICES, FRAMES, PAIRS, completed, create, created, ended, motion, transfer};
use crate::support::{TestApp, USD_UNITS, file, text, units_of};
use cager_client::{MeshFile, NewTransfer, TransferSource};
use cager_proto::messages::JobState;
use cager_proto::transfer_messages::{SourceAlignment, Transfer, TransferList, TransferProgress};
use futures_util::StreamExt as _;
use reqwest::multipart::Form;
use serde_json::{Value, json};

#[tokio::test]
async fn what_is_moved_is_byte_for_byte_what_the_command_line_moves() {
    let app = TestApp::start();
    let job = created(&app, &json!({"name": "walk", "align": "none"})).await;
    assert_eq!((job.frames, job.points), (FRAMES, motion().target_points));
    let path = format!("/v1/transfers/{}", job.id);
    let stream = |rest: &str| {
        let (api, path) = (app.stranger(), format!("{path}/{rest}"));
        tokio::spawn(async move { api.get(&path).await.expect(200).body })
    };
    let (events, followed) = (stream("events"), stream("frames?follow=true"));
    let made = completed(&app, &job.id).await;
    assert!(made == motion().moved("--align none"), "another file than that of the command line");
    let done = transfer(&app, &job.id).await;
    assert_eq!((done.moved, done.container_bytes), (FRAMES, Some(made.len() as u64)));
    assert!(done.cage_vertices.is_some_and(|vertices| vertices > 3) && done.stage.is_none(), "{done:?}");
    let report: Value = app.get(&format!("{path}/report")).await.is(200);
    assert_eq!((&report["method"], &report["frames"]), (&json!("fitted"), &json!(FRAMES)));

    let stride = 12 * motion().target_points as usize;
    let positions = app.get(&format!("{path}/frames")).await.expect(200).body;
    assert_eq!(positions.len(), FRAMES as usize * stride);
    let some = app.get(&format!("{path}/frames?first=1&count=2")).await.expect(200).body;
    assert!(some == positions[stride..3 * stride], "other positions than those of all frames");
    app.get(&format!("{path}/frames?first=4&count=2")).await.problem(409, "frames-missing");
    // As they were moved: what is encoded is a little beside.
    let followed = followed.await.expect("a stream");
    assert_eq!(followed.len(), positions.len());
    let numbers = |bytes: &[u8]| -> Vec<f32> { bytes.as_chunks().0.iter().map(|&x| f32::from_le_bytes(x)).collect() };
    let off = numbers(&followed).iter().zip(numbers(&positions)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let size = cager_geometry::mesh::diagonal(&motion().capture.rest.model.points) as f32;
    assert!(off < 0.05 * size, "{off} of {size}");
    let events = String::from_utf8(events.await.expect("a stream").to_vec()).expect("text");
    let last = events.lines().filter_map(|line| line.strip_prefix("data: ")).next_back().expect("an event");
    let last: TransferProgress = serde_json::from_str(last).expect("a progress");
    assert_eq!((last.state, last.moved), (JobState::Completed, FRAMES));

    // It keeps what it made and nothing else.
    let folder = app.data().join("transfers").join(&job.id);
    let names = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("a file").file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.sort();
    assert_eq!(names, ["capture.cager", "report.json"]);
    assert_eq!(app.metric("cager_transfers_total{result=\"completed\"}").await, 1.0);
    assert_eq!(app.metric("cager_transferring").await, 0.0);
}

#[tokio::test]
async fn a_container_and_a_completed_session_are_sources_as_well() {
    let app = TestApp::start();
    let session = app.completed(&motion().capture, FRAMES).await;
    let container = app.get(&format!("/v1/sessions/{}/capture.cager", session.id)).await.expect(200).body;
    let expected = motion().moved_from("--source in.cager", &container, "--align none");
    let target = || Form::new().part("target", file("copy.obj", &motion().target));
    let named = target()
        .part("options", text(&json!({"align": "none", "source_session": session.id, "cage_vertices": CAGE_VERTICES})));
    let job: Transfer = create(&app, named, None).await.is(202);
    assert!(completed(&app, &job.id).await == expected, "another file than that of the command line");
    // By the client library.
    let (client, named) = (app.client(), |name: &str, bytes: &[u8]| MeshFile::new(name, bytes.to_vec()));
    let mut new =
        NewTransfer::new(TransferSource::Container(named("in.cager", &container)), named("copy.obj", &motion().target));
    new.options.align = Some(SourceAlignment::None);
    new.options.cage_vertices = Some(CAGE_VERTICES);
    let job = client.create_transfer(&new).await.expect("a transfer");
    let told: Vec<_> = client.transfer_events(&job.id).collect().await;
    let last = told.into_iter().next_back().expect("an event").expect("a progress");
    assert_eq!(last.state, JobState::Completed);
    let mut made = Vec::new();
    client.download_transferred(&job.id, "capture.cager", &mut made).await.expect("a container");
    assert!(made == expected, "another file than that of the command line");
    assert_eq!(client.transfer(&job.id).await.expect("a transfer").container_bytes, Some(made.len() as u64));
    client.delete_transfer(&job.id).await.expect("it is gone");
}

#[tokio::test]
async fn methods_cages_and_errors_are_those_of_the_command_line() {
    let app = TestApp::start();
    let options = json!({"align": "none", "method": "public", "public": "ico", "detail": true, "max_error": 1e-3, "cage_vertices": 20});
    let job = created(&app, &options).await;
    let expected =
        motion().moved("--align none --method public --public ico --detail --max-error 1e-3 --cage-vertices 20");
    assert!(completed(&app, &job.id).await == expected, "another file than that of the command line");
    let report: Value = app.get(&format!("/v1/transfers/{}/report", job.id)).await.is(200);
    assert_eq!(report["detail"], true);
}

#[tokio::test]
async fn a_target_keeps_its_unit_and_the_axis_that_points_up() {
    let app = TestApp::start();
    let form = Form::new()
        .part("options", text(&json!({"align": "none", "cage_vertices": CAGE_VERTICES})))
        .part("source_rest", file("rest.obj", &motion().capture.rest.obj))
        .part("source_frames", file("frames.npy", &motion().frames))
        .part("target", file("copy.usda", &motion().usd_target));
    let job: Transfer = create(&app, form, None).await.is(202);
    let made = completed(&app, &job.id).await;
    assert_eq!(units_of(&made), USD_UNITS);
    assert!(made == motion().moved("--align none --target copy.usda"), "another file than that of the command line");
}

#[tokio::test]
async fn pairs_pull_as_those_of_the_command_line_do() {
    let app = TestApp::start();
    let form = motion().form(&json!({"align": "none"})).part("pairs", file("pairs.txt", PAIRS.as_bytes()));
    let job: Transfer = create(&app, form, Some("pairs")).await.is(202);
    let found = completed(&app, &job.id).await;
    assert!(found == motion().moved("--align none --pairs pairs.txt"), "another file than that of the command line");
    assert!(found != motion().moved("--align none"), "the pairs pull at nothing");
    // Without them it is another request.
    let without = create(&app, motion().form(&json!({"align": "none"})), Some("pairs")).await;
    without.problem(422, "idempotency-key-reused");
}

#[tokio::test]
async fn the_command_line_has_a_service_move_the_same_and_leaves_it_there() {
    let app = TestApp::start();
    let session = app.completed(&motion().capture, FRAMES).await;
    let container = app.get(&format!("/v1/sessions/{}/capture.cager", session.id)).await.expect(200).body;
    let files = "--source-rest rest.obj --source-frames frames.npy";
    for (source, more) in [
        (files, "--align none --fps 12.5 --start 101 --pairs pairs.txt"),
        (files, "--align 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1 --method rigid --rigidity 0.02 --detail --quality standard"),
        ("--source in.cager", "--align none --pose relative --up y --cage-vertices 20"),
    ] {
        let moved = |service: &str| motion().moved_from(source, &container, &format!("{more}{service}"));
        let there = moved(&format!(" --server http://{}", app.address));
        assert!(there == moved(""), "{source} {more}: another file than without a service");
    }
    let list: TransferList = app.get("/v1/transfers").await.is(200);
    assert_eq!(list.transfers.len(), 3, "{list:?}");
    assert!(list.transfers.iter().all(|transfer| transfer.state == JobState::Completed), "{list:?}");
}

#[tokio::test]
async fn what_cannot_be_moved_fails_with_the_sentence_of_the_command_line() {
    let app = TestApp::start();
    // Far too small, as it stands.
    let options = json!({"matrix": [1e-3, 0, 0, 50, 0, 1e-3, 0, 0, 0, 0, 1e-3, 0, 0, 0, 0, 1]});
    let job = created(&app, &options).await;
    let failed = ended(&app, &job.id).await;
    let problem = failed.problem.expect("a problem");
    assert_eq!((failed.state, problem.status), (JobState::Failed, 422));
    assert!(problem.detail.contains("cannot be laid onto the target"), "{}", problem.detail);
    let path = format!("/v1/transfers/{}", job.id);
    for result in ["capture.cager", "frames"] {
        app.get(&format!("{path}/{result}")).await.problem(409, "transfer-failed");
    }
}
