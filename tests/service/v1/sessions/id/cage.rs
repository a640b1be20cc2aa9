//! `GET …/cage`, and what it is for: coordinates whose normals follow from the cage's vertices.

use crate::support::{Capture, OCTETS, TestApp, cages_of, form};
use cager_client::LocalDecoder;
use cager_proto::messages::{RestCage, Session};
use serde_json::json;

async fn ready(app: &TestApp, system: &str) -> Session {
    let session: Session =
        app.create_with(form(Capture::small(), &json!({ "coordinates": system })), None).await.is(201);
    app.prepared(&session.id).await
}

#[tokio::test]
async fn the_rest_cage_is_the_same_in_numbers_and_in_json() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let path = format!("/v1/sessions/{}/cage", session.id);
    let reply = app.get_with(&path, &[("accept", "application/json")]).await.expect(200);
    let cage: RestCage = reply.json();
    let close = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-12);
    let expected = &capture.cage.model;
    assert!(cage.vertices.iter().zip(&expected.points).all(|(a, b)| close(a, b)));
    assert_eq!(cage.faces, expected.faces.triangulated());
    let reply = app.get(&path).await.expect(200);
    assert_eq!(reply.header("cager-vertices"), cage.vertices.len().to_string());
    assert_eq!(reply.header("vary"), "accept");
    assert_eq!(reply.header("cager-faces"), cage.faces.len().to_string());
    assert_eq!(reply.body.len(), 24 * cage.vertices.len() + 12 * cage.faces.len());
    let by_client = app.client().cage(&session.id).await.expect("a cage");
    assert!(by_client.vertices.iter().zip(&cage.vertices).all(|(a, b)| close(a, b)));
    assert_eq!(by_client.faces, cage.faces);
    app.get_with(&path, &[("accept", "text/html")]).await.problem(406, "not-acceptable");
}

#[tokio::test]
async fn captures_of_all_systems_are_those_of_the_command_line_before_and_after_a_restart() {
    let capture = Capture::small();
    for system in ["harmonic", "green", "green-free"] {
        let mut app = TestApp::start();
        let session = ready(&app, system).await;
        assert_eq!(session.coordinates, system);
        app.upload(&session.id, 0, capture.raw(0..7)).await;
        // The next frames are solved with the solver as it lies on the disk.
        app.kill();
        let app = app.again();
        let handles = app.handles(&session.id).await;
        let path = format!("/v1/sessions/{}/frames?first=7&rows=handles", session.id);
        app.post(&path, OCTETS, capture.handle_rows(7..9, &handles)).await.expect(200);
        app.upload(&session.id, 9, capture.raw(9..20)).await;
        let cages = app.cages(&session.id).await;
        let alone = TestApp::start();
        let other = ready(&alone, system).await;
        alone.upload(&other.id, 0, capture.raw(0..20)).await;
        assert!(alone.cages(&other.id).await == cages, "{system}: other cages after a restart");
        alone.complete(&other.id, 20).await.expect(200);
        let expected = capture.encoded_with(20, &["--coordinates", system]);
        assert!(alone.container(&other.id).await == expected, "{system}: other bytes than by the command line");
    }
}

#[tokio::test]
async fn green_cages_are_decoded_alike_by_service_and_client() {
    let app = TestApp::start();
    let capture = Capture::small();
    for (system, tied) in [("green", true), ("green-free", false)] {
        let session = ready(&app, system).await;
        app.upload(&session.id, 0, capture.raw(0..10)).await;
        let (unknowns, n) = (session.unknowns.expect("known"), capture.points());
        let (v, f) = (session.cage_vertices.expect("known"), session.cage_faces.expect("known"));
        let reply = app.get(&format!("/v1/sessions/{}/coordinates", session.id)).await.expect(200);
        assert_eq!(reply.header("cager-columns"), (v + f).to_string());
        assert_eq!(reply.body.len() as u64, 4 * u64::from(v + f) * n as u64);
        assert_eq!(unknowns, if tied { v } else { v + f });
        let mut cages = cages_of(&app.cages(&session.id).await, unknowns);
        for cage in &mut cages {
            cage[4] += 0.125;
        }
        let body: Vec<u8> = cages.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let reply = app.post(&format!("/v1/sessions/{}/decode", session.id), OCTETS, body).await.expect(200);
        let positions = cages_of(&reply.body, n as u32);
        let local = LocalDecoder::fetch(&app.client(), &session.id).await.expect("a decoder");
        assert_eq!(local.unknowns(), unknowns as usize);
        let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        assert!(local.decode(&views).expect("positions") == positions, "{system}: other positions");
    }
}
