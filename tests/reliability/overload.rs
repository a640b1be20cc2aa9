//! Ten times as much work as there is room for.

use crate::capture::Reference;
use crate::process::{HANG, Setup};
use sha2::{Digest as _, Sha256};
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::time::sleep;

pub(crate) const LOUD: &str = "token-of-the-loud-tenant";
pub(crate) const QUIET: &str = "token-of-the-quiet-tenant";

/// Streams that the loud tenant may have, and how many it wants.
const STREAMS: usize = 12;
const WANTED: usize = 10 * STREAMS;

pub(crate) fn tokens() -> String {
    entry("loud", LOUD) + &entry("quiet", QUIET)
}

/// An entry of a tokens file, of a tenant that has its name.
pub(crate) fn entry(name: &str, token: &str) -> String {
    let hash: String = Sha256::digest(token).iter().map(|byte| format!("{byte:02x}")).collect();
    format!("[[token]]\nname = \"{name}\"\ntenant = \"{name}\"\nsha256 = \"{hash}\"\n")
}

/// How long something took, again and again.
pub(crate) struct Times(pub(crate) Vec<Duration>);

impl Times {
    pub(crate) fn at(&mut self, fraction: f64) -> Duration {
        self.0.sort();
        self.0[((self.0.len() - 1) as f64 * fraction) as usize]
    }

    pub(crate) fn show(&mut self) -> String {
        let (middle, high, highest) = (self.at(0.5), self.at(0.99), self.at(1.0));
        format!("{} times: {middle:.1?} in the middle, {high:.1?} at p99, {highest:.1?} at most", self.0.len())
    }
}

/// Asks for health until it is told to stop, on a thread of its own: the load shares this process, and its waits are not the
/// service's.
pub(crate) fn watch_health(address: SocketAddr, stop: &AtomicBool) -> Times {
    let mut times = Vec::new();
    let mut stream = TcpStream::connect(address).expect("a connection");
    stream.set_nodelay(true).expect("a socket option");
    let mut answer = [0; 4096];
    while !stop.load(Ordering::Relaxed) {
        let clock = Instant::now();
        stream.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").expect("a request");
        let count = stream.read(&mut answer).expect("an answer");
        times.push(clock.elapsed());
        assert!(answer[..count].starts_with(b"HTTP/1.1 200"), "{}", String::from_utf8_lossy(&answer[..count]));
        std::thread::sleep(Duration::from_millis(5));
    }
    Times(times)
}

