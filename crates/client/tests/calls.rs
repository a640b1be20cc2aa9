//! Single calls: what is tried again, what is told, and what is not believed.

mod support;

use cager_client::messages::{Problem, Session, SessionList, SessionState};
use cager_client::{Client, ClientError, ClientOptions, Coordinates, LocalDecoder, MeshFile, NewSession};
use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use support::service::{ID, session};
use support::{Exchange, client, serve};

/// A server that gives each request its number.
async fn numbered<F, A>(script: F) -> String
where
    F: Fn(usize, Exchange) -> A + Send + Sync + 'static,
    A: Future<Output = ()> + Send + 'static,
{
    let count = AtomicUsize::new(0);
    serve(move |exchange| script(count.fetch_add(1, Ordering::Relaxed), exchange)).await
}

fn json(session: &Session) -> Vec<u8> {
    serde_json::to_vec(session).expect("JSON")
}

#[tokio::test]
async fn options_that_are_not_finite_are_refused_and_nothing_is_sent() {
    let asked = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&asked);
    let address = serve(move |mut exchange| {
        count.fetch_add(1, Ordering::Relaxed);
        async move {
            exchange.whole_body().await;
            exchange.reply(201, &[], json(&session(SessionState::Preparing))).await;
        }
    })
    .await;
    let client = client(&address);
    let good = NewSession::new(MeshFile::new("rest.obj", ""), MeshFile::new("cage.obj", ""));
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for (name, set) in [
            ("lambda", (|new, x| new.options.lambda = Some(x)) as fn(&mut NewSession, f64)),
            ("frame_rate", |new, x| new.options.frame_rate = Some(x)),
        ] {
            let mut bad = good.clone();
            set(&mut bad, value);
            let error = client.create(&bad).await.expect_err("no number");
            assert!(matches!(&error, ClientError::Mismatch(what) if what.starts_with(name)), "{error}");
        }
    }
    assert_eq!(asked.load(Ordering::Relaxed), 0);
    client.create(&good).await.expect("a session");
    assert_eq!(asked.load(Ordering::Relaxed), 1);
}

