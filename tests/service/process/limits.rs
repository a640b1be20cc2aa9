//! Limits: known, answered at once, and free again when what took them is over.

use crate::support::{Capture, OCTETS, RECORDS, Raw, TestApp, chunked, eventually, form};
use cager_proto::messages::Session;
use serde_json::json;
use std::time::Duration;

/// Holds as many streams open, by uploads that do not end.
async fn hold(app: &TestApp, id: &str, count: usize) -> Vec<Raw> {
    let mut held = Vec::new();
    for k in 0..count {
        let mut raw = Raw::connect(app).await;
        raw.post_chunked(&format!("/v1/sessions/{id}/frames?first={k}&live=true"), &[]).await;
        raw.write(&chunked(&Capture::tiny().frame(k as u32))).await;
        raw.answer().await.expect(200);
        held.push(raw);
    }
    held
}

#[tokio::test]
async fn beyond_all_streams_comes_503_and_beyond_a_tenants_own_429() {
    for (setting, status, word) in [("max_streams=3", 503, "busy"), ("tenant_max_streams=3", 429, "too-many-streams")] {
        let app = TestApp::with(&[setting]);
        let capture = Capture::tiny();
        let session = app.ready(capture).await;
        let at = |what: &str| format!("/v1/sessions/{}/{what}", session.id);
        let held = hold(&app, &session.id, 3).await;
        let replies = [
            app.post(&at("frames?first=9"), OCTETS, capture.frame(9)).await,
            app.get(&at("cages?first=0&follow=true")).await,
            app.get(&at("events")).await,
            app.post(&at("decode"), OCTETS, vec![0; 12]).await,
        ];
        for reply in replies {
            reply.problem(status, word);
            assert!((1..=60).contains(&reply.retry_after().as_secs()));
        }
        // What is no stream still goes.
        app.get(&at("cages?first=0")).await.expect(200);
        assert_eq!(app.errors(&session.id).await.len(), 3);
        drop(held);
        eventually("a place is free", async || {
            let reply = app.post(&at("frames?first=9"), OCTETS, capture.frame(9)).await;
            (reply.status == 200).then_some(())
        })
        .await;
    }
}

#[tokio::test]
async fn one_tenants_streams_take_no_place_of_anothers() {
    const TOKENS: [&str; 2] = ["anna-has-a-long-secret", "bert-has-a-long-secret"];
    let app = TestApp::guarded(&[("anna", TOKENS[0], "max_streams = 1\n"), ("bert", TOKENS[1], "")]);
    let (anna, bert) = (app.caller(Some(TOKENS[0])), app.caller(Some(TOKENS[1])));
    let capture = Capture::tiny();
    let session = anna.ready(capture).await;
    let _follower = anna.open(&format!("/v1/sessions/{}/cages?follow=true", session.id)).await;
    anna.get(&format!("/v1/sessions/{}/events", session.id)).await.problem(429, "too-many-streams");
    bert.completed(capture, 3).await;
}

#[tokio::test]
async fn more_sessions_than_allowed_are_refused_until_one_is_deleted() {
    let app = TestApp::with(&["tenant_max_sessions=2"]);
    let capture = Capture::tiny();
    let first = app.create(capture).await;
    app.create(capture).await;
    let problem = app.create_with(form(capture, &json!({})), None).await.problem(429, "too-many-sessions");
    assert_eq!(problem.limit, Some(2));
    app.delete(&format!("/v1/sessions/{}", first.id)).await.expect(204);
    app.create(capture).await;
}

