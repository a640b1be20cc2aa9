//! Clients that vanish in the middle of an upload cost nothing any more.

use crate::capture::Reference;
use crate::process::{HANG, Setup};
use crate::wire::Wire;
use std::time::{Duration, Instant};
use tokio::io::AsyncWriteExt as _;
use tokio::time::{sleep, timeout};

/// A batch that runs is not interrupted: two threads, sixteen frames each, on a machine that is busy with other things too.
const STOPS_WITHIN: Duration = Duration::from_millis(1500);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn solving_stops_when_clients_vanish() {
    let reference = Reference::new(20_000, 200, 4);
    let folder = tempfile::tempdir().expect("a folder");
    let server = Setup::new(&folder.path().join("data"), &[]).start().await;
    let session = server.client().create(&reference.session("gone", None)).await.expect("a session");
    let session = server.client().wait_ready(&session.id, HANG).await.expect("a session that is ready");
    let frames = reference.many(0..4);
    for reset in [false, true] {
        let mut wires = Vec::new();
        for k in 0..6 {
            let mut wire = Wire::connect(server.address).await;
            if reset {
                wire.0.set_zero_linger().expect("a socket option");
            }
            let path = format!("/v1/sessions/{}/frames?first={}", session.id, 10_000 * k + usize::from(reset) * 5000);
            wire.post(&path, "Content-Type: application/octet-stream\r\nContent-Length: 1000000000\r\n").await;
            wires.push(wire);
        }
        // As much as the service takes in a moment, from all at once.
        let full = |mut wire: Wire| {
            let frames = frames.clone();
            tokio::spawn(async move {
                let _ = timeout(Duration::from_millis(400), async { while wire.0.write_all(&frames).await.is_ok() {} })
                    .await;
                wire
            })
        };
        let wires: Vec<Wire> =
            futures_util::future::join_all(wires.into_iter().map(full)).await.into_iter().map(|w| w.unwrap()).collect();
        let busy = server.metric("cager_queue_frames").await;
        let solved = server.client().session(&session.id).await.expect("the session").frames.solved;
        assert!(busy > 0.0 && solved > 0, "{busy} frames wait and {solved} are solved: the test tests nothing");
        drop(wires);
        let clock = Instant::now();
        while server.metric("cager_queue_frames").await > 0.0 || server.metric("cager_streams").await > 0.0 {
            assert!(clock.elapsed() < STOPS_WITHIN, "solving goes on, reset {reset}");
            sleep(Duration::from_millis(5)).await;
        }
        let stopped = clock.elapsed();
        sleep(Duration::from_millis(300)).await;
        let before = (server.cpu(), server.client().session(&session.id).await.expect("the session").frames);
        sleep(Duration::from_millis(400)).await;
        let used = server.cpu() - before.0;
        assert!(used <= Duration::from_millis(60), "{used:?} of processor time in 400 ms for nobody");
        let after = server.client().session(&session.id).await.expect("the session").frames;
        assert_eq!(after, before.1);
        assert_eq!(after.received, after.solved, "something still counts as on its way");
        println!("reset {reset}: {busy} frames waited; stopped after {stopped:?}, then {used:?} of processor time");
    }
}
