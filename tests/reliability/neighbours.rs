//! One tenant does its worst; the other goes on as if nothing were.
//!
//! `CAGER_ATTACK_SECONDS` makes the attacks longer than the few seconds that tests have time for.

use crate::capture::Reference;
use crate::overload::{LOUD, QUIET, Times, tokens, watch_health};
use crate::process::{HANG, Server, Setup};
use crate::wire::Wire;
use cager_client::messages::Session;
use futures_util::future::join_all;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

pub(crate) const OCTETS: &str = "application/octet-stream";

/// A service of two tenants, each with a session that is ready.
pub(crate) struct House {
    pub(crate) server: Server,
    pub(crate) reference: Reference,
    pub(crate) loud: Session,
    pub(crate) quiet: Session,
    pub(crate) http: reqwest::Client,
    /// Memory before anything happens, in MiB.
    before: f64,
    /// The quiet tenant's times before anything happens.
    undisturbed: String,
    _folder: tempfile::TempDir,
}

pub(crate) fn attack_time() -> Duration {
    let seconds = std::env::var("CAGER_ATTACK_SECONDS").ok().and_then(|text| text.parse().ok());
    Duration::from_secs_f64(seconds.unwrap_or(2.5))
}

impl House {
    pub(crate) async fn new(settings: &[&str]) -> Self {
        let reference = Reference::new(2000, 60, 12);
        let folder = tempfile::tempdir().expect("a folder");
        let mut setup = Setup::new(&folder.path().join("data"), settings);
        let file = folder.path().join("tokens.toml");
        std::fs::write(&file, tokens()).expect("tokens");
        setup.tokens = Some(file);
        let server = setup.start().await;
        let make = async |token: &str| {
            let client = server.client().with_token(token);
            let session = client.create(&reference.session("house", None)).await.expect("a session");
            client.wait_ready(&session.id, HANG).await.expect("a session that is ready")
        };
        let (loud, quiet) = (make(LOUD).await, make(QUIET).await);
        let http = crate::inside::http().http1_only().build().expect("a client");
        let undisturbed = String::new();
        let mut house = Self { server, reference, loud, quiet, http, before: 0.0, undisturbed, _folder: folder };
        house.begin();
        house
    }

    /// Measures memory from here on.
    fn begin(&mut self) {
        self.server.forget_peak();
        self.before = self.server.rss();
    }

    /// As [`Self::new`], where the quiet tenant's times are known.
    pub(crate) async fn measured(settings: &[&str]) -> Self {
        let mut house = Self::new(settings).await;
        let time = (attack_time() / 3).max(Duration::from_millis(700));
        house.undisturbed = house.rounds(time).await.show();
        house
    }

    pub(crate) fn path(&self, session: &Session, rest: &str) -> String {
        format!("/v1/sessions/{}{rest}", session.id)
    }

    /// The quiet tenant looks at its session and posts frames; gives how long each round took.
    pub(crate) async fn rounds(&self, time: Duration) -> Times {
        let (mut times, clock) = (Times(Vec::new()), Instant::now());
        while clock.elapsed() < time {
            let round = Instant::now();
            let view = self.http.get(self.server.url(&self.path(&self.quiet, ""))).bearer_auth(QUIET);
            let view = timeout(HANG, view.send()).await.expect("the quiet tenant waits").expect("an answer");
            assert_eq!(
                view.status(),
                200,
                "the quiet tenant is turned away: {}",
                view.text().await.unwrap_or_default()
            );
            let first = times.0.len() as u32 % self.reference.count();
            let post = self.http.post(self.server.url(&self.path(&self.quiet, &format!("/frames?first={first}"))));
            let post = post.bearer_auth(QUIET).header("content-type", OCTETS).body(self.reference.bytes(first));
            let done = timeout(HANG, post.send()).await.expect("the quiet tenant waits").expect("an answer");
            assert_eq!(
                done.status(),
                200,
                "the quiet tenant is turned away: {}",
                done.text().await.unwrap_or_default()
            );
            let text = done.text().await.expect("records");
            assert_eq!(text.matches("\"linf\":").count(), 1, "{text}");
            times.0.push(round.elapsed());
            sleep(Duration::from_millis(10)).await;
        }
        times
    }

