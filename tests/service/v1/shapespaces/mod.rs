//! `/v1/shapespaces`: shapes between poses of one model.

use crate::support::{Api, Capture, Mesh, Reply, TestApp, file, text};
use cager_geometry::mesh::{Model, Polygons, diagonal};
use cager_proto::shape_messages::{ShapeSpace, ShapeSpaceList, ShapeSpaceOptions};
use reqwest::multipart::Form;
use serde_json::{Value, json};
use std::time::Duration;

const ANNA: &str = "anna-has-a-long-secret";
const BERT: &str = "bert-has-a-long-secret";

fn capture() -> &'static Capture {
    Capture::tiny()
}

/// A frame of the capture as a mesh.
fn pose(frame: u32) -> Vec<u8> {
    let points = capture().frames[frame as usize].as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect();
    Mesh::new(Model { points, ..capture().rest.model.clone() }).obj
}

/// A frame of the capture with its faces in another order.
fn other_faces() -> Vec<u8> {
    let model = &capture().rest.model;
    let mut faces = Polygons::new();
    model.faces.iter().collect::<Vec<_>>().into_iter().rev().for_each(|face| faces.push(face));
    Mesh::new(Model { faces, ..model.clone() }).obj
}

/// The cage of the capture, far away from it.
fn far_cage() -> Vec<u8> {
    let mut model = capture().cage.model.clone();
    model.points.iter_mut().for_each(|point| point[0] += 1e9);
    Mesh::new(model).obj
}

fn poses(options: &Value) -> Form {
    let form = Form::new().part("options", text(options));
    form.part("pose", file("a.obj", &pose(0))).part("pose", file("b.obj", &pose(10)))
}

async fn create(api: &Api, form: Form) -> Reply {
    api.send(api.request(http::Method::POST, "/v1/shapespaces").multipart(form)).await
}

async fn create_keyed(api: &Api, form: Form, key: &str) -> Reply {
    let request = api.request(http::Method::POST, "/v1/shapespaces").header("idempotency-key", key);
    api.send(request.multipart(form)).await
}

async fn shape(api: &Api, id: &str, query: &str) -> Vec<f32> {
    let bytes = api.get(&format!("/v1/shapespaces/{id}/pose?{query}")).await.expect(200).body;
    bytes.as_chunks().0.iter().map(|&x| f32::from_le_bytes(x)).collect()
}

/// How far two shapes are apart at the most, as a share of the diagonal.
fn apart(a: &[f32], b: &[f32]) -> f64 {
    let most = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
    assert_eq!(a.len(), b.len());
    most / diagonal(&capture().rest.model.points)
}

#[tokio::test]
async fn poses_and_what_lies_between_them_are_found_on_the_mesh_and_on_a_cage() {
    let app = TestApp::start();
    let [first, last] = [0, 10].map(|frame| &capture().frames[frame]);
    for (on, exact) in [("mesh", 1e-5), ("cage", 0.05)] {
        let reply = create(&app, poses(&json!({"name": on, "on": on}))).await.expect(201);
        let made: ShapeSpace = reply.json();
        assert_eq!(reply.header("location"), format!("/v1/shapespaces/{}", made.id));
        assert_eq!(
            (made.poses, made.points, made.cage_vertices.is_some()),
            (2, capture().points() as u32, on == "cage")
        );
        assert!(apart(&shape(&app, &made.id, "weights=1,0").await, first) < exact, "{on}");
        assert!(apart(&shape(&app, &made.id, "weights=0,1").await, last) < exact, "{on}");
        let middle = shape(&app, &made.id, "weights=0.5,0.5").await;
        assert!(apart(&middle, first) > 1e-3 && apart(&middle, last) > 1e-3, "{on}");
        for (weights, said) in [
            ("0.5,0.4", "sum to 0.9"),
            ("1", "there is 1 weight for 2 poses"),
            ("1,x", "no list"),
            ("NaN,1", "the weight of pose 0 is NaN or infinite"),
        ] {
            let problem = app.get(&format!("/v1/shapespaces/{}/pose?weights={weights}", made.id)).await;
            let problem = problem.problem(422, "invalid-options");
            assert!(problem.detail.contains(said), "{}", problem.detail);
        }
        match made.cage_vertices {
            Some(vertices) => {
                let cage = shape(&app, &made.id, "weights=0.5,0.5&of=cage").await;
                assert_eq!(cage.len(), 3 * vertices as usize);
            }
            None => {
                let path = format!("/v1/shapespaces/{}/pose?weights=0.5,0.5&of=cage", made.id);
                app.get(&path).await.problem(422, "invalid-options");
            }
        }
    }
    let list: ShapeSpaceList = app.get("/v1/shapespaces").await.is(200);
    assert_eq!(
        list.shapespaces.iter().map(|made| made.name.as_deref()).collect::<Vec<_>>(),
        [Some("cage"), Some("mesh")]
    );
    assert!(app.metric("cager_memory_bytes{use=\"shapespaces\"}").await > 0.0);
    for made in list.shapespaces {
        app.delete(&format!("/v1/shapespaces/{}", made.id)).await.expect(204);
        app.get(&format!("/v1/shapespaces/{}", made.id)).await.problem(404, "not-found");
    }
    assert_eq!(app.metric("cager_shapespaces").await, 0.0);
}

