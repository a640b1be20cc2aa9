//! Sessions with a goal for error, size or quality: frames are coded in groups while they come.

use crate::support::{Api, Capture, HANG, OCTETS, TestApp, eventually, form, piece, within};
use cager_geometry::mesh::diagonal;
use cager_proto::container::ContainerReader;
use cager_proto::messages::{CacheUse, Session};
use http::Method;
use serde_json::{Value, json};
use std::io::Cursor;
use std::sync::OnceLock;

/// Three groups of a small model, the last one short.
fn long() -> &'static Capture {
    static LONG: OnceLock<Capture> = OnceLock::new();
    LONG.get_or_init(|| Capture::new(200, 32, 600))
}

const GROUP: u32 = 256;

async fn session(api: &Api, options: &Value) -> Session {
    let created: Session = api.create_with(form(long(), options), None).await.is(201);
    api.prepared(&created.id).await
}

/// Waits until so many frames are coded.
async fn coded(api: &Api, id: &str, frames: u32) {
    eventually("the frames are coded", async || api.session(id).await.coding.filter(|coding| coding.frames >= frames))
        .await;
}

fn numbers(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
}

/// Largest distance between frames that were posted, from `first` on, and positions that came back, as a fraction of the diagonal.
fn farthest(first: u32, positions: &[f32]) -> f64 {
    let capture = long();
    let diagonal = diagonal(&capture.rest.model.points);
    let frames = capture.frames[first as usize..].iter().flatten();
    let off = |((a, b), c): ((f64, f64), f64)| (a * a + b * b + c * c).sqrt() / diagonal;
    let gaps: Vec<f64> = frames.zip(positions).map(|(&a, &b)| f64::from(a) - f64::from(b)).collect();
    gaps.as_chunks::<3>().0.iter().map(|&[a, b, c]| off(((a, b), c))).fold(0.0, f64::max)
}

/// How far the error of a frame is from that of the frame before: root mean square over the points, as a fraction of the diagonal.
fn change_of_error(positions: &[f32], frame: u32) -> f64 {
    let width = 3 * long().points();
    let error = |frame: usize, k: usize| f64::from(positions[frame * width + k]) - f64::from(long().frames[frame][k]);
    let at = frame as usize;
    let squares: f64 = (0..width).map(|k| (error(at, k) - error(at - 1, k)).powi(2)).sum();
    (3.0 * squares / width as f64).sqrt() / diagonal(&long().rest.model.points)
}

async fn decoded(api: &Api, id: &str, query: &str) -> Vec<f32> {
    let request = api.request(Method::POST, &format!("/v1/sessions/{id}/decode?{query}"));
    numbers(&api.send(request).await.expect(200).body)
}

#[tokio::test]
async fn groups_are_coded_as_frames_come_and_the_bound_holds() {
    let app = TestApp::start();
    let bound = 1e-3;
    let created = session(&app, &json!({ "max_error": bound })).await;
    let id = &created.id;
    let coding = created.coding.expect("it is coded");
    assert_eq!((coding.group_frames, coding.frames, coding.bytes), (Some(GROUP), 0, 0));
    let path = format!("/v1/sessions/{id}/capture.cager");
    app.get(&path).await.problem(409, "not-completed");

    // Out of order: the second group is whole before the first.
    app.upload(id, GROUP, long().raw(GROUP..2 * GROUP)).await;
    app.upload(id, 0, long().raw(0..GROUP - 1)).await;
    assert_eq!(app.session(id).await.coding.expect("it is coded").frames, 0, "a frame of the first group is missing");
    assert!(app.session_file(id, "frames-0000000000").exists() && app.session_file(id, "frames-0000000256").exists());
    app.upload(id, GROUP - 1, long().raw(GROUP - 1..GROUP)).await;
    coded(&app, id, 2 * GROUP).await;
    assert!(!app.session_file(id, "frames-0000000000").exists(), "frames that are coded take no space");

    // What is coded can be had already: as a container, and as positions.
    let partial = app.get(&path).await.expect(200);
    assert_eq!(partial.header("cager-frames"), "512");
    let mut reader = ContainerReader::open(Cursor::new(partial.body.to_vec())).expect("a container");
    assert_eq!(reader.frames(), 512);
    reader.verify().expect("it is whole");
    let all = decoded(&app, id, "layer=all&first=250&count=20").await;
    assert!(farthest(250, &all) <= bound, "{}", farthest(250, &all));
    for beyond in ["layer=all&first=500&count=20", "layer=all&first=512", "layer=cages&first=4294967295&count=1"] {
        let request = app.request(Method::POST, &format!("/v1/sessions/{id}/decode?{beyond}"));
        app.send(request).await.problem(409, "frames-missing");
    }
    let unread = app.post(&format!("/v1/sessions/{id}/decode?layer=all"), OCTETS, vec![0u8; 12]).await;
    unread.problem(400, "bad-request");

    app.upload(id, 2 * GROUP, long().raw(2 * GROUP..600)).await;
    let done: Session = app.complete(id, 600).await.is(200);
    assert_eq!(done.coding.expect("it is coded").frames, 600);
    let container = app.container(id).await;
    let mut reader = ContainerReader::open(Cursor::new(container.to_vec())).expect("a container");
    let report = reader.report().expect("a report");
    assert_eq!((reader.frames(), report.coding.expect("coded").max_error), (600, Some(bound)));
    assert!(container.len() < 12 * long().points() * 600 / 10, "{} bytes", container.len());
    for (layer, fits) in [("all", true), ("cages", false)] {
        let positions = decoded(&app, id, &format!("layer={layer}")).await;
        assert_eq!(positions.len(), 3 * long().points() * 600);
        assert_eq!(farthest(0, &positions) <= bound, fits, "{layer}: {}", farthest(0, &positions));
    }
    // Where groups meet, what the cages say alone jumps by less than what is allowed for any point.
    let cages = decoded(&app, id, "layer=cages").await;
    for joint in [GROUP, 2 * GROUP] {
        let jump = change_of_error(&cages, joint);
        assert!(jump < bound, "{jump} at frame {joint}");
    }
    // Errors are those of what is decoded.
    let (errors, all) = (app.errors(id).await, decoded(&app, id, "layer=all&first=300&count=1").await);
    assert!((f64::from(errors[300].linf.expect("measured")) - farthest(300, &all)).abs() < 1e-6);
    assert!(!app.session_file(id, "frames-0000000512").exists());
}