    /// What the quiet tenant and the operator see while an attack runs.
    pub(crate) async fn goes_on(&self, attack: &str, most_mib: f64) {
        let before = self.before;
        let stop = Arc::new(AtomicBool::new(false));
        let (watching, address) = (Arc::clone(&stop), self.server.address);
        let health = std::thread::spawn(move || watch_health(address, &watching));
        let mut rounds = Times(Vec::new());
        let clock = Instant::now();
        while clock.elapsed() < attack_time() {
            rounds.0.extend(self.rounds(Duration::from_millis(250)).await.0);
        }
        let highest = self.server.peak();
        stop.store(true, Ordering::Relaxed);
        let mut health = tokio::task::spawn_blocking(|| health.join()).await.expect("a thread").expect("health");
        let undisturbed = &self.undisturbed;
        println!("{attack}: the quiet tenant {}, undisturbed {undisturbed}; health {}", rounds.show(), health.show());
        println!("{attack}: {before:.0} MiB before, {highest:.0} MiB at most");
        // The attacker shares the machine that tests run on: what is typical is held to the limits here.
        assert!(health.at(0.5) < Duration::from_millis(50), "health: {}", health.show());
        assert!(rounds.at(0.5) < Duration::from_millis(50), "the quiet tenant: {}", rounds.show());
        assert!(rounds.at(0.99) < Duration::from_secs(1), "the quiet tenant: {}", rounds.show());
        assert!(highest < before + most_mib, "memory grew from {before:.0} to {highest:.0} MiB");
    }
}