#[tokio::test]
async fn frames_of_a_session_and_of_a_container_are_poses() {
    let app = TestApp::start();
    let session = app.completed(capture(), 11).await;
    let container = app.get(&format!("/v1/sessions/{}/capture.cager", session.id)).await.expect(200).body;
    let of_session = Form::new().part("options", text(&json!({"source_session": session.id, "frames": [0, 10]})));
    let sent =
        Form::new().part("options", text(&json!({"frames": [0, 10]}))).part("source", file("in.cager", &container));
    let mut shapes = Vec::new();
    for form in [of_session, sent] {
        let made: ShapeSpace = create(&app, form).await.is(201);
        assert_eq!(made.cage_vertices, Some(session.cage_vertices.expect("a cage")));
        shapes.push(shape(&app, &made.id, "weights=0.25,0.75").await);
    }
    assert_eq!(shapes[0], shapes[1]);
    // By the client library.
    let options =
        ShapeSpaceOptions { source_session: Some(session.id), frames: vec![0, 10], ..ShapeSpaceOptions::default() };
    let client = app.client();
    let made = client.create_shape_space(&[], None, &options).await.expect("a shape space");
    assert_eq!(client.pose(&made.id, &[0.25, 0.75]).await.expect("a shape"), shapes[0]);
    client.delete_shape_space(&made.id).await.expect("it is gone");
}

#[tokio::test]
async fn poses_that_do_not_go_together_are_refused() {
    let app = TestApp::start();
    let one = || Form::new().part("pose", file("a.obj", &pose(0)));
    let other = &Capture::small().rest.obj;
    let session = app.ready(capture()).await;
    let many: Vec<u32> = (0..65).collect();
    let container = || Form::new().part("source", file("a.cager", b"nothing"));
    let with_cage = |on: &str, cage: &[u8]| poses(&json!({"on": on})).part("cage", file("c.obj", cage));
    for (form, status, word, said) in [
        (Form::new().part("options", text(&json!({}))), 400, "bad-request", "poses"),
        (one(), 422, "invalid-geometry", "there is only one pose"),
        (one().part("pose", file("b.obj", other)), 422, "invalid-geometry", "b.obj: pose 1 has"),
        (one().part("pose", file("b.obj", &other_faces())), 422, "invalid-geometry", "b.obj: face 0 has the vertices"),
        (one().part("pose", file("b.obj", b"nothing")), 422, "invalid-geometry", "b.obj"),
        (one().part("source", file("a.cager", b"nothing")), 400, "bad-request", "source"),
        (container(), 422, "invalid-geometry", "source"),
        (with_cage("mesh", &capture().cage.obj), 422, "invalid-options", "cage: belongs to on: cage"),
        (with_cage("cage", &far_cage()), 422, "invalid-geometry", "cage: point"),
        (poses(&json!({"frames": [0, 1]})), 422, "invalid-options", "frames: belong to"),
        (
            container().part("options", text(&json!({"frames": [0, 3, 0]}))),
            422,
            "invalid-options",
            "frames: 0 is there twice",
        ),
        (container().part("options", text(&json!({"frames": many}))), 422, "invalid-options", "of at most 64"),
        (poses(&json!({"on": "moon"})), 422, "invalid-options", "moon"),
        (Form::new().part("options", text(&json!({"source_session": "x"}))), 422, "invalid-options", "no session"),
        (Form::new().part("options", text(&json!({"source_session": session.id}))), 409, "not-completed", "completed"),
    ] {
        let problem = create(&app, form).await.problem(status, word);
        assert!(problem.detail.contains(said), "{}", problem.detail);
    }
}