#[tokio::test]
async fn a_follower_gets_groups_as_they_close_and_in_the_end_the_container() {
    let app = TestApp::start();
    let created = session(&app, &json!({ "quality": "standard" })).await;
    let id = &created.id;
    let mut stream = app.open(&format!("/v1/sessions/{id}/capture.cager?follow=true")).await;
    let mut bytes = Vec::new();
    let frames_of = |bytes: &[u8]| ContainerReader::open_cut(Cursor::new(bytes.to_vec())).map_or(0, |cut| cut.frames());
    for (first, end) in [(0, GROUP), (GROUP, 2 * GROUP)] {
        app.upload(id, first, long().raw(first..end)).await;
        while frames_of(&bytes) < end as usize {
            bytes.extend(piece("a group", &mut stream).await.expect("a piece").expect("more"));
        }
    }
    app.upload(id, 2 * GROUP, long().raw(2 * GROUP..600)).await;
    app.complete(id, 600).await.expect(200);
    while let Some(more) = piece("the end", &mut stream).await.expect("a piece") {
        bytes.extend(more);
    }
    assert!(bytes == app.container(id).await, "the stream is the container");

    // Sessions that are not coded can be followed in the same way, but have no container before their end.
    let plain = app.ready(Capture::tiny()).await.id;
    app.get(&format!("/v1/sessions/{plain}/capture.cager")).await.problem(409, "not-completed");
    let stream = app.request(Method::GET, &format!("/v1/sessions/{plain}/capture.cager?follow=true")).send();
    let stream = within("an answer", HANG, stream).await.expect("an answer");
    app.upload(&plain, 0, Capture::tiny().raw(0..20)).await;
    app.complete(&plain, 20).await.expect(200);
    let followed = within("the container", HANG, stream.bytes()).await.expect("a body");
    assert!(followed == app.container(&plain).await, "the stream is the container");
}

#[tokio::test]
async fn a_restart_goes_on_with_what_waits_and_gives_the_same_container() {
    let options = json!({ "mean_error": 5e-4 });
    let mut app = TestApp::start();
    let whole = session(&app, &options).await.id;
    app.upload(&whole, 0, long().raw(0..600)).await;
    app.complete(&whole, 600).await.expect(200);
    let expected = app.container(&whole).await;

    let id = session(&app, &options).await.id;
    app.upload(&id, 0, long().raw(0..GROUP + 100)).await;
    coded(&app, &id, GROUP).await;
    app.kill();
    let mut app = app.again();
    app.prepared(&id).await;
    // Nobody asks for it: what waits is coded after a restart as well.
    app.upload(&id, GROUP + 100, long().raw(GROUP + 100..2 * GROUP)).await;
    app.kill();
    let mut app = app.again();
    coded(&app, &id, 2 * GROUP).await;
    app.upload(&id, GROUP + 100, long().raw(GROUP + 100..600)).await;
    app.complete(&id, 600).await.expect(200);
    assert!(app.container(&id).await == expected, "the same frames give the same container");
    let errors = app.errors(&id).await;
    app.kill();
    let app = app.again();
    assert_eq!(app.errors(&id).await, errors, "of what is decoded, after a restart as well");
}