#[tokio::test]
async fn more_bytes_than_allowed_are_refused() {
    let app = TestApp::with(&["tenant_max_bytes=1048576"]);
    let large = Capture::new(20_000, 60, 1);
    let problem = app.create_with(form(&large, &json!({})), None).await.problem(507, "quota-exceeded");
    assert_eq!(problem.limit, Some(1 << 20));
    // Frames count as well: of a model this small it takes thousands.
    let capture = Capture::new(500, 200, 4);
    let session = app.ready(&capture).await;
    let body = capture.raw(0..4).repeat(25);
    let path = |first: u32| format!("/v1/sessions/{}/frames?first={first}", session.id);
    for first in (0..4000).step_by(100) {
        let reply = app.post(&path(first), OCTETS, body.clone()).await;
        if reply.status == 507 {
            reply.problem(507, "quota-exceeded");
            assert!(first > 0, "the first ones fit");
            assert_eq!(app.errors(&session.id).await.len(), first as usize, "what was taken before stays");
            return;
        }
        reply.expect(200);
    }
    panic!("four thousand cages of 2.4 kB fit into a megabyte");
}

#[tokio::test]
async fn the_quota_counts_frames_of_an_upload_whose_length_is_not_told() {
    let app = TestApp::with(&["tenant_max_bytes=1048576"]);
    let capture = Capture::new(500, 200, 4);
    let session = app.ready(&capture).await;
    let mut raw = Raw::connect(&app).await;
    raw.post_chunked(&format!("/v1/sessions/{}/frames?first=0", session.id), &[("accept", RECORDS)]).await;
    let body = chunked(&capture.raw(0..4).repeat(16));
    for _ in 0..40 {
        if !raw.try_write(&body).await {
            break;
        }
    }
    raw.try_write(b"0\r\n\r\n").await;
    eventually("the upload is over", async || (app.metric("cager_streams").await == 0.0).then_some(())).await;
    let stored = app.metric("cager_stored_bytes{tenant=\"local\"}").await;
    assert!(stored <= 1_048_576.0, "{stored} bytes are stored where a megabyte is allowed");
}

#[tokio::test]
async fn frames_that_wait_to_be_coded_stay_within_the_quota() {
    let app = TestApp::with(&["tenant_max_bytes=2097152"]);
    let capture = Capture::new(5000, 40, 4);
    let created: Session = app.create_with(form(&capture, &json!({"max_error": 1e-3})), None).await.is(201);
    app.prepared(&created.id).await;
    let body = capture.raw(0..4).repeat(15);
    let post = |first: u32| {
        let (app, body, path) = (&app, body.clone(), format!("/v1/sessions/{}/frames?first={first}", created.id));
        async move { app.stranger().post(&path, OCTETS, body).await }
    };
    // Several uploads at once share what is left.
    let replies = futures_util::future::join_all([0, 60, 120].map(post)).await;
    assert!(replies.iter().any(|reply| reply.text().contains("quota-exceeded")));
    let stored = app.metric("cager_stored_bytes{tenant=\"local\"}").await;
    let frames = app.errors(&created.id).await.len();
    assert!(
        frames > 0 && stored <= 2_097_152.0,
        "{frames} frames of 60 kB, {stored} bytes where two megabytes are allowed"
    );
}

#[tokio::test]
async fn connections_beyond_the_limit_are_told_so_and_health_still_answers() {
    let app = TestApp::with(&["max_connections=4"]);
    let mut held = Vec::new();
    for _ in 0..4 {
        let mut raw = Raw::connect(&app).await;
        raw.head("GET", "/healthz", &[]).await;
        raw.reply().await.expect(200);
        held.push(raw);
    }
    let mut raw = Raw::connect(&app).await;
    raw.head("GET", "/v1/sessions", &[]).await;
    let reply = raw.reply().await;
    reply.problem(503, "busy");
    assert!(reply.retry_after() >= Duration::from_secs(1));
    let mut raw = Raw::connect(&app).await;
    raw.head("GET", "/healthz", &[]).await;
    raw.reply().await.expect(200);
    drop(held);
    eventually("a place is free", async || (app.get("/v1/sessions").await.status == 200).then_some(())).await;
}

