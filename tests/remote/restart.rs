//! What a client makes of a service that dies.

use crate::server::{Server, capture, ready};
use crate::support::ENCODE;
use cager_client::messages::FrameResult;
use cager_client::{CageFrame, FnFrames, UploadOptions};
use futures_util::TryStreamExt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_outlives_kills_of_the_service_and_ends_with_identical_bytes() {
    let (dir, points, values) = capture();
    dir.cager(ENCODE).succeeds();
    let mut server = Server::start(&dir);
    let place = server.place.clone();
    let client = server.client();
    let session = ready(&client, &dir).await;

    let kills = Arc::new(AtomicU32::new(0));
    let killed = Arc::clone(&kills);
    let frame = move |number: u32, out: &mut Vec<f32>| {
        // As slow as a capture that is made while it is sent; its end waits for the kills.
        std::thread::sleep(Duration::from_millis(40));
        while number >= 8 * (killed.load(Ordering::Relaxed) + 1) {
            std::thread::sleep(Duration::from_millis(5));
        }
        out.extend_from_slice(&values[number as usize * 3 * points..][..3 * points]);
        Ok(true)
    };
    let followed = tokio::spawn(client.follow(&session.id, 0).try_collect::<Vec<CageFrame>>());
    let solved = Arc::new(AtomicU32::new(0));
    let (uploader, counting) = (client.clone(), Arc::clone(&solved));
    let upload = tokio::spawn(async move {
        let mut reported = Vec::new();
        let mut on_frame = |result: FrameResult| {
            counting.fetch_add(1, Ordering::Relaxed);
            reported.push(result.frame);
        };
        let options = UploadOptions { on_frame: Some(&mut on_frame), ..UploadOptions::default() };
        let uploaded = uploader.upload(&session, FnFrames::new(points, Some(20), frame), options).await;
        let uploaded = uploaded.expect("an upload");
        uploader.complete(&session.id, uploaded.frames).await.expect("complete");
        let mut file = Vec::new();
        uploader.download(&session.id, &mut file).await.expect("a container");
        (uploaded, reported, file)
    });
    for least in [4, 11] {
        while solved.load(Ordering::Relaxed) < least && !upload.is_finished() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        server.kill();
        kills.fetch_add(1, Ordering::Relaxed);
        tokio::time::sleep(Duration::from_millis(100)).await;
        server = Server::start_at(&dir, &place, &[]);
    }
    let (uploaded, mut reported, file) = upload.await.expect("no panic");
    assert!(uploaded.retries >= 2, "{uploaded:?}");
    reported.sort_unstable();
    assert_eq!(reported, (0..20).collect::<Vec<_>>(), "each once");
    assert!(file == dir.read("out.cager"), "other bytes than without kills");
    let followed = followed.await.expect("no panic").expect("all cages");
    assert_eq!(followed.iter().map(|c| c.frame).collect::<Vec<_>>(), (0..20).collect::<Vec<_>>());
}
