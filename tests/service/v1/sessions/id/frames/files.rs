//! Files and far-away frames where numbers are expected: refused before anything of them is kept.

use crate::support::{Capture, OCTETS, RECORDS, TestApp, cage_form_of, file};
use cager_proto::messages::Session;
use cager_proto::record::{self, Kind};
use serde_json::json;
use std::path::{Path, PathBuf};

fn case(name: &str) -> Vec<u8> {
    let folder: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases/05-http-npy-posted-as-frames");
    std::fs::read(folder.join(name)).expect(name)
}

async fn session(app: &TestApp) -> Session {
    let parts = reqwest::multipart::Form::new();
    let parts =
        parts.part("rest", file("rest.obj", &case("rest.obj"))).part("cage", file("cage.obj", &case("cage.obj")));
    let session: Session = app.create_with(parts, None).await.is(201);
    app.prepared(&session.id).await
}

#[tokio::test]
async fn a_npy_file_posted_as_frames_is_refused_and_its_values_are_taken_afterwards() {
    let app = TestApp::start();
    let session = session(&app).await;
    let path = format!("/v1/sessions/{}/frames?first=0", session.id);
    let problem = app.post(&path, OCTETS, case("frames.npy")).await.problem(422, "invalid-frame");
    assert!(problem.detail.contains(".npy") && problem.detail.contains("send the values alone"), "{}", problem.detail);
    assert!(app.errors(&session.id).await.is_empty(), "nothing of it is kept");
    let values = case("frames.npy")[128..].to_vec();
    let count = values.len() / (12 * session.points.expect("ready") as usize);
    assert_eq!(app.upload(&session.id, 0, values).await.len(), count);
}

#[tokio::test]
async fn other_files_are_refused_by_name_in_bodies_of_frames_and_of_cages() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let long = |start: &[u8]| [start, &capture.frame(0), &capture.frame(1)].concat();
    let lfs = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a21\nsize 12345\n".to_vec();
    for (what, body) in [
        (".pc2", long(b"POINTCACHE2\0\x01\0\0\0\xdc\x05\0\0\0\0\0\0\0\0\x80\x3f\x28\0\0\0")),
        (".obj", capture.rest.obj.clone()),
        (".obj", b"# exported\no walk\nv 0.25 1.5 -0.125\nv 0.5 0.25 0.75\nv 1 2 3\n".to_vec()),
        (".npz", long(b"PK\x03\x04\x14\0\0\0\x08\0")),
        (".ply", long(b"ply\nformat binary_little_endian 1.0\nelement vertex 1500\nproperty float x\n")),
        (".glb", long(b"glTF\x02\0\0\0\x10\0\0\0")),
        (".cager", long(&capture.encoded(1)[..32])),
        ("git lfs pull", lfs),
        ("web page", b"<!DOCTYPE html>\n<html><head><title>404 Not Found</title></head><body></body></html>".to_vec()),
        (RECORDS, capture.records([0])),
    ] {
        for path in ["frames?first=0", "frames?first=0&rows=handles", "decode"] {
            let path = format!("/v1/sessions/{}/{path}", session.id);
            let problem = app.post(&path, OCTETS, body.clone()).await.problem(422, "invalid-frame");
            assert!(problem.detail.contains(what), "{path}, {what}: {}", problem.detail);
        }
        let form = cage_form_of(&capture.rest.obj, "frames", &body, &json!({"frames": 2}));
        let problem = app.design_with(form, None).await.problem(422, "invalid-frame");
        assert!(problem.detail.contains(what), "a design, {what}: {}", problem.detail);
    }
    assert!(app.errors(&session.id).await.is_empty(), "nothing is kept");
}

/// A frame of coordinates that are ASCII as bytes, at most a few diagonals away from the rest pose.
fn like_text(capture: &Capture) -> Vec<f32> {
    // 0.68…, 0.50… and 0.78…
    [f32::from_le_bytes(*b"v 0?"), f32::from_le_bytes(*b".5 ?"), f32::from_le_bytes(*b"1\nv?")].repeat(capture.points())
}