#[tokio::test]
async fn connections_with_a_token_do_not_count_for_their_address() {
    const ANNA: &str = "anna-has-a-long-secret";
    let settings = ["max_connections=16", "max_connections_per_address=2"];
    let app = TestApp::guarded_with(&[("anna", ANNA, "scope = \"admin\"\n")], &settings);
    let session = app.ready(Capture::tiny()).await;
    let (path, token) = (format!("/v1/sessions/{}/cages?follow=true", session.id), format!("Bearer {ANNA}"));
    let mut followers = Vec::new();
    for _ in 0..6 {
        let mut raw = Raw::connect(&app).await;
        raw.head("GET", &path, &[("authorization", &token)]).await;
        raw.answer().await.expect(200);
        followers.push(raw);
    }
    let mut scraper = Raw::connect(&app).await;
    scraper.head("GET", "/metrics", &[("authorization", &token)]).await;
    scraper.reply().await.expect(200);
    // Those without one have two places among them: a third makes the first go.
    let mut strangers = Vec::new();
    for _ in 0..3 {
        let mut raw = Raw::connect(&app).await;
        raw.head("GET", "/healthz", &[]).await;
        raw.reply().await.expect(200);
        strangers.push(raw);
        tokio::time::sleep(Duration::from_millis(1100)).await;
    }
    let mut open = Vec::new();
    for raw in &mut strangers {
        open.push(raw.is_open().await);
    }
    assert_eq!(open, [false, true, true], "the first made way");
    assert!(scraper.is_open().await, "metrics are read with a token, too");
    app.get("/v1/sessions").await.expect(200);
}

#[tokio::test]
async fn solvers_that_one_tenant_keeps_displace_its_own() {
    const TOKENS: [&str; 2] = ["anna-has-a-long-secret", "bert-has-a-long-secret"];
    let start = |settings: &[&str]| {
        TestApp::guarded_with(&[("anna", TOKENS[0], "scope = \"admin\"\n"), ("bert", TOKENS[1], "")], settings)
    };
    let capture = Capture::small();
    let app = start(&[]);
    app.ready(capture).await;
    let one = app.metric("cager_cache_bytes{cache=\"solvers\"}").await;
    let room = (4.5 * one) as u64;
    let app = start(&[&format!("cache_bytes={room}"), &format!("prepared_disk_bytes={}", 2 * room)]);
    let (anna, bert) = (app.caller(Some(TOKENS[0])), app.caller(Some(TOKENS[1])));
    let session = anna.ready(capture).await;
    for k in 1..=12 {
        let other = bert.create_with(form(capture, &json!({"lambda": 0.001 * f64::from(k)})), None).await;
        let other: Session = other.is(201);
        bert.prepared(&other.id).await;
    }
    let handles = format!("/v1/sessions/{}/handles", session.id);
    let read = async || app.metric("cager_cache_total{result=\"disk\"}").await;
    let before = read().await;
    anna.get(&handles).await.expect(200);
    assert_eq!(read().await, before, "it is still in memory");
    // And on disk, also after a restart.
    let files = || std::fs::read_dir(app.data().join("prepared")).expect("a folder").count();
    eventually("old files of the other tenant go", async || (files() < 10).then_some(())).await;
    let mut app = app;
    app.kill();
    let app = app.again();
    app.caller(Some(TOKENS[0])).get(&handles).await.expect(200);
    assert_eq!(app.metric("cager_cache_total{result=\"miss\"}").await, 0.0, "its file is still there");
}

#[tokio::test]
async fn a_request_names_its_host_once() {
    let app = TestApp::start();
    for hosts in ["", "host: a\r\nhost: b\r\n"] {
        let mut raw = Raw::connect(&app).await;
        raw.write(format!("GET /v1/sessions HTTP/1.1\r\n{hosts}\r\n").as_bytes()).await;
        assert!(raw.reply().await.problem(400, "bad-request").detail.contains("Host"));
    }
}
