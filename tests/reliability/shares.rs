//! What tenants share beyond places: cages that are made for them, memory for what they download, frames that wait.

use crate::capture::Reference;
use crate::neighbours::{House, OCTETS, attack_time};
use crate::overload::{LOUD, QUIET};
use crate::process::HANG;
use crate::wire::Wire;
use cager_client::messages::CageSource;
use std::time::{Duration, Instant};
use tokio::io::AsyncReadExt as _;
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cages_that_one_tenant_waits_for_hold_nobody_up_and_are_not_made_for_clients_that_left() {
    let house = House::new(&["max_preparing=1"]).await;
    let large = Reference::new(3000, 60, 1);
    let wish = |reference: &Reference, name: &str| {
        let mut new = reference.session(name, Some(name));
        new.cage = None;
        new.options.cage = Some(CageSource { vertices: Some(100), id: None });
        new
    };
    let mut waiting = JoinSet::new();
    for k in 0..80 {
        let (client, new) = (house.server.client().with_token(LOUD), wish(&large, &format!("large {k}")));
        waiting.spawn(async move { client.create(&new).await });
    }
    sleep(Duration::from_millis(700)).await;
    let before = std::iter::from_fn(|| waiting.try_join_next()).count();
    let clock = Instant::now();
    let quiet = house.server.client().with_token(QUIET);
    let created = timeout(6 * HANG, quiet.create(&wish(&house.reference, "small"))).await;
    created.expect("the quiet tenant waits").expect("a session");
    let (took, done) = (clock.elapsed(), std::iter::from_fn(|| waiting.try_join_next()).count());
    println!("a cage beside 80 others after {took:.2?}; {before} of these were made before, and {done} meanwhile");
    // The one that is being made, and perhaps the next ones while the request arrives and the session is made.
    assert!(done < 8, "the quiet tenant waits until {done} cages of the other are made");
    // All of them leave.
    waiting.shutdown().await;
    sleep(Duration::from_millis(1500)).await;
    let before = house.server.cpu();
    sleep(Duration::from_secs(2)).await;
    let used = house.server.cpu() - before;
    assert!(used < Duration::from_millis(400), "{used:?} of processor time in two seconds, for clients that have left");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn positions_that_nobody_reads_leave_memory_to_others_and_are_given_up() {
    let house = House::measured(&["download_bytes=1 MiB", "write_timeout_s=4"]).await;
    // A single batch of frames takes more than there is.
    let large = Reference::new(40_000, 60, 1);
    let client = house.server.client().with_token(LOUD);
    let session = client.create(&large.session("large", None)).await.expect("a session");
    client.wait_ready(&session.id, HANG).await.expect("it is ready");
    let post = house.http.post(house.server.url(&house.path(&session, "/frames"))).bearer_auth(LOUD);
    let frames = post.header("content-type", OCTETS).body(large.bytes(0).repeat(40)).send().await.expect("an answer");
    assert_eq!(frames.text().await.expect("records").lines().count(), 40);
    let mut wire = Wire::connect(house.server.address).await;
    let lines = format!("Authorization: Bearer {LOUD}\r\nContent-Length: 0\r\nConnection: close\r\n");
    wire.post(&house.path(&session, "/decode?layer=cages"), &lines).await;
    sleep(Duration::from_millis(1000)).await;
    let get = house.http.get(house.server.url(&house.path(&house.quiet, "/coordinates"))).bearer_auth(QUIET);
    let answer = get.header("range", "bytes=0-399999").send().await.expect("an answer");
    assert_eq!(answer.status(), 206, "the quiet tenant has its share of the memory");
    house.goes_on("positions that nobody reads", 100.0).await;
    sleep(Duration::from_secs(5)).await;
    // What lies in the buffers can still be read, and then comes the end, long before the last frame.
    let mut bytes = Vec::new();
    let _ = timeout(HANG, wire.0.read_to_end(&mut bytes)).await.expect("an end");
    assert!(bytes.len() < 30 * 12 * large.points, "{} bytes for who does not read", bytes.len());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_that_wait_for_one_tenant_leave_room_to_others() {
    let house = House::new(&["max_queue_frames=16", "workers=1"]).await;
    // Each frame takes a while.
    let slow = Reference::new(2000, 100, 4);
    let client = house.server.client().with_token(LOUD);
    let mut new = slow.session("slow", None);
    (new.options.coordinates, new.options.spectrum) = (Some("green".to_owned()), None);
    let session = client.create(&new).await.expect("a session");
    client.wait_ready(&session.id, HANG).await.expect("it is ready");
    let mut attack = JoinSet::new();
    for stream in 0..8u32 {
        let url = house.server.url(&house.path(&session, "/frames"));
        let (http, body) = (house.http.clone(), slow.many(0..4).repeat(10));
        attack.spawn(async move {
            for round in 0u32.. {
                let url = format!("{url}?first={}", 1_000_000 * stream + 40 * round);
                let post = http.post(url).bearer_auth(LOUD).header("content-type", OCTETS).body(body.clone());
                // Refusals are what it has asked for.
                let _ = post.send().await;
            }
        });
    }
    sleep(Duration::from_millis(500)).await;
    // Each round begins a stream; none is turned away.
    let mut rounds = house.rounds(attack_time()).await;
    // Nor what the other wants to see of its own session.
    for _ in 0..5 {
        let events = house.http.get(house.server.url(&house.path(&session, "/events"))).bearer_auth(LOUD);
        assert_eq!(events.send().await.expect("an answer").status(), 200);
    }
    println!("frames that wait: the quiet tenant {}", rounds.show());
}
