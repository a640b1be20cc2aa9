//! Who may use the service, and what one tenant can learn of another.

use crate::support::{Capture, TestApp, eventually, folder, service, write_tokens};
use cager_proto::messages::{CacheUse, SessionList};
use std::collections::BTreeSet;
use std::io::Read as _;
use std::process::Stdio;
use std::time::{Duration, Instant};

const ANNA: &str = "anna-has-a-long-secret";
const BERT: &str = "bert-has-a-long-secret";

fn guarded() -> TestApp {
    TestApp::guarded(&[("anna", ANNA, ""), ("bert", BERT, "")])
}

#[tokio::test]
async fn lists_hold_a_tenants_own_sessions_only() {
    let app = guarded();
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    let capture = Capture::tiny();
    let annas = [anna.create(capture).await.id, anna.create(capture).await.id];
    let berts = [bert.create(capture).await.id];
    let list = async |api: &crate::support::Api, query: &str| {
        let list: SessionList = api.get(&format!("/v1/sessions{query}")).await.is(200);
        list.sessions.into_iter().map(|session| session.id).collect::<Vec<_>>()
    };
    assert_eq!(list(&anna, "").await, [annas[1].clone(), annas[0].clone()], "the newest is first");
    assert_eq!(list(&anna, &format!("?after={}", annas[1])).await, annas[..1]);
    assert_eq!(list(&bert, "").await, berts);
    assert_eq!(
        list(&anna, &format!("?after={}", berts[0])).await.len(),
        2,
        "a stranger's id is a place like any other"
    );
}

#[tokio::test]
async fn what_one_tenant_prepared_is_no_hit_for_another() {
    let app = guarded();
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    let capture = Capture::small();
    assert_eq!(anna.ready(capture).await.cache, Some(CacheUse::Miss));
    assert_eq!(anna.ready(capture).await.cache, Some(CacheUse::Hit));
    let session = bert.ready(capture).await;
    assert_eq!(session.cache, Some(CacheUse::Miss), "that would tell what others have");
    assert!(session.seconds.coordinates > 0.0, "nor does its time tell");
    // Both get the same numbers.
    let anna_s = anna.ready(capture).await;
    let (a, b) =
        (anna.upload(&anna_s.id, 0, capture.raw(0..3)).await, bert.upload(&session.id, 0, capture.raw(0..3)).await);
    assert_eq!(a, b);
}

#[tokio::test]
async fn an_idempotency_key_is_a_tenants_own() {
    let app = guarded();
    let form = || crate::support::form(Capture::tiny(), &serde_json::json!({}));
    let anna: cager_proto::messages::Session = app.caller(Some(ANNA)).create_with(form(), Some("k")).await.is(201);
    let bert: cager_proto::messages::Session = app.caller(Some(BERT)).create_with(form(), Some("k")).await.is(201);
    assert_ne!(anna.id, bert.id);
}

