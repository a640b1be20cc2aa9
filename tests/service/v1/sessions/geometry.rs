//! Rest poses and cages that cannot be used: what is said about them.

use crate::support::{Capture, Mesh, TestApp, file, form, form_of, text};
use cager_geometry::mesh::{Model, Polygons};
use cager_proto::messages::{Problem, Session};
use reqwest::multipart::Form;
use serde_json::json;

fn faces(all: impl IntoIterator<Item = Vec<u32>>) -> Polygons {
    let mut faces = Polygons::new();
    all.into_iter().for_each(|face| faces.push(&face));
    faces
}

/// The small capture's cage with other faces.
fn cage_with(change: impl Fn(Vec<Vec<u32>>) -> Vec<Vec<u32>>) -> Mesh {
    let model = &Capture::small().cage.model;
    let all = model.faces.iter().map(<[u32]>::to_vec).collect();
    Mesh::new(Model { points: model.points.clone(), faces: faces(change(all)), ..Model::default() })
}

fn inward() -> Mesh {
    cage_with(|all| all.into_iter().map(|face| face.into_iter().rev().collect()).collect())
}

#[track_caller]
fn says(problem: &Problem, words: &[&str]) {
    assert_eq!((problem.status, problem.word()), (422, "invalid-geometry"), "{}", problem.detail);
    for word in words {
        assert!(problem.detail.contains(word), "{word:?} is not in: {}", problem.detail);
    }
}

#[tokio::test]
async fn a_file_that_cannot_be_read_is_named_with_its_line() {
    let app = TestApp::start();
    let capture = Capture::small();
    let cage = || file("cage.obj", &capture.cage.obj);
    let bad = Form::new().part("rest", file("rest.obj", b"v 0 0 0\nv 1 x 0\n")).part("cage", cage());
    says(&app.refusal(bad).await, &["rest", "line 2"]);
    let bad = Form::new().part("rest", file("rest.xyz", b"1 2 3")).part("cage", cage());
    says(&app.refusal(bad).await, &["rest.xyz"]);
    let bad = Form::new().part("rest", file("rest.stl", b"solid nothing")).part("cage", cage());
    says(&app.refusal(bad).await, &["rest"]);
    let bad = Form::new().part("rest", file("rest.obj", b"v 0 0 nan\n")).part("cage", cage());
    says(&app.refusal(bad).await, &["rest"]);
}

#[tokio::test]
async fn a_rest_pose_that_single_precision_would_lose_is_refused_with_what_to_subtract() {
    let app = TestApp::start();
    let capture = Capture::small();
    let moved = |mesh: &Mesh, by: [f64; 3]| {
        let points = mesh.model.points.iter().map(|p| [0, 1, 2].map(|k| p[k] + by[k])).collect();
        Mesh::new(Model { points, ..mesh.model.clone() })
    };
    let at = |by| form_of(&moved(&capture.rest, by), &moved(&capture.cage, by), &json!({}));
    let problem = app.refusal(at([450_000.0, 5_400_000.0, 300.0])).await;
    says(&problem, &["single precision", "subtract 450000 5400000 301 from rest pose, cage and frames"]);
    // Where a warning was enough it still is.
    let _: Session = app.create_with(at([450.0, 0.0, 0.0]), None).await.is(201);
}

#[tokio::test]
async fn a_cage_that_is_open_is_refused_with_the_edge() {
    let app = TestApp::start();
    let capture = Capture::small();
    let open = cage_with(|mut all| {
        all.pop();
        all
    });
    let problem = app.refusal(form_of(&capture.rest, &open, &json!({}))).await;
    says(&problem, &["cage.obj", "edge"]);
    let points = Mesh::new(Model { points: capture.cage.model.points.clone(), ..Model::default() });
    says(&app.refusal(form_of(&capture.rest, &points, &json!({}))).await, &["cage.obj", "faces"]);
}

#[tokio::test]
async fn an_inward_cage_is_refused_and_flip_cage_turns_it() {
    let app = TestApp::start();
    let capture = Capture::small();
    says(&app.refusal(form_of(&capture.rest, &inward(), &json!({}))).await, &["cage.obj", "inward"]);
    let form = form_of(&capture.rest, &inward(), &json!({"flip_cage": true}));
    let session: Session = app.create_with(form, None).await.is(201);
    app.prepared(&session.id).await;
    let flipped = app.upload(&session.id, 0, capture.raw(0..3)).await;
    let usual = app.ready(capture).await;
    let usual = app.upload(&usual.id, 0, capture.raw(0..3)).await;
    for (a, b) in flipped.iter().zip(&usual) {
        // Its triangles begin at other corners, so that the last bits may differ.
        let (a, b) = (a.l2.expect("measured"), b.l2.expect("measured"));
        assert!((a - b).abs() < 1e-3 * b, "{a} and {b}");
    }
}

