//! Clients that are slow, silent, or read nothing.

use crate::capture::{Reference, le_bytes};
use crate::process::{HANG, Server, Setup};
use crate::wire::Wire;
use cager_client::messages::Session;
use std::time::{Duration, Instant};
use tokio::io::AsyncReadExt as _;
use tokio::time::{sleep, timeout};

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

async fn ready(server: &Server, reference: &Reference) -> Session {
    let session = server.client().create(&reference.session("stalled", None)).await.expect("a session");
    server.client().wait_ready(&session.id, HANG).await.expect("a session that is ready")
}

/// Highest memory while something goes on, in MiB.
async fn highest_rss(server: &Server, work: impl Future<Output = ()>) -> f64 {
    let mut highest = 0.0_f64;
    let watch = async {
        loop {
            highest = highest.max(server.rss());
            sleep(ms(10)).await;
        }
    };
    tokio::select! {
        () = work => {}
        () = watch => {}
    }
    highest
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn memory_stays_small_when_nobody_reads() {
    const FRAMES: usize = 28_000;
    let reference = Reference::new(1500, 330, 1);
    let rows = le_bytes(&reference.handle_rows(0));
    let bytes = FRAMES * rows.len();
    assert!(bytes > 200 << 20, "{bytes}");
    let folder = tempfile::tempdir().expect("a folder");
    let server = Setup::new(&folder.path().join("data"), &[]).start().await;
    let session = ready(&server, &reference).await;
    let before = server.rss();

    // A client that writes all before it reads anything.
    let mut wire = Wire::connect(server.address).await;
    let path = format!("/v1/sessions/{}/frames?rows=handles", session.id);
    wire.post(&path, &format!("Content-Type: application/octet-stream\r\nContent-Length: {bytes}\r\n")).await;
    let many = rows.repeat(500);
    let clock = Instant::now();
    let while_writing = highest_rss(&server, async {
        for _ in 0..FRAMES / 500 {
            wire.send(&many).await;
        }
    })
    .await;
    let written = clock.elapsed();
    let heard = wire.hear("\r\n0\r\n\r\n").await;
    assert_eq!(heard.text.matches("\"frame\":").count(), FRAMES, "{}", &heard.text[heard.text.len() - 300..]);
    drop(wire);

    // One that asks for all cages and reads none, beside one that reads all.
    let follow = format!("GET /v1/sessions/{}/cages?follow=true HTTP/1.1\r\nHost: localhost\r\n\r\n", session.id);
    let mut stalled = Wire::connect(server.address).await;
    stalled.send(&follow).await;
    let mut reader = Wire::connect(server.address).await;
    reader.send(&follow).await;
    let while_reading = highest_rss(&server, async {
        let mut read = 0;
        let mut buffer = vec![0; 1 << 18];
        while read < FRAMES * 12 * reference.unknowns {
            let count = timeout(HANG, reader.0.read(&mut buffer)).await.expect("the stream goes on");
            read += count.expect("a stream");
        }
    })
    .await;
    println!(
        "{} MiB: {before:.0} MiB before, {while_writing:.0} while writing ({written:?}), {while_reading:.0} while reading",
        bytes >> 20
    );
    for highest in [while_writing, while_reading] {
        assert!(highest < before + 64.0, "memory grew from {before:.0} to {highest:.0} MiB");
    }
    // And the one that reads nothing is still served.
    stalled.hear("\r\n\r\n").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn slow_and_silent_clients_are_let_go() {
    let reference = Reference::new(300, 40, 4);
    let settings = ["header_timeout_s=1", "body_timeout_s=1", "idle_timeout_s=2", "write_timeout_s=2"];
    let folder = tempfile::tempdir().expect("a folder");
    let server = Setup::new(&folder.path().join("data"), &settings).start().await;
    let session = ready(&server, &reference).await;
    let octets = "Content-Type: application/octet-stream\r\nContent-Length: 1000000\r\n";
    let path = format!("/v1/sessions/{}/frames", session.id);
    let connect = async || Wire::connect(server.address).await;
    let after = |heard: &crate::wire::Heard, limit: Duration, what: &str| {
        assert!(heard.after + ms(100) >= limit && heard.after < limit + ms(2500), "{what}: {heard:?}");
    };

    let silent = async {
        let heard = connect().await.hear_all().await;
        after(&heard, ms(1000), "silent");
        assert_eq!(heard.text, "");
    };
    let half_a_header = async {
        let mut wire = connect().await;
        wire.send("GET /v1/sessions HTTP/1.1\r\nHost: localhost\r\nX-Half").await;
        after(&wire.hear_all().await, ms(1000), "half a header");
    };
    let idle = async {
        let mut wire = connect().await;
        wire.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").await;
        assert_eq!(wire.hear("\"status\":\"ok\"").await.status(), 200);
        after(&wire.hear_all().await, ms(2000), "idle");
    };
    let nothing_of_a_body = async {
        let mut wire = connect().await;
        wire.post(&path, octets).await;
        let heard = wire.hear("request-timeout").await;
        assert_eq!(heard.status(), 408, "{heard:?}");
        after(&heard, ms(1000), "no body");
    };
    let half_a_body = async {
        let mut wire = connect().await;
        wire.post(&path, octets).await;
        wire.send(reference.many(0..2)).await;
        wire.send(&reference.bytes(2)[..100]).await;
        let heard = wire.hear("request-timeout").await;
        assert_eq!(heard.status(), 200, "{heard:?}");
        assert_eq!(heard.text.matches("\"linf\":").count(), 2, "what was solved is answered first: {heard:?}");
        after(&heard, ms(1000), "half a body");
    };
    let half_a_model = async {
        let mut wire = connect().await;
        let form = "Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 1000\r\n";
        wire.post("/v1/sessions", form).await;
        wire.send("--b\r\nContent-Disposition: form-data; name=\"rest\"; filename=\"rest.obj\"\r\n\r\nv 1 2").await;
        let heard = wire.hear("request-timeout").await;
        assert_eq!(heard.status(), 408, "{heard:?}");
        after(&heard, ms(1000), "half a model");
    };
    tokio::join!(silent, half_a_header, idle, nothing_of_a_body, half_a_body, half_a_model);
    let clock = Instant::now();
    while server.metric("cager_streams").await > 0.0 || server.metric("cager_queue_frames").await > 0.0 {
        assert!(clock.elapsed() < HANG, "a stream is still open");
        sleep(ms(20)).await;
    }
}