#[tokio::test]
async fn what_one_tenant_cannot_have_is_refused_before_it_is_made() {
    let app = TestApp::with(&["shape_bytes=1 MiB"]);
    let two: ShapeSpace = create(&app, poses(&json!({"on": "cage"}))).await.is(201);
    assert_eq!(two.poses, 2);
    let form = Form::new().part("options", text(&json!({"on": "mesh"})));
    let form = (0..10).fold(form, |form, frame| form.part("pose", file("a.obj", &pose(frame))));
    let problem = create(&app, form).await.problem(422, "invalid-geometry");
    assert!(problem.detail.contains("shape_bytes") && problem.limit == Some(1 << 20), "{}", problem.detail);
}

#[tokio::test]
async fn the_same_request_again_gives_the_same_shape_space() {
    let app = TestApp::start();
    let options = json!({"on": "mesh"});
    let (one, other) = tokio::join!(create_keyed(&app, poses(&options), "k"), create_keyed(&app, poses(&options), "k"));
    let made: Vec<ShapeSpace> =
        [&one, &other].into_iter().filter(|reply| reply.status == 201).map(|reply| reply.json()).collect();
    let statuses = [one.status, other.status];
    assert!(!made.is_empty() && statuses.iter().all(|status| [201, 409].contains(status)), "{statuses:?}");
    let again: ShapeSpace = create_keyed(&app, poses(&options), "k").await.is(201);
    assert!(made.iter().all(|made| made.id == again.id));
    create_keyed(&app, poses(&json!({})), "k").await.problem(422, "idempotency-key-reused");
    let turned = Form::new().part("options", text(&options));
    let turned = turned.part("pose", file("a.obj", &pose(10))).part("pose", file("b.obj", &pose(0)));
    create_keyed(&app, turned, "k").await.problem(422, "idempotency-key-reused");
    let list: ShapeSpaceList = app.get("/v1/shapespaces").await.is(200);
    assert_eq!(list.shapespaces.len(), 1);
    // The key goes with what it made.
    app.delete(&format!("/v1/shapespaces/{}", again.id)).await.expect(204);
    let anew: ShapeSpace = create_keyed(&app, poses(&options), "k").await.is(201);
    assert_ne!(anew.id, again.id);
    // What is refused takes no key.
    create_keyed(&app, Form::new(), "none").await.problem(400, "bad-request");
    create_keyed(&app, poses(&options), "none").await.expect(201);
}

#[tokio::test]
async fn shape_spaces_belong_to_their_tenant_and_are_forgotten_after_a_while() {
    let app = TestApp::guarded_with(&[("anna", ANNA, ""), ("bert", BERT, "")], &["shape_idle_s=4"]);
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    let made: ShapeSpace = create_keyed(&anna, poses(&json!({})), "k").await.is(201);
    bert.get(&format!("/v1/shapespaces/{}/pose?weights=1,0", made.id)).await.problem(404, "not-found");
    let list: ShapeSpaceList = bert.get("/v1/shapespaces").await.is(200);
    assert!(list.shapespaces.is_empty());
    shape(&anna, &made.id, "weights=1,0").await;
    tokio::time::sleep(Duration::from_millis(4200)).await;
    anna.get(&format!("/v1/shapespaces/{}/pose?weights=1,0", made.id)).await.problem(404, "not-found");
    // So is the key.
    assert_ne!(create_keyed(&anna, poses(&json!({})), "k").await.is::<ShapeSpace>(201).id, made.id);
}