#[tokio::test]
async fn frames_that_are_left_out_are_no_damage_to_who_reads_meanwhile() {
    let app = TestApp::start();
    let id = session(&app, &json!({ "quality": "preview" })).await.id;
    app.upload(&id, 0, long().raw(0..2 * GROUP)).await;
    coded(&app, &id, 2 * GROUP).await;
    let path = format!("/v1/sessions/{id}/capture.cager");
    let mut follower = app.open(&format!("{path}?follow=true")).await;
    let mut followed = Vec::new();
    while ContainerReader::open_cut(Cursor::new(followed.clone())).map_or(0, |cut| cut.frames()) < 2 * GROUP as usize {
        followed.extend(piece("a group", &mut follower).await.expect("a piece").expect("more"));
    }
    let reading = {
        let (api, path) = (app.clone(), path.clone());
        tokio::spawn(async move {
            // Some of these end early, as they should.
            for _ in 0..200 {
                let response = api.request(Method::GET, &path).send().await.expect("an answer");
                let _ = response.bytes().await;
            }
        })
    };
    let shorter = json!({ "frames": GROUP, "discard_beyond": true });
    app.post_json(&format!("/v1/sessions/{id}/complete"), &shorter).await.expect(200);
    reading.await.expect("no panic");
    let reader = ContainerReader::open(Cursor::new(app.container(&id).await.to_vec())).expect("a container");
    assert_eq!(reader.frames(), GROUP as usize);
    // The follower has more than the container; its stream must not end as if that were all.
    let end = loop {
        match piece("the end", &mut follower).await {
            Ok(Some(_)) => {}
            end => break end,
        }
    };
    assert!(end.is_err(), "it ended like a whole container");
}

#[tokio::test]
async fn a_group_that_cannot_be_coded_can_be_left_out() {
    let app = TestApp::start();
    let id = session(&app, &json!({ "max_error": 1e-5 })).await.id;
    app.upload(&id, 0, long().raw(0..100)).await;
    let far = 50.0 * diagonal(&long().rest.model.points) as f32;
    let far: Vec<u8> = numbers(&long().frame(100)).iter().flat_map(|x| (x + far).to_le_bytes()).collect();
    app.upload(&id, 100, far).await;
    app.upload(&id, 101, long().raw(101..GROUP)).await;
    let problem =
        eventually("it cannot be coded", async || app.session(&id).await.coding.and_then(|c| c.problem)).await;
    assert!(problem.detail.starts_with("frames 0 to 255: max_error: an error of 1.0e-5"), "{}", problem.detail);
    app.complete(&id, GROUP).await.problem(422, "invalid-options");
    let more = app.post(&format!("/v1/sessions/{id}/frames?first=256"), OCTETS, long().raw(256..257)).await;
    more.problem(422, "invalid-options");
    let shorter = json!({ "frames": 100, "discard_beyond": true });
    app.post_json(&format!("/v1/sessions/{id}/complete"), &shorter).await.expect(200);
    assert!(farthest(0, &decoded(&app, &id, "layer=all").await) <= 1e-5);
}

#[tokio::test]
async fn damage_to_what_waits_or_is_coded_is_found() {
    for file in ["frames-0000000256", "group-0000000000"] {
        let app = TestApp::start();
        let id = session(&app, &json!({ "max_error": 1e-2 })).await.id;
        app.upload(&id, 0, long().raw(0..GROUP + 10)).await;
        coded(&app, &id, GROUP).await;
        let path = app.session_file(&id, file);
        let mut bytes = std::fs::read(&path).expect("a file");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(&path, bytes).expect("written");
        app.complete(&id, GROUP + 10).await.problem(409, "session-failed");
    }
}