#[tokio::test]
async fn numbers_that_look_like_a_file_can_be_posted_as_frame_records() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/frames", session.id);
    let frame = like_text(capture);
    let raw: Vec<u8> = frame.iter().flat_map(|x| x.to_le_bytes()).collect();
    let problem = app.post(&path, OCTETS, raw).await.problem(422, "invalid-frame");
    assert!(problem.detail.contains("frame records"), "{}", problem.detail);
    let mut record = Vec::new();
    record::encode(Kind::Positions, 0, f32::NAN, f32::NAN, &frame, &mut record).expect("a record");
    app.post(&path, RECORDS, record).await.expect(200);
    assert_eq!(app.errors(&session.id).await.len(), 1);
}

#[tokio::test]
async fn a_first_frame_hundreds_of_diagonals_away_is_refused_with_its_number_and_distance() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let diagonal = cager_geometry::mesh::diagonal(&capture.rest.model.points) as f32;
    let path = format!("/v1/sessions/{}/frames", session.id);
    let moved = |frame: u32, by: f32| -> Vec<f32> { capture.frames[frame as usize].iter().map(|x| x + by).collect() };
    let raw = |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|x| x.to_le_bytes()).collect() };
    let record = |frame: u32, values: &[f32], kind: Kind| {
        let mut out = Vec::new();
        record::encode(kind, frame, f32::NAN, f32::NAN, values, &mut out).expect("a record");
        out
    };
    let handles = session.handle_count.expect("ready") as usize;
    let scaled: Vec<f32> = capture.frames[5].iter().map(|x| x * 1000.0).collect();
    let swapped = capture.frames[5].iter().map(|x| f32::from_le_bytes(x.to_be_bytes()));
    let swapped: Vec<f32> = swapped.map(|x| if x.is_finite() { x } else { 1e30 }).collect();
    for (what, query, media_type, body) in [
        ("raw", "?first=5", OCTETS, raw(&moved(5, 300.0 * diagonal))),
        ("a record", "", RECORDS, record(5, &moved(5, 300.0 * diagonal), Kind::Positions)),
        ("handle rows", "", RECORDS, record(5, &moved(5, 300.0 * diagonal)[..3 * handles], Kind::HandleRows)),
        ("millimetres", "?first=5", OCTETS, raw(&scaled)),
        ("another order of bytes", "?first=5", OCTETS, raw(&swapped)),
    ] {
        let problem = app.post(&format!("{path}{query}"), media_type, body).await.problem(422, "invalid-frame");
        assert_eq!(problem.frame, Some(5), "{what}");
        let detail = problem.detail;
        assert!(detail.starts_with("frame 5: ") && detail.contains("diagonals of the rest pose"), "{what}: {detail}");
    }
    // A body whose later frame is off: those before it stay, it does not.
    let body = [capture.frame(0), capture.frame(1), raw(&moved(2, 1e6 * diagonal))].concat();
    let reply = app.post(&format!("{path}?first=0"), OCTETS, body).await;
    assert!(reply.text().lines().last().expect("a line").contains("frame 2: point"), "{}", reply.text());
    assert!(app.errors(&session.id).await.iter().all(|result| result.frame < 2));
    assert_eq!(app.upload(&session.id, 2, capture.raw(2..3)).await.len(), 1, "the right frame can still come");
    // Captures travel, and fragments fly away; what is no position is refused in any frame.
    app.upload(&session.id, 5, raw(&moved(5, 150.0 * diagonal))).await;
    let mut stray = capture.frames[6].clone();
    stray[7] += 400.0 * diagonal;
    app.upload(&session.id, 6, raw(&stray)).await;
    stray[7] = 1e30;
    let problem = app.post(&format!("{path}?first=7"), OCTETS, raw(&stray)).await.problem(422, "invalid-frame");
    assert!(problem.detail.starts_with("frame 7: point 2 lies "), "{}", problem.detail);
    // A first frame with one stray point.
    let other = app.ready(capture).await;
    let mut stray = capture.frames[0].clone();
    stray[7] += 400.0 * diagonal;
    app.upload(&other.id, 0, raw(&stray)).await;
}

#[tokio::test]
async fn a_design_is_refused_frames_hundreds_of_diagonals_away() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let far: Vec<u8> = capture.frames[1].iter().flat_map(|x| (x * 1000.0).to_le_bytes()).collect();
    let frames = [far, capture.frame(0)].concat();
    let form = cage_form_of(&capture.rest.obj, "frames.f32", &frames, &json!({"frames": 2}));
    let problem = app.design_with(form, None).await.problem(422, "invalid-frame");
    assert!(problem.frame == Some(0) && problem.detail.contains("diagonals"), "{}", problem.detail);
}