#[tokio::test]
async fn a_revoked_token_stops_working_and_a_new_one_begins() {
    let app = guarded();
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    bert.get("/v1/sessions").await.expect(200);
    write_tokens(&app.tokens_file(), &[("anna", ANNA, ""), ("carl", "carl-has-a-long-secret", "")]);
    let clock = Instant::now();
    while bert.get("/v1/sessions").await.status == 200 {
        assert!(clock.elapsed() < Duration::from_secs(5), "the token still works");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    eprintln!("revoked after {:?}", clock.elapsed());
    bert.get("/v1/sessions").await.problem(401, "unauthorized");
    anna.get("/v1/sessions").await.expect(200);
    app.caller(Some("carl-has-a-long-secret")).get("/v1/sessions").await.expect(200);
    // A file that cannot be read locks nobody out.
    std::fs::write(app.tokens_file(), "[[token]\n").expect("a file");
    eventually("it is noticed", async || app.log().contains("not reloaded").then_some(())).await;
    anna.get("/v1/sessions").await.expect(200);
}

#[tokio::test]
async fn what_was_begun_with_a_revoked_token_ends() {
    let app = guarded();
    let (anna, bert) = (app.caller(Some(ANNA)), app.caller(Some(BERT)));
    let capture = Capture::tiny();
    let (annas, berts) = (anna.ready(capture).await, bert.ready(capture).await);
    let path = |id: &str| format!("/v1/sessions/{id}/cages?follow=true");
    let mut followed = bert.open(&path(&berts.id)).await;
    let mut other = anna.open(&path(&annas.id)).await;
    // An upload that is not over yet.
    let mut upload = crate::support::Raw::connect(&app).await;
    let token = format!("Bearer {BERT}");
    let headers = [("authorization", token.as_str()), ("content-type", "application/octet-stream")];
    upload.post_chunked(&format!("/v1/sessions/{}/frames", berts.id), &headers).await;
    upload.write(&crate::support::chunked(&capture.raw(0..1))).await;
    write_tokens(&app.tokens_file(), &[("anna", ANNA, "")]);
    let end = crate::support::within("the end of the stream", Duration::from_secs(5), async {
        loop {
            match followed.chunk().await {
                Ok(Some(_)) => {}
                end => return end,
            }
        }
    });
    assert!(end.await.is_err(), "it is cut, not ended as if all had come");
    let end = async {
        while upload.try_write(&crate::support::chunked(b"1234")).await {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    crate::support::within("the end of the upload", Duration::from_secs(5), end).await;
    // The other tenant's goes on.
    anna.upload(&annas.id, 0, capture.raw(0..1)).await;
    let piece = crate::support::within("a cage", Duration::from_secs(5), other.chunk()).await;
    assert!(piece.expect("the stream goes on").is_some());
}

#[tokio::test]
async fn a_token_that_may_read_looks_and_decodes_and_changes_nothing() {
    const VIEWER: &str = "viewer-has-a-long-secret";
    let app = TestApp::guarded(&[("anna", ANNA, "")]);
    let hash: String =
        <sha2::Sha256 as sha2::Digest>::digest(VIEWER).iter().map(|byte| format!("{byte:02x}")).collect();
    let entry = format!("[[token]]\nname = \"viewer\"\ntenant = \"anna\"\nscope = \"read\"\nsha256 = \"{hash}\"\n");
    let file = std::fs::read_to_string(app.tokens_file()).expect("tokens");
    std::fs::write(app.tokens_file(), format!("{file}{entry}")).expect("tokens");
    let (anna, viewer) = (app.caller(Some(ANNA)), app.caller(Some(VIEWER)));
    eventually("the token is known", async || (viewer.get("/v1/sessions").await.status == 200).then_some(())).await;
    let capture = Capture::tiny();
    let session = anna.completed(capture, 3).await;
    let path = |rest: &str| format!("/v1/sessions/{}{rest}", session.id);
    viewer.get(&path("/capture.cager")).await.expect(200);
    let cage = anna.cages(&session.id).await.slice(..12 * session.unknowns.expect("unknowns") as usize);
    viewer.post(&path("/decode"), "application/octet-stream", cage).await.expect(200);
    viewer.delete(&path("")).await.problem(403, "forbidden");
    viewer.post(&path("/frames"), "application/octet-stream", capture.frame(0)).await.problem(403, "forbidden");
    viewer.create_with(crate::support::form(capture, &serde_json::json!({})), None).await.problem(403, "forbidden");
    anna.delete(&path("")).await.expect(204);
}

#[tokio::test]
async fn request_lines_say_who_did_what_and_how_it_ended() {
    let app = guarded();
    let anna = app.caller(Some(ANNA));
    let session = anna.ready(Capture::tiny()).await;
    anna.delete(&format!("/v1/sessions/{}", session.id)).await.expect(204);
    anna.get(&format!("/v1/sessions/{}", session.id)).await.problem(404, "not-found");
    let log = app.log();
    let line = |words: &[&str]| log.lines().any(|line| words.iter().all(|word| line.contains(word)));
    let (deleted, looked) = (["DELETE", &session.id, "204"], ["GET", &session.id, "404"]);
    for (words, problem) in [(deleted, ""), (looked, "not-found")] {
        let who = ["tenant", "anna", "token", "peer", "127.0.0.1", problem];
        assert!(line(&[&words[..], &who[..]].concat()), "{words:?} in\n{log}");
    }
}

#[tokio::test]
async fn without_tokens_pages_of_other_origins_are_refused() {
    let app = TestApp::with(&["allowed_origins=https://tools.studio", "allowed_hosts=farm.studio"]);
    for (headers, status) in [
        (&[("origin", "https://evil.example")][..], 403),
        (&[("origin", "null")], 403),
        (&[("host", "evil.example")], 403),
        (&[("host", "farm.studio:80")], 200),
        (&[("origin", "https://tools.studio")], 200),
        (&[], 200),
    ] {
        let reply = app.get_with("/v1/sessions", headers).await;
        assert_eq!(reply.status, status, "{headers:?}: {}", reply.text());
        if status == 403 {
            assert!(reply.problem(403, "forbidden").detail.contains("allowed_"), "{}", reply.text());
        }
    }
    let form = crate::support::form(Capture::tiny(), &serde_json::json!({}));
    let planted = app.request(http::Method::POST, "/v1/sessions").header("origin", "https://evil.example");
    assert_eq!(app.send(planted.multipart(form)).await.status, 403);
    let list: SessionList = app.get("/v1/sessions").await.is(200);
    assert!(list.sessions.is_empty());
    // A browser asks before a page of an allowed origin may.
    let asked = app.request(http::Method::OPTIONS, "/v1/sessions").header("origin", "https://tools.studio");
    let reply = app.send(asked.header("access-control-request-method", "POST")).await;
    assert_eq!(reply.header("access-control-allow-origin"), "https://tools.studio");
    // The page reads what the document says of responses.
    let document = app.get_with("/openapi.json", &[("origin", "https://tools.studio")]).await.expect(200);
    let shown = document.header("access-control-expose-headers").to_owned();
    let own: BTreeSet<String> =
        document.text().split('"').filter(|word| word.starts_with("Cager-")).map(str::to_lowercase).collect();
    assert!(own.len() > 4 && own.iter().all(|name| shown.contains(name)), "{own:?}: {shown}");
}

#[tokio::test]
async fn pages_learn_nothing_from_the_operators_listener_but_health() {
    let port = std::net::TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port").port();
    let _app = TestApp::with(&[&format!("admin_listen=127.0.0.1:{port}")]);
    let operator = crate::support::Api::new(std::net::SocketAddr::from(([127, 0, 0, 1], port)), None, false);
    for headers in [[("host", "evil.example")], [("origin", "https://evil.example")]] {
        for path in ["/metrics", "/admin/tenants"] {
            operator.get(path).await.expect(200);
            operator.get_with(path, &headers).await.problem(403, "forbidden");
        }
        for path in ["/healthz", "/readyz"] {
            operator.get_with(path, &headers).await.expect(200);
        }
    }
}

#[tokio::test]
async fn secrets_are_not_in_the_log() {
    let app = guarded();
    let anna = app.caller(Some(ANNA));
    let capture = Capture::tiny();
    let form = crate::support::form(capture, &serde_json::json!({"name": "Unreleased Film"}));
    let session: cager_proto::messages::Session = anna.create_with(form, Some("key-of-anna")).await.is(201);
    anna.prepared(&session.id).await;
    anna.upload(&session.id, 0, capture.raw(0..2)).await;
    anna.get(&format!("/v1/sessions?after={}&token=in-the-query", session.id)).await.expect(400);
    anna.get(&format!("/v1/sessions?after={ANNA}")).await.expect(400);
    app.caller(Some("mistyped-but-nearly-right")).get("/v1/sessions").await.expect(401);
    let failed = anna.get("/v1/sessions/unknown").await.problem(404, "not-found");
    let log = app.log();
    assert!(log.contains(&failed.request_id.expect("an id")), "the log is the one that is looked at");
    let hash: String = <sha2::Sha256 as sha2::Digest>::digest(ANNA).iter().map(|byte| format!("{byte:02x}")).collect();
    for secret in [ANNA, BERT, &hash, "mistyped-but", "in-the-query", "Unreleased", "key-of-anna", "Bearer"] {
        assert!(!log.contains(secret), "{secret:?} is in the log");
    }
}

/// Runs a service that must not start; gives what it says.
fn refused(args: &[&str]) -> String {
    refused_with(args, &[])
}

/// As [`refused`], with these variables.
fn refused_with(args: &[&str], environment: &[(&str, &str)]) -> String {
    let place = folder();
    let mut process = service()
        .args(args)
        .envs(environment.iter().copied())
        .arg("--data")
        .arg(place.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let clock = Instant::now();
    let status = loop {
        if let Some(status) = process.try_wait().expect("its status") {
            break status;
        }
        if clock.elapsed() > Duration::from_secs(10) {
            process.kill().expect("it is there");
            panic!("it serves");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    assert!(!status.success());
    let mut said = String::new();
    process.stderr.take().expect("stderr").read_to_string(&mut said).expect("UTF-8");
    said
}

#[test]
fn an_open_service_listens_on_this_machine_only() {
    for address in ["0.0.0.0:0", "[::]:0"] {
        let said = refused(&["--listen", address]);
        assert!(said.contains("tokens") && said.contains(address), "{said}");
    }
}

/// Variables by which no certificates of authorities are found.
const NO_AUTHORITIES: [(&str, &str); 2] = [("SSL_CERT_FILE", "/nowhere/cert.pem"), ("SSL_CERT_DIR", "/nowhere")];

#[tokio::test]
async fn a_service_that_asks_nobody_needs_no_certificates_of_authorities() {
    let app = TestApp::with_environment(&NO_AUTHORITIES);
    app.completed(Capture::tiny(), 3).await;
}

#[test]
fn one_that_asks_over_tls_says_at_the_start_that_they_are_missing() {
    let place = folder();
    let hooks = place.path().join("webhooks.toml");
    let secret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";
    let entry = format!("[[webhook]]\nurl = \"https://pipeline.example/hook\"\nsecret = \"{secret}\"\n");
    std::fs::write(&hooks, &entry).expect("a file");
    let hooks = format!("webhooks={}", hooks.display());
    let provider = ["--set", "oidc_issuer=https://login.example", "--set", "oidc_audience=cager"];
    let collector = [("OTEL_EXPORTER_OTLP_ENDPOINT", "https://traces.example")];
    for (args, more, named) in [
        (&["--set", hooks.as_str()][..], &[][..], "the entry in line 2"),
        (&provider, &[], "oidc_issuer"),
        (&[], &collector, "OTEL_EXPORTER_OTLP_ENDPOINT"),
    ] {
        let said = refused_with(args, &[&NO_AUTHORITIES[..], more].concat());
        assert!(said.contains(named) && said.contains("ca-certificates") && said.contains("SSL_CERT_FILE"), "{said}");
        assert!(!said.contains("pipeline.example"), "an address may be a secret: {said}");
    }
}

#[test]
fn a_port_in_use_is_named() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("an address").to_string();
    let said = refused(&["--listen", &address]);
    assert!(said.contains(&address), "{said}");
}

#[tokio::test]
async fn metrics_name_tenants_and_are_the_operators_where_there_are_tokens() {
    const ROOT: &str = "root-has-a-long-secret";
    let app = TestApp::guarded(&[("anna", ANNA, ""), ("ops", ROOT, "scope = \"admin\"\n")]);
    app.caller(Some(ANNA)).create(Capture::tiny()).await;
    app.caller(None).get("/metrics").await.problem(401, "unauthorized");
    app.caller(Some("mistyped-but-nearly-right")).get("/metrics").await.problem(401, "unauthorized");
    let detail = app.caller(Some(ANNA)).get("/metrics").await.problem(403, "forbidden").detail;
    assert!(detail.contains("scope is admin"), "{detail}");
    let metrics = app.caller(Some(ROOT)).get("/metrics").await.expect(200).text();
    assert!(metrics.contains("tenant=\"anna\""), "{metrics}");
    // Without tokens there is one tenant, and whoever is on this machine.
    TestApp::start().get("/metrics").await.expect(200);
}

#[tokio::test]
async fn from_another_machine_the_operator_has_a_token_that_says_so() {
    // Only its address tells a listener on all interfaces from one on this machine.
    let tokens = folder();
    let (file, root) = (tokens.path().join("tokens.toml"), "root-has-a-long-secret");
    write_tokens(&file, &[("anna", ANNA, ""), ("ops", root, "scope = \"admin\"")]);
    let port = std::net::TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port").port();
    let app = TestApp::with(&[&format!("tokens={}", file.display()), &format!("admin_listen=0.0.0.0:{port}")]);
    let session = app.caller(Some(ANNA)).ready(Capture::tiny()).await;
    let address = std::net::SocketAddr::from(([127, 0, 0, 1], port));
    let operator = |token: Option<&str>| crate::support::Api::new(address, token.map(str::to_owned), false);
    for path in ["/healthz", "/readyz", "/metrics"] {
        operator(None).get(path).await.expect(200);
    }
    let path = format!("/admin/sessions/{}", session.id);
    operator(None).delete(&path).await.problem(401, "unauthorized");
    operator(Some(ANNA)).delete(&path).await.problem(403, "forbidden");
    operator(Some(ANNA)).get("/admin/sessions").await.problem(403, "forbidden");
    assert!(operator(Some(root)).get("/admin/sessions").await.expect(200).text().contains(&session.id));
    operator(Some(root)).delete(&path).await.expect(204);
    app.caller(Some(ANNA)).get(&format!("/v1/sessions/{}", session.id)).await.problem(404, "not-found");
}

#[tokio::test]
async fn the_audit_file_says_who_changed_what() {
    let place = folder();
    let path = place.path().join("audit.jsonl");
    let setting = format!("audit={}", path.display());
    let app = TestApp::guarded_with(&[("anna", ANNA, ""), ("bert", BERT, "scope = \"read\"")], &[&setting]);
    let capture = Capture::tiny();
    let id = app.completed(capture, 10).await.id;
    app.get(&format!("/v1/sessions/{id}")).await.expect(200);
    app.caller(Some(BERT)).delete(&format!("/v1/sessions/{id}")).await.problem(403, "forbidden");
    app.caller(None).delete(&format!("/v1/sessions/{id}")).await.problem(401, "unauthorized");
    app.delete(&format!("/v1/sessions/{id}")).await.expect(204);
    let lines = std::fs::read_to_string(&path).expect("a file");
    let lines: Vec<serde_json::Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let said: Vec<_> =
        lines.iter().map(|line| (line["action"].as_str(), line["path"].as_str(), &line["status"])).collect();
    let (session, at) = (format!("/v1/sessions/{id}"), |rest: &str| format!("/v1/sessions/{id}{rest}"));
    let (frames, complete) = (at("/frames"), at("/complete"));
    assert_eq!(
        said,
        [
            (Some("POST"), Some("/v1/sessions"), &201.into()),
            (Some("POST"), Some(&*frames), &200.into()),
            (Some("POST"), Some(&*complete), &200.into()),
            (Some("DELETE"), Some(&*session), &204.into()),
        ]
    );
    assert_eq!(lines[0]["made"], session);
    for line in &lines {
        let request = line["request_id"].as_str().is_some_and(|id| app.log().contains(id));
        assert!(
            request && line["tenant"] == "anna" && line["token"] == "key-0" && line["peer"] == "127.0.0.1",
            "{line}"
        );
    }
    let said = refused(&["--set", "audit=/nowhere/audit.jsonl"]);
    assert!(said.contains("/nowhere/audit.jsonl") && said.contains("cannot be written to"), "{said}");
}
