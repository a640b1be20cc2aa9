//! Things that happen at the same time, or in an unlucky order.

use crate::capture::Reference;
use crate::faults::Loss;
use crate::inside::Inside;
use crate::process::HANG;
use crate::wire::Wire;
use cager_client::messages::SessionState;
use std::net::SocketAddr;
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use tokio::time::{sleep, timeout};

static SMALL: LazyLock<Reference> = LazyLock::new(|| Reference::new(300, 40, 120));

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

async fn until(what: &str, mut done: impl AsyncFnMut() -> bool) {
    let clock = Instant::now();
    while !done().await {
        assert!(clock.elapsed() < HANG, "{what} does not happen");
        sleep(ms(3)).await;
    }
}

fn address(inside: &Inside) -> SocketAddr {
    inside.url("").trim_start_matches("http://").parse().expect("an address")
}

/// A creation by hand.
fn form(reference: &Reference, name: &str) -> (String, Vec<u8>) {
    let mut body = Vec::new();
    for (part, file, bytes) in [
        ("options", "", format!("{{\"name\":\"{name}\"}}").as_bytes()),
        ("rest", "; filename=\"rest.obj\"", &reference.rest_obj),
        ("cage", "; filename=\"cage.obj\"", &reference.cage_obj),
    ] {
        let head = format!("--b\r\nContent-Disposition: form-data; name=\"{part}\"{file}\r\n\r\n");
        body.extend_from_slice(head.as_bytes());
        body.extend_from_slice(bytes);
        body.extend_from_slice(b"\r\n");
    }
    body.extend_from_slice(b"--b--\r\n");
    let head = format!(
        "Content-Type: multipart/form-data; boundary=b\r\nIdempotency-Key: {name}\r\nContent-Length: {}\r\n",
        body.len()
    );
    (head, body)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_leaves_while_its_session_is_made_finds_it_later() {
    let inside = Inside::new().await;
    inside.gate.close();
    let (head, body) = form(&SMALL, "left");
    let mut wire = Wire::connect(address(&inside)).await;
    wire.post("/v1/sessions", &head).await;
    wire.send(body).await;
    until("a sync", async || inside.gate.waiting() > 0).await;
    drop(wire);
    sleep(ms(50)).await;
    inside.gate.open();
    until("the session", async || inside.names("sessions").len() == 1).await;
    until("knowing it", async || inside.client().sessions().await.is_ok_and(|all| all.len() == 1)).await;
    let (head, body) = form(&SMALL, "left");
    let mut wire = Wire::connect(address(&inside)).await;
    wire.post("/v1/sessions", &head).await;
    wire.send(body).await;
    assert_eq!(wire.hear("\r\n\r\n").await.status(), 201);
    assert_eq!(inside.names("sessions").len(), 1, "it was made again");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_leaves_while_its_session_is_deleted_leaves_none() {
    let inside = Inside::new().await;
    let session = inside.ready(&SMALL, "left").await;
    // Its log is open, so that frames could go on being written where nobody finds them again.
    inside.post(&session.id, 0, SMALL.many(0..5)).await;
    inside.gate.close();
    let mut wire = Wire::connect(address(&inside)).await;
    wire.send(format!("DELETE /v1/sessions/{} HTTP/1.1\r\nHost: localhost\r\n\r\n", session.id)).await;
    until("a sync", async || inside.gate.waiting() > 0).await;
    drop(wire);
    sleep(ms(50)).await;
    inside.gate.open();
    let path = format!("/v1/sessions/{}", session.id);
    until("the end of the session", async || inside.status(&path).await == 404).await;
    until("the end of its content", async || inside.names("contents").is_empty()).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_completed_session_takes_no_new_frame() {
    let mut inside = Inside::new().await;
    let session = inside.ready(&SMALL, "sealed").await;
    inside.post(&session.id, 0, SMALL.many(0..40)).await;
    inside.client().complete(&session.id, 40).await.expect("a completion");
    for round in 0..2 {
        let known = inside.post(&session.id, 3, SMALL.many(3..5)).await;
        assert_eq!((known.frames.len(), &known.problem), (2, &None), "what is there is answered as the first time");
        let posted = inside.post(&session.id, 38, SMALL.many(38..45)).await;
        assert!(posted.frames.keys().all(|&frame| frame < 40), "round {round}: {posted:?}");
        let problem = posted.problem.expect("a refusal");
        assert_eq!((problem.status, problem.word()), (409, "session-completed"), "{problem:?}");
        let now = inside.client().session(&session.id).await.expect("the session");
        assert_eq!((now.state, now.frames.solved), (SessionState::Completed, 40));
        inside.restart(Loss::Everything).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn completing_while_frames_arrive_leaves_no_answered_frame_out() {
    let inside = Inside::new().await;
    let client = inside.impatient();
    for round in 0..3 {
        let session = inside.ready(&SMALL, &format!("race-{round}")).await;
        inside.post(&session.id, 0, SMALL.many(0..20)).await;
        // Frames beyond the end are solved and about to be written.
        inside.gate.close();
        let upload = inside.post(&session.id, 20, SMALL.many(20..40));
        let complete = async {
            until("writing", async || inside.gate.waiting() > 0).await;
            let completed = client.complete(&session.id, 20);
            let (completed, ()) = tokio::join!(completed, async {
                sleep(ms(30)).await;
                inside.gate.open();
            });
            completed
        };
        let (posted, completed) = tokio::join!(upload, complete);
        let error = completed.expect_err("there are more frames");
        assert_eq!(error.problem().map(cager_client::messages::Problem::word), Some("frame-conflict"), "{error}");
        assert_eq!(posted.frames.len(), 20, "round {round}: {:?}", posted.problem);
        inside.finish(&SMALL, &session).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_session_made_while_another_of_its_kind_is_deleted_is_prepared() {
    let inside = Inside::new().await;
    let client = inside.client();
    for round in 0..15 {
        let mark = format!("{round}");
        let first = SMALL.session(&format!("first-{round}"), Some(&mark));
        let second = SMALL.session(&format!("second-{round}"), Some(&mark));
        let one = client.create(&first).await.expect("a session");
        let (gone, two) = tokio::join!(client.delete(&one.id), client.create(&second));
        gone.expect("a deletion");
        let two = client.wait_ready(&two.expect("a session").id, HANG).await.expect("it is prepared");
        client.delete(&two.id).await.expect("a deletion");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_waits_for_an_answer_hears_of_an_error_before_the_body_ends() {
    let inside = Inside::new().await;
    let session = inside.ready(&SMALL, "steps").await;
    let mut wire = Wire::connect(address(&inside)).await;
    let path = format!("/v1/sessions/{}/frames?live=true", session.id);
    wire.post(&path, "Content-Type: application/octet-stream\r\nTransfer-Encoding: chunked\r\n").await;
    wire.chunk(&SMALL.bytes(0)).await;
    wire.hear("\"frame\":0").await;
    wire.chunk(&f32::NAN.to_le_bytes().repeat(3 * SMALL.points)).await;
    let heard = wire.hear("invalid-frame").await;
    assert!(heard.after < ms(2000), "{:?}", heard.after);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_session_with_damaged_frames_is_failed_and_disturbs_no_other() {
    let mut inside = Inside::new().await;
    let (bad, good) = (inside.ready(&SMALL, "bad").await, inside.ready(&SMALL, "good").await);
    inside.post(&bad.id, 0, SMALL.many(0..60)).await;
    let posted = inside.post(&good.id, 0, SMALL.many(0..60)).await;
    inside.disk.sql(&format!(
        "UPDATE frames SET spread = 7 WHERE frame = 3 AND record = (SELECT number FROM records WHERE id = '{}')",
        bad.id
    ));
    inside.restart(Loss::Nothing).await;
    for round in 0..3 {
        if round == 2 {
            inside.restart(Loss::Nothing).await;
        }
        let now = inside.client().session(&bad.id).await.expect("the session is told of");
        assert_eq!(now.state, SessionState::Failed);
        assert!(now.problem.is_some());
        let refused = inside.post(&bad.id, 60, SMALL.many(60..61)).await.problem.expect("a refusal");
        assert_eq!((refused.status, refused.word()), (409, "session-failed"), "{refused:?}");
        assert_eq!(inside.client().sessions().await.expect("a list").len(), 2);
    }
    inside.check(&SMALL, &good.id, &posted.frames).await;
    inside.client().delete(&bad.id).await.expect("a deletion");
    inside.finish(&SMALL, &good).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_posted_while_a_restarted_session_prepares_again_meet_those_that_are_stored() {
    let mut inside = Inside::new().await;
    for round in 0..3 {
        let session = inside.ready(&SMALL, &format!("again-{round}")).await;
        let before = inside.post(&session.id, 0, SMALL.many(0..60)).await.frames;
        // The process ended before it wrote down how preparing went.
        inside.disk.sql(&format!("UPDATE records SET outcome = NULL WHERE id = '{}'", session.id));
        std::fs::remove_dir_all(inside.folder("prepared")).expect("solvers");
        // Preparing takes until the disk takes its outcome.
        inside.restart_slowly(Loss::Nothing).await;
        let uploads = (0..4).map(|k| inside.post(&session.id, 10 * k, SMALL.many(10 * k..120)));
        let (uploads, ()) = tokio::join!(futures_util::future::join_all(uploads), async {
            until("a sync", async || inside.gate.waiting() > 0).await;
            sleep(ms(50)).await;
            inside.gate.open();
        });
        for (k, posted) in uploads.into_iter().enumerate() {
            assert_eq!(posted.frames.len(), 120 - 10 * k, "round {round}: {:?}", posted.problem);
        }
        inside.check(&SMALL, &session.id, &before).await;
        inside.finish(&SMALL, &session).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_disk_that_hangs_holds_uploads_back_instead_of_filling_the_memory() {
    let inside = Inside::new().await;
    let session = inside.ready(&SMALL, "hangs").await;
    inside.post(&session.id, 0, SMALL.many(0..1)).await;
    inside.gate.close();
    let body = SMALL.many(0..120).repeat(30);
    let url = inside.url(&format!("/v1/sessions/{}/frames?first=1000", session.id));
    let upload = tokio::spawn(crate::inside::post(url, body));
    let (mut before, mut same) = (0, 0);
    while same < 5 {
        sleep(ms(100)).await;
        let now = inside.client().session(&session.id).await.expect("the session").frames.received;
        same = if now == before && now > 1 { same + 1 } else { 0 };
        before = now;
    }
    assert!(before < 1000, "{before} of 3600 frames were taken that are not on disk");
    assert_eq!(inside.status("/healthz").await, 200);
    inside.gate.open();
    let posted = timeout(HANG, upload).await.expect("it goes on").expect("a task");
    assert!(posted.problem.is_none(), "{posted:?}");
    assert_eq!(posted.status, 200);
}