#[tokio::test]
async fn cages_that_are_coded_follow_all_points_unless_told_otherwise() {
    let app = TestApp::start();
    let coded = session(&app, &json!({ "max_error": 1e-2 })).await;
    assert_eq!((coded.handles.as_str(), coded.spectrum, coded.lambda), ("all", coded.unknowns, 1e-3));
    // A weight that is given is for the usual spectrum, so this is another solver.
    let given = session(&app, &json!({ "max_error": 1e-2, "handles": "all", "lambda": 1e-3 })).await;
    assert_eq!((given.handles.as_str(), given.lambda, given.cache), ("all", 1e-3, Some(CacheUse::Miss)));
    assert!(given.spectrum < coded.spectrum, "{:?}", given.spectrum);
    app.upload(&coded.id, 0, long().raw(0..20)).await;
    app.complete(&coded.id, 20).await.expect(200);
    let bytes = app.container(&coded.id).await.to_vec();
    let report = ContainerReader::open(Cursor::new(bytes)).expect("a container").report().expect("a report");
    assert_eq!(
        (report.handles.as_str(), Some(report.spectrum), report.lambda),
        ("all", coded.spectrum.map(|s| s as usize), 1e-3)
    );
    let green = session(&app, &json!({ "max_error": 1e-2, "coordinates": "green" })).await;
    assert_eq!((green.handles.as_str(), green.spectrum, green.lambda), ("spread", given.spectrum, 1.0));
}

#[tokio::test]
async fn what_cannot_be_met_is_refused_in_one_sentence() {
    let app = TestApp::start();
    let refused = [
        (json!({ "max_error": 1e-9 }), "max_error: an error of 1.0e-9 of the diagonal is below what positions"),
        (json!({ "max_error": 0.0 }), "max_error: is 0"),
        (json!({ "max_error": 1.0 }), "max_error: is 1"),
        (json!({ "mean_error": -1 }), "mean_error: is -1"),
        (json!({ "quality": "best" }), "quality: \"best\" is not available; give one of preview, standard, master"),
        (json!({ "max_error": 0.1, "quality": "master" }), "quality: is given beside max_error"),
        (json!({ "target_size": 100_000 }), "target_size: is shared out among the frames; give their number"),
        (json!({ "target_size": 500, "frames": 600 }), "target_size: 500 bytes are too few"),
    ];
    for (options, said) in refused {
        let problem = app.refusal(form(long(), &options)).await;
        assert!(problem.detail.starts_with(said), "{options}: {}", problem.detail);
    }
    // What the meshes leave room for, and the frames need more.
    let refused = app.refusal(form(long(), &json!({ "target_size": 500, "frames": 600 }))).await.detail;
    let least = refused.split("allow at least ").nth(1).and_then(|rest| rest.split(',').next()).expect("a size");
    let least: u64 = least.parse().expect("a number");
    let id = session(&app, &json!({ "target_size": least, "frames": 600 })).await.id;
    app.upload(&id, 0, long().raw(0..600)).await;
    let problem = app.complete(&id, 600).await.problem(422, "invalid-options");
    let said = format!("{least} bytes are too few for this capture and cage: allow at least ");
    assert!(problem.detail.contains(&said), "{}", problem.detail);
    assert_eq!(app.session(&id).await.coding.and_then(|coding| coding.problem).map(|p| p.detail), Some(problem.detail));

    let id = session(&app, &json!({ "target_size": 40_000, "frames": 600 })).await.id;
    app.upload(&id, 0, long().raw(0..600)).await;
    app.complete(&id, 600).await.expect(200);
    let size = app.container(&id).await.len();
    assert!((20_000..=40_000).contains(&size), "{size} bytes");
    // Fewer frames than were announced have all of it.
    let id = session(&app, &json!({ "target_size": 40_000, "frames": 600 })).await.id;
    app.upload(&id, 0, long().raw(0..20)).await;
    app.complete(&id, 20).await.expect(200);
    let size = app.container(&id).await.len();
    assert!((5_000..=40_000).contains(&size), "{size} bytes");

    let id = session(&app, &json!({ "quality": "preview" })).await.id;
    let handles = app.handles(&id).await.len();
    let rows = app.post(&format!("/v1/sessions/{id}/frames?rows=handles"), OCTETS, vec![0u8; 12 * handles]).await;
    rows.problem(422, "invalid-frame");
    app.upload(&id, 0, long().raw(0..300)).await;
    coded(&app, &id, GROUP).await;
    // Of a group that is coded nothing can be left out.
    let path = format!("/v1/sessions/{id}/complete");
    let cut = app.post_json(&path, &json!({ "frames": 200, "discard_beyond": true })).await;
    assert!(cut.problem(409, "frame-conflict").detail.contains("frames 0 to 255 are coded together"));
    app.post_json(&path, &json!({ "frames": 256, "discard_beyond": true })).await.expect(200);
    let positions = decoded(&app, &id, "layer=all").await;
    assert_eq!(positions.len(), 3 * long().points() * 256);
    assert_eq!(positions, decoded(&app, &id, "layer=cages").await, "a preview has no residual");
}
