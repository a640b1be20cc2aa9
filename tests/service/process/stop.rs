//! Stopping: everybody is told, and nobody is waited for too long.

use crate::support::{Capture, HANG, Raw, TestApp, chunked, piece, within};
use cager_proto::messages::Problem;
use std::io::{BufRead as _, BufReader};
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Generous against the second that is promised: the machine may be busy.
const SOON: Duration = Duration::from_secs(3);

#[tokio::test]
async fn open_streams_are_told_at_once_and_the_process_ends() {
    let mut app = TestApp::with(&["drain_timeout_s=8"]);
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let at = |what: &str| format!("/v1/sessions/{}/{what}", session.id);
    let mut upload = Raw::connect(&app).await;
    upload.post_chunked(&at("frames?first=0&live=true"), &[]).await;
    upload.write(&chunked(&capture.frame(0))).await;
    upload.answer().await.expect(200);
    upload.piece().await.expect("a record");
    let mut silent = Raw::connect(&app).await;
    silent.post_chunked(&at("frames?first=5"), &[]).await;
    silent.write(&chunked(&capture.frame(5)[..100])).await;
    let mut follower = app.open(&at("cages?first=0&follow=true")).await;
    piece("a beginning", &mut follower).await.expect("a stream").expect("a cage");
    let mut events = app.http2().open(&at("events")).await;
    piece("a beginning", &mut events).await.expect("a stream").expect("an event");
    // Let the silent one arrive.
    tokio::time::sleep(Duration::from_millis(100)).await;

    let clock = Instant::now();
    app.terminate();
    let last = within("the upload is told", SOON, upload.piece()).await.expect("a last line");
    let problem: Problem = serde_json::from_slice(&last).expect("a problem");
    assert_eq!((problem.status, problem.word()), (503, "stopping"));
    assert!(problem.request_id.is_some(), "it has no id to ask about");
    let told = within("the upload without an answer is told", SOON, silent.reply()).await;
    told.problem(503, "stopping");
    assert!(told.retry_after() >= Duration::from_secs(1));
    let end = within("the follower is told", SOON, follower.chunk()).await;
    assert!(end.is_err(), "a stream of cages that is not whole must not look whole");
    let mut last = String::new();
    within("the events end", SOON, async {
        while let Ok(Some(piece)) = events.chunk().await {
            last.push_str(&String::from_utf8_lossy(&piece));
        }
    })
    .await;
    assert!(last.ends_with("event: stopping\ndata: {}\n\n"), "{last:?}");
    let told = clock.elapsed();
    drop((upload, silent, follower, events));
    let (status, _) = app.ended().await;
    eprintln!("all told after {told:?}, ended after {:?}", clock.elapsed());
    assert!(status.success(), "{status}");
    assert!(clock.elapsed() < Duration::from_secs(8), "it waited for the whole drain time");
    assert!(app.log().contains("stopped"));
    // Nothing that was answered is lost.
    let app = app.again();
    assert_eq!(app.errors(&session.id).await.len(), 1);
}

#[tokio::test]
async fn a_client_that_ignores_it_is_cut_off_when_the_drain_time_is_over() {
    let mut app = TestApp::with(&["drain_timeout_s=1"]);
    let capture = Capture::new(400, 300, 20);
    let session = app.ready(&capture).await;
    app.upload(&session.id, 0, capture.raw(0..20).repeat(100)).await;
    app.complete(&session.id, 2000).await.expect(200);
    let mut stuck = Raw::narrow(&app).await;
    stuck.head("GET", &format!("/v1/sessions/{}/cages?first=0", session.id), &[]).await;
    stuck.answer().await.expect(200);
    let clock = Instant::now();
    app.terminate();
    app.ended().await;
    let took = clock.elapsed();
    assert!(took < Duration::from_secs(6), "{took:?}");
    drop(stuck);
}

#[tokio::test]
async fn an_idle_service_ends_at_once_and_accepts_nobody() {
    let mut app = TestApp::start();
    app.get("/readyz").await.expect(200);
    let clock = Instant::now();
    app.terminate();
    let (status, _) = app.ended().await;
    assert!(status.success() && clock.elapsed() < SOON, "{status} after {:?}", clock.elapsed());
    assert!(within("a refusal", HANG, tokio::net::TcpStream::connect(app.address)).await.is_err());
}

#[tokio::test]
async fn a_service_whose_log_nobody_reads_any_more_goes_on_and_stops() {
    let place = crate::support::folder();
    let mut command = crate::support::service();
    command.args(["--listen", "127.0.0.1:0", "--data"]).arg(place.path().join("data"));
    let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let mut line = String::new();
    BufReader::new(process.stdout.take().expect("its output")).read_line(&mut line).expect("its first line");
    let address = line.trim().strip_prefix("listening on ").expect("an address").parse().expect("an address");
    drop(process.stderr.take());
    let api = crate::support::Api::new(address, None, false);
    for _ in 0..3 {
        api.get("/v1/sessions").await.expect(200);
    }
    let pid = rustix::process::Pid::from_child(&process);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("it is there");
    let ended =
        crate::support::eventually("its end", || std::future::ready(process.try_wait().expect("its status"))).await;
    assert!(ended.success(), "{ended}");
}
