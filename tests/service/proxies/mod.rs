//! Uploads through the proxies of `docs/OPERATIONS.md`, with the configurations that stand there. Proxies that are not installed are left
//! out, with a line that says so. `CAGER_PROXY_UPLOADS` says how many uploads of 20 MB go each way; `make proxies` has 30.

mod proxy;

use crate::support::{Capture, HANG, OCTETS, TestApp, lines, within};
use bytes::Bytes;
use cager_client::{Client, MemoryFrames, UploadOptions};
use cager_proto::messages::FrameResult;
use proxy::{Buffering, Kind, Proxy};
use reqwest::Body;
use std::convert::Infallible;
use std::time::{Duration, Instant};

/// Of each upload, about.
const BYTES: usize = 20 << 20;
/// No upload takes as long as a body may pause.
const PATIENCE: Duration = Duration::from_secs(25);

fn uploads() -> u32 {
    std::env::var("CAGER_PROXY_UPLOADS").ok().and_then(|count| count.parse().ok()).unwrap_or(2)
}

/// A body of so many frames.
fn body(capture: &Capture) -> (u32, Bytes) {
    let some = capture.raw(0..capture.count());
    let times = BYTES.div_ceil(some.len());
    (times as u32 * capture.count(), some.repeat(times).into())
}

fn in_pieces(body: &Bytes) -> Body {
    let pieces: Vec<_> = body.chunks(500_000).map(|piece| Ok::<_, Infallible>(body.slice_ref(piece))).collect();
    Body::wrap_stream(futures_util::stream::iter(pieces))
}

async fn plain_uploads_arrive(kind: Kind) {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    let (frames, body) = body(capture);
    let reference = app.upload(&session.id, 0, capture.raw(0..capture.count())).await;
    let mut first = capture.count();
    for buffering in [Buffering::Off, Buffering::On] {
        let Some(proxy) = Proxy::start(kind, app.address, buffering).await else { return };
        for http2 in [false, true] {
            let http = proxy.http(http2);
            let mut longest = Duration::ZERO;
            for upload in 0..uploads() {
                // Of a length that is not told, every other one: proxies treat such bodies in another way.
                let streamed = upload % 2 == 1;
                let what = format!("{kind:?}, buffering {buffering:?}, HTTP/2 {http2}, upload {upload}");
                let url = format!("{}/v1/sessions/{}/frames?first={first}", proxy.url(), session.id);
                let clock = Instant::now();
                let request = http.post(url).header("content-type", OCTETS).body(match streamed {
                    true => in_pieces(&body),
                    false => body.clone().into(),
                });
                let answer = async {
                    let answer = request.send().await.unwrap_or_else(|error| panic!("{what}: {error:?}"));
                    let status = answer.status();
                    (status, answer.bytes().await.unwrap_or_else(|error| panic!("{what}: {error:?}")))
                };
                let (status, text) = within(&what, PATIENCE, answer).await;
                assert_eq!(status, 200, "{what}: {text:?}");
                let results = lines(&text);
                assert_eq!(results.len(), frames as usize, "{what}");
                // The same frames over and over: what has arrived is what was sent.
                for result in &results {
                    let same = &reference[(result.frame % capture.count()) as usize];
                    assert_eq!((result.l2, result.linf), (same.l2, same.linf), "{what}: frame {}", result.frame);
                }
                longest = longest.max(clock.elapsed());
                first += frames;
            }
            eprintln!("{kind:?}, buffering {buffering:?}, HTTP/2 {http2}: {} uploads, longest {longest:?}", uploads());
        }
    }
}

/// The client asks for results while it sends, and notices where it cannot have them.
async fn the_client_arrives(kind: Kind) {
    let app = TestApp::start();
    let capture = Capture::small();
    let (frames, body) = body(capture);
    let positions: Vec<f32> = body.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    let mut reference = None;
    for buffering in [Buffering::Off, Buffering::On] {
        let Some(proxy) = Proxy::start(kind, app.address, buffering).await else { return };
        let client = Client::new(&proxy.plain_url()).expect("an address");
        let mut retries = 0;
        for upload in 0..uploads().min(5) {
            let session = app.ready(capture).await;
            let mut told = 0;
            let mut on_frame = |_: FrameResult| told += 1;
            let options = UploadOptions { on_frame: Some(&mut on_frame), ..UploadOptions::default() };
            let clock = Instant::now();
            let source = MemoryFrames::new(capture.points(), positions.clone());
            let what = format!("{kind:?}, buffering {buffering:?}, upload {upload}");
            let uploaded = within(&what, 2 * HANG, client.upload(&session, source, options)).await;
            let uploaded = uploaded.unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!((uploaded.frames, told), (frames, frames), "{what}");
            // What the proxy did to one upload, the later ones know.
            retries += uploaded.retries;
            assert!(retries <= 1, "{what}: {uploaded:?}");
            let errors = app.errors(&session.id).await;
            let reference = reference.get_or_insert_with(|| errors.clone());
            assert!(*reference == errors, "{what}: other frames than were sent");
            eprintln!("{what}: {:?}, {} retries", clock.elapsed(), uploaded.retries);
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn uploads_through_nginx_do_not_stall() {
    plain_uploads_arrive(Kind::Nginx).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn uploads_through_haproxy_do_not_stall() {
    plain_uploads_arrive(Kind::Haproxy).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn uploads_through_caddy_do_not_stall() {
    plain_uploads_arrive(Kind::Caddy).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_client_goes_on_without_live_results_behind_nginx() {
    the_client_arrives(Kind::Nginx).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_client_gets_through_haproxy() {
    the_client_arrives(Kind::Haproxy).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_client_gets_through_caddy() {
    the_client_arrives(Kind::Caddy).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn uploads_through_traefik_do_not_stall() {
    plain_uploads_arrive(Kind::Traefik).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_client_gets_through_traefik() {
    the_client_arrives(Kind::Traefik).await;
}