/// A client of HTTP/2 that gives each response a window of so many bytes.
pub(crate) fn h2(window: u32) -> reqwest::Client {
    let client = crate::inside::http().http2_prior_knowledge().http2_initial_stream_window_size(window);
    client.build().expect("a client")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn waiting_for_a_preparation_takes_no_place_from_others() {
    let house = House::measured(&["max_requests=60", "max_preparing=1"]).await;
    // Boundary elements of large cages: the second waits for the first.
    let other = Reference::new(2000, 400, 1);
    let client = house.server.client().with_token(LOUD);
    let mut last = None;
    for name in ["one", "two"] {
        let mut new = other.session(name, Some(name));
        new.options.coordinates = Some("harmonic".to_owned());
        last = client.create(&new).await.ok();
    }
    let last = last.expect("a session");
    let mut waiting = JoinSet::new();
    for k in 0..200 {
        let url = house.server.url(&house.path(&last, "/handles"));
        let request = [h2(1 << 16), h2(1 << 16)][k % 2].get(url).bearer_auth(LOUD);
        waiting.spawn(async move { request.send().await.map(|answer| answer.status().as_u16()).unwrap_or(0) });
    }
    sleep(Duration::from_millis(300)).await;
    house.goes_on("waiting for a preparation", 700.0).await;
    let mut refused = 0;
    while let Some(status) = waiting.try_join_next() {
        refused += usize::from(status.expect("a task") == 429);
    }
    assert!(refused > 100, "only {refused} of 200 were told to wait");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn dripping_uploads_take_no_memory_from_others() {
    let house = House::measured(&["frame_bytes=1 MiB"]).await;
    let frame = house.reference.bytes(0).len();
    assert!(60 * frame > 1 << 20, "{frame}");
    let path = house.path(&house.loud, "/frames");
    let lines = format!("Authorization: Bearer {LOUD}\r\nContent-Type: {OCTETS}\r\nContent-Length: {frame}\r\n");
    let wires = join_all((0..60).map(|_| async {
        let mut wire = Wire::connect(house.server.address).await;
        wire.post(&path, &lines).await;
        wire.send([0]).await;
        wire
    }));
    let _wires = wires.await;
    sleep(Duration::from_millis(200)).await;
    house.goes_on("dripping uploads", 50.0).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn responses_that_nobody_reads_stay_within_their_memory() {
    let house = House::measured(&["download_bytes=16 MiB", "write_timeout_s=3"]).await;
    let url = house.server.url(&house.path(&house.loud, "/coordinates"));
    let clients: Vec<_> = (0..8).map(|_| h2(1)).collect();
    let mut unread = Vec::new();
    let mut refused = 0;
    for k in 0..400 {
        let answer = clients[k % clients.len()].get(&url).bearer_auth(LOUD).send().await.expect("an answer");
        refused += usize::from(answer.status() == 429);
        unread.push(answer);
    }
    assert!(refused > 100, "only {refused} of 400 were refused");
    house.goes_on("responses that nobody reads", 60.0).await;
    // Their connections are closed, and give back what they held.
    sleep(Duration::from_secs(4)).await;
    let again = h2(1 << 16).get(&url).bearer_auth(LOUD).send().await.expect("an answer");
    assert_eq!(again.status(), 200);
    let after = house.server.rss();
    assert!(after < house.before + 60.0, "memory stays at {after:.0} MiB");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn decodings_that_nobody_reads_stay_within_their_disk() {
    let house = House::measured(&["spool_bytes=8 MiB"]).await;
    let path = house.path(&house.loud, "/decode");
    let cage = 12 * house.reference.unknowns;
    // Whole cages: a length that ends within one is refused at once.
    let bytes = ((4usize << 20) / cage) * cage;
    let lines = format!("Authorization: Bearer {LOUD}\r\nContent-Type: {OCTETS}\r\nContent-Length: {bytes}\r\n");
    let body = vec![0u8; bytes];
    let mut wires = Vec::new();
    for _ in 0..4 {
        let mut wire = Wire::connect(house.server.address).await;
        wire.post(&path, &lines).await;
        // The server may stop taking it.
        let _ = timeout(Duration::from_millis(500), wire.send(&body)).await;
        wires.push(wire);
    }
    let spooled = || house.server.unnamed_files();
    let clock = Instant::now();
    while spooled() == 0.0 {
        assert!(clock.elapsed() < HANG, "nothing is stored");
        sleep(Duration::from_millis(20)).await;
    }
    let spooled = spooled();
    println!("unread decodings: {spooled:.1} MiB of disk");
    assert!(spooled <= 8.0, "{spooled:.1} MiB of disk where 8 are shared");
    house.goes_on("unread decodings", 60.0).await;
    // What the quiet tenant decodes has room.
    let post = house.http.post(house.server.url(&house.path(&house.quiet, "/decode"))).bearer_auth(QUIET);
    let answer = post.header("content-type", OCTETS).body(vec![0u8; 20 * cage]).send().await.expect("an answer");
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.bytes().await.expect("positions").len(), 20 * 12 * house.reference.points);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn large_preparations_leave_a_place_to_others() {
    let house = House::new(&["max_preparing=2"]).await;
    let (large, client) = (Reference::new(4000, 400, 1), house.server.client().with_token(LOUD));
    for k in 0..4 {
        let mut new = large.session(&format!("large {k}"), Some(&format!("large {k}")));
        new.options.coordinates = Some("harmonic".to_owned());
        client.create(&new).await.expect("a session");
    }
    let (small, quiet) = (Reference::new(1500, 40, 1), house.server.client().with_token(QUIET));
    let clock = Instant::now();
    let session = quiet.create(&small.session("small", Some("small"))).await.expect("a session");
    quiet.wait_ready(&session.id, HANG).await.expect("a session that is ready");
    println!("prepared beside large ones after {:.2?}", clock.elapsed());
    // In one queue it takes more than two seconds.
    assert!(clock.elapsed() < Duration::from_millis(1500), "{:.2?}", clock.elapsed());
    let large = client.sessions().await.expect("sessions");
    let preparing = large.iter().filter(|s| s.state == cager_client::messages::SessionState::Preparing).count();
    assert!(preparing > 0, "the large ones were over before the small one");
}

/// Sessions of a large model that want nothing but their completion.
async fn filled(house: &House, large: &Reference) -> Vec<Session> {
    let client = house.server.client().with_token(LOUD);
    let mut sessions = Vec::new();
    for _ in 0..80 {
        let mut new = large.session("large", None);
        new.idempotency_key = None;
        let session = client.create(&new).await.expect("a session");
        client.wait_ready(&session.id, HANG).await.expect("it is ready");
        let post = house.http.post(house.server.url(&house.path(&session, "/frames"))).bearer_auth(LOUD);
        let done = post.header("content-type", OCTETS).body(large.bytes(0)).send().await.expect("an answer");
        assert_eq!(done.text().await.expect("records").lines().count(), 1);
        sessions.push(session);
    }
    sessions
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn many_completions_at_once_leave_the_service_alive() {
    let mut house = House::measured(&["tenant_max_sessions=100000"]).await;
    let large = Reference::new(40_000, 60, 1);
    // As many at once again and again, while the attack lasts.
    let pause = Duration::from_secs(5);
    let mut waves = Vec::new();
    for _ in 0..attack_time().as_millis().div_ceil(pause.as_millis()) {
        waves.push(filled(&house, &large).await);
    }
    house.begin();
    let client = house.server.client().with_token(LOUD);
    let began = tokio::time::Instant::now();
    let attack = async {
        for (wave, sessions) in (0..).zip(&waves) {
            tokio::time::sleep_until(began + wave * pause).await;
            let wave_began = Instant::now();
            let done = join_all(sessions.iter().map(|session| client.complete(&session.id, 1))).await;
            done.into_iter().for_each(|done| drop(done.expect("it is completed")));
            println!("{} completions took {:.2?}", sessions.len(), wave_began.elapsed());
        }
    };
    // Each of them reads its model.
    tokio::join!(house.goes_on("completions", 100.0), attack);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn idle_sockets_do_not_shut_others_out() {
    let house = House::measured(&["max_connections=40"]).await;
    let mut idle = Vec::new();
    for _ in 0..200 {
        idle.push(Wire::connect(house.server.address).await);
    }
    house.goes_on("idle sockets", 50.0).await;
    // Those that have asked for something once make way, too.
    for _ in 0..120 {
        let mut wire = Wire::connect(house.server.address).await;
        wire.send("GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n").await;
        idle.push(wire);
    }
    sleep(Duration::from_millis(1200)).await;
    house.goes_on("idle sockets that have asked", 50.0).await;
    assert_eq!(house.server.get("/readyz").await, Some(200));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_with_gaps_do_not_make_answers_long() {
    let house = House::measured(&[]).await;
    let mut body = Vec::new();
    let rows = house.reference.handle_rows(0);
    let client = house.server.client().with_token(LOUD);
    for frame in (0..30_000).step_by(2) {
        use cager_proto::record::{Kind, encode};
        encode(Kind::HandleRows, frame, f32::NAN, f32::NAN, &rows, &mut body).expect("a record");
    }
    let url = house.server.url(&house.path(&house.loud, "/frames"));
    let post = house.http.post(url).bearer_auth(LOUD).header("content-type", cager_proto::record::MEDIA_TYPE);
    let text = post.body(body).send().await.expect("an answer").text().await.expect("records");
    assert_eq!(text.lines().count(), 15_000);
    let view = client.session(&house.loud.id).await.expect("the session");
    assert_eq!((view.frames.solved, view.frames.missing.len()), (15_000, 1000));
    assert_eq!((view.frames.missing[999], view.frames.missing_next), ([1999, 2000], Some(2001)));
    let url = house.server.url(&house.path(&house.loud, ""));
    let long = house.http.get(url).bearer_auth(LOUD).send().await.expect("an answer").bytes().await.expect("a view");
    assert!(long.len() < 20_000, "{} bytes", long.len());
    house.goes_on("frames with gaps", 50.0).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn operators_are_answered_when_every_connection_is_taken() {
    let port = std::net::TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr()).expect("a port").port();
    let house = House::new(&["max_connections=2", &format!("admin_listen=127.0.0.1:{port}")]).await;
    let at = |path: &str| format!("http://127.0.0.1:{port}{path}");
    // Connections that are at work, so that none makes way: followers of a session, and the spare ones.
    let follow = house.path(&house.loud, "/cages?follow=true");
    let mut held = Vec::new();
    for _ in 0..70 {
        let mut wire = Wire::connect(house.server.address).await;
        let token = format!("GET {follow} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {LOUD}\r\n\r\n");
        let _ = timeout(Duration::from_millis(200), wire.send(&token)).await;
        held.push(wire);
    }
    for path in ["/healthz", "/readyz", "/metrics"] {
        assert_eq!(house.http.get(at(path)).send().await.expect("an answer").status(), 200, "{path}");
    }
    let tenants: serde_json::Value = house.http.get(at("/admin/tenants")).send().await.unwrap().json().await.unwrap();
    let loud = tenants.as_array().expect("a list").iter().find(|tenant| tenant["tenant"] == "loud").expect("loud");
    assert_eq!((&loud["sessions"], loud["streams"].as_u64() > Some(0)), (&1.into(), true), "{tenants}");
    let all: serde_json::Value = house.http.get(at("/admin/sessions")).send().await.unwrap().json().await.unwrap();
    assert_eq!(all["sessions"].as_array().map(Vec::len), Some(2), "{all}");
    // Not for pages of elsewhere.
    let planted = house.http.post(at("/admin/drain")).header("origin", "https://evil.example").send().await.unwrap();
    assert_eq!(planted.status(), 403);
    let gone = house.http.delete(at(&format!("/admin/sessions/{}", house.loud.id))).send().await.unwrap();
    assert_eq!(gone.status(), 204);
    let evicted: serde_json::Value = house.http.post(at("/admin/evict")).send().await.unwrap().json().await.unwrap();
    assert!(evicted["bytes"].as_u64() > Some(0), "{evicted}");
    assert_eq!(house.http.post(at("/admin/drain")).send().await.unwrap().status(), 202);
    let clock = Instant::now();
    while house.http.get(at("/healthz")).send().await.is_ok() {
        assert!(clock.elapsed() < HANG, "it does not stop");
        sleep(Duration::from_millis(50)).await;
    }
}