#[tokio::test]
async fn creating_again_after_a_lost_answer_names_the_same_wish() {
    let seen = Arc::new(Mutex::new(Vec::new()));
    let log = Arc::clone(&seen);
    let address = numbered(move |number, mut exchange| {
        let log = Arc::clone(&log);
        async move {
            let body = String::from_utf8(exchange.whole_body().await).expect("text");
            let key = exchange.header("idempotency-key").expect("a key").to_owned();
            let token = exchange.header("authorization").unwrap_or_default().to_owned();
            log.lock().expect("no panic").push((key, token, body));
            match number {
                0 => {}
                1 => exchange.problem(429, "busy", &[("retry-after", "0")]).await,
                _ => exchange.reply(201, &[], json(&session(SessionState::Preparing))).await,
            }
        }
    })
    .await;
    let mut new =
        NewSession::new(MeshFile::new("my \"rest\".obj", "v 0 0 0"), MeshFile::new("c.ply", vec![b'p'; 600_000]));
    new.options.spectrum = Some(7);
    let client = client(&address).with_token("t0ken");
    assert_eq!(client.create(&new).await.expect("a session").id, ID);
    let first = {
        let seen = seen.lock().expect("no panic");
        assert_eq!(seen.len(), 3);
        assert_eq!(seen.iter().map(|(key, ..)| key).collect::<HashSet<_>>().len(), 1);
        let (key, token, body) = &seen[0];
        assert_eq!(token, "Bearer t0ken");
        assert!(body.contains(r#"name="options""#) && body.contains(r#"{"spectrum":7}"#), "the options");
        assert!(body.contains(r#"name="rest"; filename="my__rest_.obj""#), "the name of the rest pose");
        assert!(body.contains(r#"name="cage"; filename="c.ply""#) && body.len() > 600_000, "the cage");
        key.clone()
    };
    client.create(&new).await.expect("another session");
    assert_ne!(seen.lock().expect("no panic")[3].0, first, "another wish");
    new.idempotency_key = Some("mine".to_owned());
    client.create(&new).await.expect("a third session");
    assert_eq!(seen.lock().expect("no panic")[4].0, "mine");
}

#[tokio::test]
async fn bad_geometry_is_told_at_once() {
    let address = numbered(|number, mut exchange| async move {
        assert_eq!(number, 0, "asked again");
        exchange.whole_body().await;
        exchange.problem(422, "bad-cage", &[]).await;
    })
    .await;
    let new = NewSession::new(MeshFile::new("rest.obj", ""), MeshFile::new("cage.obj", ""));
    let error = client(&address).create(&new).await.expect_err("a bad cage");
    assert_eq!(error.to_string(), "detail of bad-cage");
}

#[tokio::test]
async fn waiting_ends_with_readiness_failure_or_the_limit() {
    let address = numbered(|number, exchange| async move {
        let mut answer = session(if number < 3 { SessionState::Preparing } else { SessionState::Ready });
        if exchange.path().ends_with("bad") {
            answer.state = SessionState::Failed;
            answer.problem = Some(Problem { detail: "face 3 is open".to_owned(), status: 422, ..Problem::default() });
        }
        if exchange.path().ends_with("slow") {
            answer.state = SessionState::Preparing;
        }
        exchange.json(json(&answer)).await;
    })
    .await;
    let client = client(&address);
    let ready = client.wait_ready(ID, Duration::from_secs(60)).await.expect("ready");
    assert_eq!(ready.state, SessionState::Ready);
    let error = client.wait_ready("bad", Duration::from_secs(60)).await.expect_err("failed");
    assert!(matches!(&error, ClientError::Failed(problem) if problem.detail == "face 3 is open"), "{error}");
    let error = client.wait_ready("slow", Duration::from_millis(300)).await.expect_err("too slow");
    assert!(matches!(error, ClientError::NotReady { .. }), "{error}");
}

#[tokio::test]
async fn all_pages_of_sessions_are_read() {
    let address = numbered(|number, exchange| async move {
        assert_eq!(exchange.query("after"), [None, Some("a%2Fb"), Some("c")][number]);
        let next = [Some("a/b"), Some("c"), None][number].map(str::to_owned);
        let page = SessionList { sessions: vec![session(SessionState::Ready); 2], next };
        exchange.json(serde_json::to_vec(&page).expect("JSON")).await;
    })
    .await;
    assert_eq!(client(&address).sessions().await.expect("sessions").len(), 6);
}

#[tokio::test]
async fn a_list_without_end_is_not_followed() {
    let address = numbered(|_, exchange| async move {
        exchange.json(r#"{"sessions":[],"next":"more"}"#).await;
    })
    .await;
    assert!(matches!(client(&address).sessions().await, Err(ClientError::Protocol(_))));
}

#[tokio::test]
async fn deleting_is_done_when_an_earlier_attempt_did_it() {
    let address = numbered(|number, exchange| async move {
        match number {
            0 => {}
            _ => exchange.problem(404, "not-found", &[]).await,
        }
    })
    .await;
    client(&address).delete(ID).await.expect("deleted");
    assert_eq!(client(&address).delete(ID).await.expect_err("there was none").status(), Some(404));
}

#[tokio::test]
async fn completing_survives_a_restart_and_names_what_is_missing() {
    let address = numbered(|number, mut exchange| async move {
        let body = exchange.whole_body().await;
        assert_eq!(body, br#"{"frames":9}"#);
        match number {
            0 => exchange.reply(503, &[("retry-after", "0")], "").await,
            1 => exchange.json(json(&session(SessionState::Completed))).await,
            _ => {
                let body = r#"{"type":"urn:cager:problem:frames-missing","title":"t","status":409,"detail":"d","missing":[[3,5]]}"#;
                exchange.reply(409, &[("content-type", "application/problem+json")], body).await;
            }
        }
    })
    .await;
    let client = client(&address);
    assert_eq!(client.complete(ID, 9).await.expect("complete").state, SessionState::Completed);
    let error = client.complete(ID, 9).await.expect_err("frames are missing");
    assert_eq!(error.problem().and_then(|p| p.missing.clone()), Some(vec![[3, 5]]));
}

#[tokio::test]
async fn coordinates_of_another_shape_are_not_taken() {
    let good = [("cager-rows", "5"), ("cager-columns", "2")];
    for (headers, values, whole) in
        [(good, 10, true), (good, 9, false), (good, 11, false), ([("cager-rows", "6"), good[1]], 12, false)]
    {
        let address = numbered(move |_, exchange| async move {
            if exchange.path().ends_with("coordinates") {
                let bytes: Vec<u8> = (0..values).flat_map(|k| (k as f32).to_le_bytes()).collect();
                exchange.reply(200, &headers, bytes).await;
            } else {
                exchange.json(json(&session(SessionState::Ready))).await;
            }
        })
        .await;
        let found = client(&address).coordinates(ID).await;
        if whole {
            let Coordinates { rows, columns, values } = found.expect("coordinates");
            assert_eq!((rows, columns, values[9]), (5, 2, 9.0));
            let decoder = LocalDecoder::fetch(&client(&address), ID).await.expect("a decoder");
            // More cages than a batch holds. Row 4 of Φ is 8, 9; its unknowns are about their centre, 1, 1, 0.
            let positions = decoder.decode(&[&[1.0_f32, 0.0, 0.0, 1.0, 2.0, 0.0][..]; 20]).expect("positions");
            assert!(positions.iter().all(|p| p.len() == 15 && p[12..] == [1.0, 2.0, 0.0]), "{:?}", positions[19]);
            assert!(decoder.decode(&[&[1.0]]).is_err());
        } else {
            assert!(matches!(found, Err(ClientError::Protocol(_))), "{found:?}");
        }
    }
}

#[tokio::test]
async fn sizes_that_no_number_holds_are_not_believed() {
    let address = numbered(|_, exchange| async move {
        match exchange.path() {
            path if path.ends_with("coordinates") => {
                let headers = [("cager-rows", "4294967295"), ("cager-columns", "4294967295")];
                exchange.reply(200, &headers, vec![0; 4]).await;
            }
            _ => {
                let (points, unknowns) = (Some(u32::MAX), Some(u32::MAX));
                exchange.json(json(&Session { points, unknowns, ..session(SessionState::Ready) })).await;
            }
        }
    })
    .await;
    let error = client(&address).coordinates(ID).await.expect_err("2^66 bytes");
    assert!(matches!(&error, ClientError::Protocol(what) if what.contains("more numbers")), "{error}");
}

#[tokio::test]
async fn decoding_checks_both_ways() {
    let address = numbered(|_, mut exchange| async move {
        if exchange.path().ends_with("decode") {
            let cages = exchange.whole_body().await.len() / 24;
            exchange.reply(200, &[], vec![0; 60 * cages]).await;
        } else {
            exchange.json(json(&session(SessionState::Ready))).await;
        }
    })
    .await;
    let client = client(&address);
    assert_eq!(client.decode(ID, &[0.0; 18]).await.expect("positions").len(), 45);
    assert!(matches!(client.decode(ID, &[0.0; 7]).await, Err(ClientError::Mismatch(_))));
}

#[tokio::test]
async fn json_without_end_is_not_read_to_the_end() {
    let address = numbered(|_, mut exchange| async move {
        exchange.begin(200, &[]).await;
        for _ in 0..100 {
            exchange.chunk(&[b' '; 1 << 20]).await;
        }
    })
    .await;
    let error = client(&address).session(ID).await.expect_err("too long");
    assert!(matches!(error, ClientError::Protocol(_)), "{error}");
}

#[tokio::test]
async fn a_page_with_status_200_is_no_session() {
    let address = numbered(|number, exchange| async move {
        assert_eq!(number, 0, "asked again");
        exchange.reply(200, &[("content-type", "text/html")], "<h1>Welcome</h1>").await;
    })
    .await;
    assert!(matches!(client(&address).session(ID).await, Err(ClientError::Protocol(_))));
}

#[tokio::test]
async fn a_redirect_is_told_and_not_followed() {
    let address = numbered(|_, exchange| async move {
        exchange.reply(308, &[("location", "https://elsewhere.example/")], "").await;
    })
    .await;
    let error = client(&address).with_token("t").session(ID).await.expect_err("moved").to_string();
    assert!(error.contains("https://elsewhere.example/"), "{error}");
}

#[tokio::test]
async fn a_server_that_knows_only_http1_needs_no_option() {
    let address = numbered(|_, exchange| async move {
        match exchange.method.as_str() {
            // The greeting of HTTP/2.
            "PRI" => exchange.reply(400, &[], "").await,
            _ if exchange.path() == "/healthz" => exchange.reply(404, &[], "").await,
            _ => exchange.json(json(&session(SessionState::Ready))).await,
        }
    })
    .await;
    let options = ClientOptions { retries: 0, ..ClientOptions::default() };
    let client = Client::new(&address).expect("an address").with_options(options);
    assert_eq!(client.session(ID).await.expect("a session").id, ID);
}

#[test]
fn calls_can_be_spawned() {
    fn send<T: Send>(_: impl FnOnce(Client) -> T) {}
    send(|client| async move { client.session(ID).await });
    send(|client| async move { client.create(&NewSession::new(MeshFile::new("", ""), MeshFile::new("", ""))).await });
    send(|client| async move { client.complete(ID, 1).await });
    send(|client| async move { client.download(ID, &mut Vec::new()).await });
    send(|client| async move { client.coordinates(ID).await });
    send(|client| async move { client.decode(ID, &[]).await });
    send(|client| async move {
        let frames = cager_client::MemoryFrames::new(1, vec![0.0; 3]);
        let options = cager_client::UploadOptions::default();
        client.upload(&session(SessionState::Ready), frames, options).await
    });
    send(|client| client.follow(ID, 0));
    send(|client| client.events(ID));
}

#[tokio::test]
async fn a_session_may_take_its_time_once_it_is_sent() {
    let address = serve(|mut exchange| async move {
        exchange.whole_body().await;
        // As long as a cage is made.
        tokio::time::sleep(Duration::from_millis(700)).await;
        exchange.reply(201, &[], json(&session(SessionState::Preparing))).await;
    })
    .await;
    let options = ClientOptions { idle_timeout: Duration::from_millis(100), ..hasty() };
    let client = Client::new(&address).expect("an address").with_options(options);
    let new = NewSession::new(MeshFile::new("rest.obj", "v 0 0 0"), MeshFile::new("cage.obj", "v 0 0 0"));
    client.create(&new).await.expect("a session");
    // What is only asked for must answer.
    let error = client.session(ID).await.expect_err("nothing moved");
    assert!(matches!(error, ClientError::Broken { .. }), "{error}");
}

/// Without a second attempt.
fn hasty() -> ClientOptions {
    ClientOptions { retries: 0, http2: false, ..ClientOptions::default() }
}