/// Wants to upload until it is told to stop, as the loud tenant does, and notes how soon it is refused; on a thread of its own.
fn watch_refusals(address: SocketAddr, path: &str, stop: &AtomicBool) -> Times {
    let mut times = Vec::new();
    let head = format!(
        "POST {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {LOUD}\r\nContent-Type: application/octet-stream\r\nContent-Length: 0\r\n\r\n"
    );
    let mut answer = [0; 4096];
    'connect: while !stop.load(Ordering::Relaxed) {
        let mut stream = TcpStream::connect(address).expect("a connection");
        stream.set_nodelay(true).expect("a socket option");
        while !stop.load(Ordering::Relaxed) {
            let clock = Instant::now();
            stream.write_all(head.as_bytes()).expect("a request");
            let count = stream.read(&mut answer).expect("an answer");
            if answer[..count].starts_with(b"HTTP/1.1 200") {
                // It found a place; the answer may come in more pieces.
                continue 'connect;
            }
            assert!(answer[..count].starts_with(b"HTTP/1.1 429"), "{}", String::from_utf8_lossy(&answer[..count]));
            times.push(clock.elapsed());
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    Times(times)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn too_much_work_is_refused_quickly_and_disturbs_nobody() {
    let reference = Arc::new(Reference::new(4000, 120, 24));
    let folder = tempfile::tempdir().expect("a folder");
    let mut setup = Setup::new(&folder.path().join("data"), &[&format!("tenant_max_streams={STREAMS}")]);
    let file = folder.path().join("tokens.toml");
    std::fs::write(&file, tokens()).expect("tokens");
    setup.tokens = Some(file);
    let server = Arc::new(setup.start().await);
    let (loud, quiet) = (server.client().with_token(LOUD), server.client().with_token(QUIET));
    let make = async |client: &cager_client::Client, name: &str| {
        let session = client.create(&reference.session(name, None)).await.expect("a session");
        client.wait_ready(&session.id, HANG).await.expect("a session that is ready")
    };
    let (busy, small) = (make(&loud, "busy").await, make(&quiet, "small").await);
    let before = server.rss();

    let stop = Arc::new(AtomicBool::new(false));
    let url = server.url(&format!("/v1/sessions/{}/frames", busy.id));
    let body = bytes::Bytes::from(reference.many(0..24).repeat(12));
    let http = crate::inside::http().http1_only().build().expect("a client");
    let load: Vec<_> = (0..WANTED)
        .map(|k| {
            let (url, body, http, stop) = (url.clone(), body.clone(), http.clone(), Arc::clone(&stop));
            tokio::spawn(async move {
                let mut refused = Vec::new();
                let mut first = 1_000_000 * k as u32;
                while !stop.load(Ordering::Relaxed) {
                    let request = http.post(format!("{url}?first={first}")).bearer_auth(LOUD);
                    let request = request.header("content-type", "application/octet-stream");
                    let clock = Instant::now();
                    // Only who gets a place sends its body.
                    let probe = request.try_clone().expect("a request").send().await.expect("an answer");
                    if probe.status() == 429 || probe.status() == 503 {
                        assert!(probe.headers().contains_key("retry-after"));
                        refused.push(clock.elapsed());
                        sleep(Duration::from_millis(150)).await;
                        continue;
                    }
                    drop(probe);
                    // Broken off or refused meanwhile: it is only load.
                    if let Ok(answer) = request.body(body.clone()).send().await {
                        let _ = answer.bytes().await;
                    }
                    first += 1000;
                }
                refused
            })
        })
        .collect();

    sleep(Duration::from_millis(500)).await;
    let (mut rss, mut uploads) = (0.0_f64, Times(Vec::new()));
    let (watching, address) = (Arc::clone(&stop), server.address);
    let health = std::thread::spawn(move || watch_health(address, &watching));
    let (watching, path) = (Arc::clone(&stop), format!("/v1/sessions/{}/frames?first=0", busy.id));
    let refusals = std::thread::spawn(move || watch_refusals(address, &path, &watching));
    let clock = Instant::now();
    let mut first = 0;
    for round in 0.. {
        if clock.elapsed() > Duration::from_secs(4) {
            break;
        }
        rss = rss.max(server.rss());
        if round % 10 == 5 {
            // The other tenant posts a few frames at a time.
            let clock = Instant::now();
            let url = server.url(&format!("/v1/sessions/{}/frames?first={first}", small.id));
            let request = http.post(url).bearer_auth(QUIET).header("content-type", "application/octet-stream");
            let answer = request.body(reference.many(first..first + 2)).send().await.expect("an answer");
            assert_eq!(answer.status(), 200, "the other tenant is refused");
            let text = answer.text().await.expect("records");
            assert_eq!(text.matches("\"linf\":").count(), 2, "{text}");
            uploads.0.push(clock.elapsed());
            first = (first + 2) % 24;
        }
        sleep(Duration::from_millis(10)).await;
    }
    stop.store(true, Ordering::Relaxed);
    let mut health = tokio::task::spawn_blocking(|| health.join()).await.expect("a thread").expect("health");
    let mut refused = tokio::task::spawn_blocking(|| refusals.join()).await.expect("a thread").expect("refusals");
    let mut turned_away = Times(Vec::new());
    for worker in load {
        turned_away.0.extend(worker.await.expect("a worker"));
    }
    println!("refused {}", refused.show());
    println!("the load itself, waits for its own turn included: refused {}", turned_away.show());
    println!("health {}", health.show());
    println!("the other tenant's uploads {}", uploads.show());
    println!("{before:.0} MiB before, {rss:.0} MiB at most");
    assert!(turned_away.0.len() > WANTED, "only {} were refused: there is no overload", turned_away.0.len());
    assert!(refused.0.len() > 100, "only {} refusals were timed", refused.0.len());
    assert!(uploads.0.len() > 3, "the other tenant came to nothing");
    // The machine that tests run on may be as overloaded as the service: what is typical is held to the limit here.
    assert!(refused.at(0.5) < Duration::from_millis(100), "refused: {}", refused.show());
    assert!(health.at(0.5) < Duration::from_millis(50), "health: {}", health.show());
    assert!(uploads.at(0.5) < Duration::from_millis(1000), "uploads: {}", uploads.show());
    assert!(rss < before + 300.0, "memory grew from {before:.0} to {rss:.0} MiB");
}