#[tokio::test]
async fn options_that_do_not_go_with_the_cage_are_refused_at_once() {
    let app = TestApp::start();
    let capture = Capture::small();
    let unknowns = capture.cage.model.points.len();
    let problem = app.refusal(form(capture, &json!({"spectrum": unknowns + 1}))).await;
    assert_eq!(problem.word(), "invalid-options");
    assert!(problem.detail.contains(&format!("{unknowns} unknowns")), "{}", problem.detail);
    let few = Mesh::new(Model { points: capture.rest.model.points[..3].to_vec(), ..Model::default() });
    says(&app.refusal(form_of(&few, &capture.cage, &json!({}))).await, &["3 points", "fewer"]);
    assert!(app.get("/v1/sessions").await.json::<cager_proto::messages::SessionList>().sessions.is_empty());
}

#[tokio::test]
async fn points_outside_a_cage_for_harmonic_coordinates_are_refused_at_once() {
    let app = TestApp::start();
    let capture = Capture::small();
    let mut model = capture.rest.model.clone();
    let far = capture.cage.model.points.iter().fold(0.0, |far: f64, v| far.max(v[0]));
    for k in [4, 40] {
        model.points[k][0] = far + 1.0;
    }
    let rest = Mesh::new(model);
    let problem = app.refusal(form_of(&rest, &capture.cage, &json!({"coordinates": "harmonic"}))).await;
    says(&problem, &["2 points lie outside the cage (4, 40)", "enlarge the cage or use mean value coordinates"]);
    assert!(app.get("/v1/sessions").await.json::<cager_proto::messages::SessionList>().sessions.is_empty());
    let form = form_of(&rest, &capture.cage, &json!({"coordinates": "mvc"}));
    let session: Session = app.create_with(form, None).await.is(201);
    app.prepared(&session.id).await;
}

#[tokio::test]
async fn a_session_whose_frames_are_damaged_says_so_wherever_it_is_used() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..4)).await;
    app.damage_frames(&session.id);
    let at = |what: &str| format!("/v1/sessions/{}/{what}", session.id);
    // Complete reads everything, and meets the damage.
    let met = app.complete(&session.id, 4).await;
    assert!(met.problem(409, "session-failed").detail.contains("damaged"));
    let post = app.post(&at("frames?first=4"), crate::support::OCTETS, capture.frame(4)).await;
    assert!(post.problem(409, "session-failed").detail.contains("damaged"));
    for what in ["handles", "coordinates", "cages?first=0", "cages?first=0&follow=true"] {
        app.get(&at(what)).await.problem(409, "session-failed");
    }
    app.complete(&session.id, 4).await.problem(409, "session-failed");
    app.post(&at("decode"), crate::support::OCTETS, vec![0; 12]).await.problem(409, "session-failed");
    let events = app.get(&at("events")).await.expect(200).text();
    assert!(events.contains("\"failed\""), "{events}");
    app.delete(&format!("/v1/sessions/{}", session.id)).await.expect(204);
    let other = app.completed(capture, 3).await;
    app.container(&other.id).await;
}

#[tokio::test]
async fn polygons_of_the_cage_and_points_without_faces_are_fine() {
    let app = TestApp::start();
    let capture = Capture::small();
    let cloud = Mesh::new(Model { points: capture.rest.model.points.clone(), ..Model::default() });
    let form = form_of(&cloud, &capture.cage, &json!({}));
    let session: Session = app.create_with(form, None).await.is(201);
    app.prepared(&session.id).await;
    let cloud = app.upload(&session.id, 0, capture.raw(0..2)).await;
    let model = app.ready(capture).await;
    assert_eq!(app.upload(&model.id, 0, capture.raw(0..2)).await, cloud, "faces of the model change no number");
}

#[tokio::test]
async fn options_may_be_left_out() {
    let app = TestApp::start();
    let capture = Capture::tiny();
    let parts = || {
        Form::new()
            .part("rest", file("a path/rest.OBJ", &capture.rest.obj))
            .part("cage", file("c.obj", &capture.cage.obj))
    };
    for form in [parts(), parts().part("options", text(&json!({}))), form(capture, &json!({"handles": "maxvol"}))] {
        let session: Session = app.create_with(form, None).await.is(201);
        app.prepared(&session.id).await;
    }
}
