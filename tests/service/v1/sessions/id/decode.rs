//! `POST …/decode`: positions from cages, edited or not.

use crate::support::{Capture, OCTETS, Raw, Reply, TestApp, cages_of, chunked, file};
use cager_core::decode::Decoder;
use cager_proto::messages::Session;
use reqwest::Method;
use reqwest::multipart::{Form, Part};

fn bytes(cages: &[Vec<f32>]) -> Vec<u8> {
    cages.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
}

/// A session with twenty frames, its cages, and the library's decoder.
async fn edited(app: &TestApp) -> (Session, Vec<Vec<f32>>, Decoder) {
    let session = app.ready(Capture::small()).await;
    app.upload(&session.id, 0, Capture::small().raw(0..20)).await;
    let unknowns = session.unknowns.expect("known");
    let phi = app.get(&format!("/v1/sessions/{}/coordinates", session.id)).await.expect(200).body;
    let phi: Vec<f32> = phi.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let decoder = Decoder::from_rows(&phi, unknowns as usize, unknowns as usize);
    let mut cages = cages_of(&app.cages(&session.id).await, unknowns);
    for (k, cage) in cages.iter_mut().enumerate() {
        cage[3 * k] += 0.25;
        cage.iter_mut().skip(1).step_by(3).for_each(|y| *y *= 1.5);
    }
    (session, cages, decoder)
}

#[tokio::test]
async fn edited_cages_are_decoded_as_the_library_decodes_them() {
    let app = TestApp::start();
    let (session, cages, decoder) = edited(&app).await;
    let mut expected = vec![Vec::new(); cages.len()];
    for (cages, out) in cages.chunks(16).zip(expected.chunks_mut(16)) {
        let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        decoder.decode(&views, out);
    }
    let path = format!("/v1/sessions/{}/decode", session.id);
    for api in [app.stranger(), app.http2()] {
        let reply = api.post(&path, OCTETS, bytes(&cages)).await.expect(200);
        assert!(reply.body == bytes(&expected));
    }
    let by_client = app.client().decode(&session.id, &cages.concat()).await.expect("positions");
    assert!(by_client == expected.concat());
    // In any pieces, and before the last cage is sent.
    let mut raw = Raw::connect(&app).await;
    raw.post_chunked(&path, &[]).await;
    let mut found = Vec::new();
    for (k, piece) in bytes(&cages).chunks(501).enumerate() {
        raw.write(&chunked(piece)).await;
        if k == 10 {
            raw.answer().await.expect(200);
            found.extend(raw.piece().await.expect("positions while the upload is open"));
        }
    }
    raw.write(b"0\r\n\r\n").await;
    while let Some(piece) = raw.piece().await {
        found.extend(piece);
    }
    assert!(found == bytes(&expected));
}

#[tokio::test]
async fn what_is_no_cage_is_refused() {
    let app = TestApp::with(&["max_rest_bytes=262144"]);
    let (session, cages, _) = edited(&app).await;
    let path = format!("/v1/sessions/{}/decode", session.id);
    let one = bytes(&cages[..1]);
    app.post(&path, "application/json", "[]").await.problem(415, "media-type");
    let problem = app.post(&path, OCTETS, one[..one.len() - 4].to_vec()).await.problem(400, "bad-request");
    assert!(problem.detail.contains("cage 0"), "{}", problem.detail);
    for whole in [1, 5] {
        let more = [&bytes(&cages[..whole]), &[0][..]].concat();
        let problem = app.post(&path, OCTETS, more).await.problem(400, "bad-request");
        assert!(
            problem.detail.starts_with(&format!("the body ends within cage {whole}, after 1 ")),
            "{}",
            problem.detail
        );
    }
    let mut nan = one.clone();
    nan[4 * 31..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let problem = app.post(&path, OCTETS, nan).await.problem(422, "invalid-frame");
    assert!(problem.detail.contains("cage 0") && problem.detail.contains("vertex 10"), "{}", problem.detail);
    let large = Form::new().part("model", file("large.obj", &vec![b'#'; 2 << 20])).part("cages", Part::bytes(one));
    moved(&app, &session, large).await.problem(413, "too-large");
    assert!(app.post(&path, OCTETS, Vec::new()).await.expect(200).body.is_empty());
}

/// Posts a model and cages as a form.
async fn moved(app: &TestApp, session: &Session, form: Form) -> Reply {
    let path = format!("/v1/sessions/{}/decode", session.id);
    Reply::of(app.request(Method::POST, &path).multipart(form).send().await.expect("an answer")).await
}

#[tokio::test]
async fn another_model_is_moved_by_the_cages_and_its_points_outside_are_counted() {
    let app = TestApp::start();
    let (session, cages, _) = edited(&app).await;
    let cages_part = || Part::bytes(bytes(&cages));
    let path = format!("/v1/sessions/{}/decode", session.id);
    let own = app.post(&path, OCTETS, bytes(&cages)).await.expect(200).body;
    let rest = &Capture::small().rest.obj;

    // The session's own model, as any other.
    let form = Form::new().part("model", file("rest.obj", rest)).part("cages", cages_part());
    let reply = moved(&app, &session, form).await.expect(200);
    assert!(reply.body == own);
    assert_eq!(reply.header("cager-outside"), "0");

    // Two of its points, and one far away.
    let text = String::from_utf8(rest.clone()).expect("text");
    let mut lines: Vec<&str> = text.lines().filter(|line| line.starts_with("v ")).take(2).collect();
    lines.push("v 50 0 0");
    let form = || Form::new().part("model", file("three.obj", lines.join("\n").as_bytes()));
    let reply = moved(&app, &session, form().part("cages", cages_part())).await.expect(200);
    assert_eq!(reply.header("cager-outside"), "1");
    assert_eq!(reply.body.len(), 36 * cages.len());
    let points = own.len() / cages.len();
    for (three, all) in reply.body.chunks(36).zip(own.chunks(points)) {
        assert_eq!(three[..24], all[..24]);
    }

    let problem = moved(&app, &session, form()).await.problem(400, "bad-request");
    assert!(problem.detail.contains("\"cages\" is missing"), "{}", problem.detail);
    let late = Form::new().part("cages", cages_part()).part("model", file("rest.obj", rest));
    let problem = moved(&app, &session, late).await.problem(400, "bad-request");
    assert!(problem.detail.contains("before the part"), "{}", problem.detail);
    let bad = Form::new().part("model", file("bad.obj", b"v 0 0\n")).part("cages", cages_part());
    let problem = moved(&app, &session, bad).await.problem(422, "invalid-geometry");
    assert!(problem.detail.contains("bad.obj"), "{}", problem.detail);
}
