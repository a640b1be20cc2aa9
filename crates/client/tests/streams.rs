//! Streams and downloads over connections that break.

mod support;

use cager_client::messages::{FrameCounts, Problem, Progress, Session, SessionState};
use cager_client::{CageFrame, ClientError};
use cager_proto::record::{self, Kind};
use futures_util::{StreamExt, TryStreamExt};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use support::service::{ID, UNKNOWNS, session};
use support::{Exchange, client, serve};

fn cage(frame: u32) -> Vec<u8> {
    let values: Vec<f32> = (0..3 * UNKNOWNS).map(|k| (10 * frame + k) as f32).collect();
    let mut bytes = Vec::new();
    record::encode(Kind::Cage, frame, 0.25, f32::NAN, &values, &mut bytes).expect("rows of three");
    bytes
}

fn completed(frames: u64) -> Session {
    let frames = FrameCounts { received: frames, solved: frames, missing: Vec::new(), missing_next: None };
    Session { frames, ..session(SessionState::Completed) }
}

/// Answers for the session and gives every other request to `script` with its number; returns the address and the log.
async fn scripted<F, A>(session: Session, script: F) -> (String, Arc<Mutex<Vec<String>>>)
where
    F: Fn(usize, Exchange) -> A + Send + Sync + 'static,
    A: Future<Output = ()> + Send + 'static,
{
    let log = Arc::new(Mutex::new(Vec::new()));
    let (seen, count, script) = (Arc::clone(&log), AtomicUsize::new(0), Arc::new(script));
    let address = serve(move |exchange| {
        let looks = exchange.target == format!("/v1/sessions/{ID}");
        let number = if looks { 0 } else { count.fetch_add(1, Ordering::Relaxed) };
        if !looks {
            let extra =
                ["range", "if-range", "last-event-id"].map(|name| exchange.header(name).unwrap_or("").to_owned());
            seen.lock().expect("no panic").push(format!("{} {}", exchange.target, extra.join(" ")).trim().to_owned());
        }
        let (session, script) = (session.clone(), Arc::clone(&script));
        async move {
            if looks {
                exchange.json(serde_json::to_vec(&session).expect("JSON")).await;
            } else {
                script(number, exchange).await;
            }
        }
    })
    .await;
    (address, log)
}

fn numbers(cages: &[CageFrame]) -> Vec<u32> {
    cages.iter().map(|cage| cage.frame).collect()
}

#[tokio::test]
async fn following_goes_on_from_the_next_frame_whatever_breaks() {
    let (address, log) = scripted(completed(9), |number, mut exchange| async move {
        let first: u32 = exchange.query("first").expect("first").parse().expect("a number");
        match number {
            // Cut within a record.
            0 => {
                exchange.begin(200, &[]).await;
                let two = [cage(first), cage(first + 1)].concat();
                exchange.chunk(&two[..two.len() - 5]).await;
            }
            1 => exchange.problem(503, "busy", &[]).await,
            // Damaged on the way.
            2 => {
                exchange.begin(200, &[]).await;
                let mut damaged = cage(first + 1);
                *damaged.last_mut().expect("bytes") ^= 1;
                exchange.chunk(&[cage(first), damaged].concat()).await;
                exchange.end().await;
            }
            // Ended in good order, but early.
            3 => {
                exchange.begin(200, &[]).await;
                exchange.chunk(&cage(first)).await;
                exchange.end().await;
            }
            _ => {
                exchange.begin(200, &[]).await;
                for frame in first..9 {
                    for piece in cage(frame).chunks(7) {
                        exchange.chunk(piece).await;
                    }
                }
                exchange.end().await;
            }
        }
    })
    .await;
    let cages: Vec<CageFrame> = client(&address).follow(ID, 2).try_collect().await.expect("all cages");
    assert_eq!(numbers(&cages), (2..9).collect::<Vec<_>>());
    assert_eq!((cages[0].l2, cages[0].linf), (Some(0.25), None));
    assert_eq!(cages[3].values, [50.0, 51.0, 52.0, 53.0, 54.0, 55.0]);
    let firsts: Vec<String> = log.lock().expect("no panic").clone();
    let asked = [2, 3, 3, 4, 5].map(|first| format!("/v1/sessions/s1/cages?first={first}&follow=true"));
    assert_eq!(firsts, asked);
}

#[tokio::test]
async fn records_of_another_session_are_never_taken_for_cages() {
    for damage in [12, 6, 4, 0] {
        let (address, _) = scripted(completed(3), move |_, mut exchange| async move {
            exchange.begin(200, &[]).await;
            let mut bytes = cage(0);
            bytes[damage] ^= 0x40;
            exchange.chunk(&bytes).await;
            exchange.end().await;
        })
        .await;
        let error = client(&address).follow(ID, 0).try_collect::<Vec<_>>().await.expect_err("not ours");
        assert!(matches!(error, ClientError::Protocol(_)), "byte {damage}: {error}");
    }
}

#[tokio::test]
async fn a_frame_out_of_order_ends_the_stream() {
    let (address, _) = scripted(completed(3), |_, mut exchange| async move {
        exchange.begin(200, &[]).await;
        exchange.chunk(&[cage(0), cage(2)].concat()).await;
        exchange.end().await;
    })
    .await;
    let mut cages = client(&address).follow(ID, 0);
    assert_eq!(cages.next().await.expect("one").expect("a cage").frame, 0);
    assert!(matches!(cages.next().await, Some(Err(ClientError::Protocol(_)))));
    assert!(cages.next().await.is_none());
}

#[tokio::test]
async fn a_deleted_session_ends_the_stream_with_the_services_words() {
    let (address, _) =
        scripted(completed(3), |_, exchange| async move { exchange.problem(404, "not-found", &[]).await }).await;
    let error = client(&address).follow(ID, 0).try_collect::<Vec<_>>().await.expect_err("gone");
    assert_eq!(error.problem().map(Problem::word), Some("not-found"));
}

#[tokio::test]
async fn some_cages_come_in_one_piece() {
    let (address, log) = scripted(completed(9), |number, mut exchange| async move {
        let first: u32 = exchange.query("first").expect("first").parse().expect("a number");
        let count: u32 = exchange.query("count").expect("count").parse().expect("a number");
        let end = if number == 0 { first + 1 } else { 9.min(first + count) };
        exchange.begin(200, &[]).await;
        exchange.chunk(&(first..end).flat_map(cage).collect::<Vec<u8>>()).await;
        if number > 0 {
            exchange.end().await;
        }
    })
    .await;
    let client = client(&address);
    assert_eq!(numbers(&client.cages(ID, 6, 2).await.expect("cages")), [6, 7]);
    assert_eq!(numbers(&client.cages(ID, 2, 4).await.expect("cages")), [2, 3, 4, 5]);
    assert!(client.cages(ID, 7, 0).await.expect("none").is_empty());
    assert_eq!(
        log.lock().expect("no panic")[..2],
        ["/v1/sessions/s1/cages?first=6&count=2", "/v1/sessions/s1/cages?first=7&count=1"]
    );
}

#[tokio::test]
async fn progress_goes_on_after_the_last_event() {
    let event = |id: u32, state: SessionState| {
        let progress = Progress { state, received: u64::from(id), solved: u64::from(id), coded: None };
        format!("id: {id}\ndata: {}\n\n", serde_json::to_string(&progress).expect("JSON"))
    };
    let (address, log) = scripted(completed(9), move |number, mut exchange| async move {
        exchange.begin(200, &[("content-type", "text/event-stream")]).await;
        match number {
            0 => {
                exchange.chunk(b": hello\nretry: 1\n\n").await;
                exchange.chunk(event(1, SessionState::Preparing).as_bytes()).await;
                exchange.chunk(event(2, SessionState::Ready).as_bytes()).await;
                exchange.chunk(b"id: 3\ndata: {").await;
            }
            1 => {
                exchange.chunk(event(3, SessionState::Ready).as_bytes()).await;
                exchange.chunk(b"event: news\ndata: of another kind\n\n").await;
                exchange.end().await;
            }
            _ => {
                exchange.chunk(event(4, SessionState::Completed).as_bytes()).await;
                // The session is complete: nobody waits for the end of this.
                tokio::time::sleep(std::time::Duration::from_secs(60)).await;
            }
        }
    })
    .await;
    let progress: Vec<Progress> = client(&address).events(ID).try_collect().await.expect("progress");
    assert_eq!(progress.iter().map(|p| p.solved).collect::<Vec<_>>(), [1, 2, 3, 4]);
    assert_eq!(
        *log.lock().expect("no panic"),
        ["/v1/sessions/s1/events", "/v1/sessions/s1/events   2", "/v1/sessions/s1/events   3"]
    );
}

#[tokio::test]
async fn a_page_in_the_place_of_events_ends_the_stream() {
    let (address, log) = scripted(completed(9), |_, exchange| async move {
        exchange.reply(200, &[("content-type", "text/html")], "<h1>Sign in</h1>").await;
    })
    .await;
    let progress: Result<Vec<Progress>, _> = client(&address).events(ID).try_collect().await;
    let error = progress.expect_err("no events");
    assert!(matches!(&error, ClientError::Protocol(what) if what.contains("text/html")), "{error}");
    assert_eq!(log.lock().expect("no panic").len(), 1);
}

const CONTAINER: &[u8] = b"0123456789abcdefghijklmnopqrstuvwxyz";

#[tokio::test]
async fn a_download_goes_on_with_the_next_byte() {
    let (address, log) = scripted(completed(9), |number, mut exchange| async move {
        let start = exchange.header("range").map_or(0, |range| {
            range.strip_prefix("bytes=").and_then(|r| r.strip_suffix('-')).expect("a range").parse().expect("a number")
        });
        let total = CONTAINER.len();
        let range = format!("bytes {start}-{}/{total}", total - 1);
        match number {
            0 => {
                exchange.begin_sized(200, &[("etag", "\"v1\"")], total).await;
                exchange.raw(&CONTAINER[..10]).await;
            }
            1 => {
                exchange.begin_sized(206, &[("etag", "\"v1\""), ("content-range", &range)], total - start).await;
                exchange.raw(&CONTAINER[start..20]).await;
            }
            2 => exchange.reply(502, &[], "<b>bad</b>").await,
            // Ranges are not for everyone.
            _ => exchange.reply(200, &[("etag", "\"v1\"")], CONTAINER).await,
        }
    })
    .await;
    let mut out = Vec::new();
    assert_eq!(client(&address).download(ID, &mut out).await.expect("a container"), CONTAINER.len() as u64);
    assert_eq!(out, CONTAINER);
    let log = log.lock().expect("no panic").clone();
    assert_eq!(log[1], "/v1/sessions/s1/capture.cager bytes=10- \"v1\"");
    assert_eq!(log[2], "/v1/sessions/s1/capture.cager bytes=20- \"v1\"");
}

#[tokio::test]
async fn a_download_is_never_patched_together_from_two_versions() {
    for (tag, status) in [("\"v2\"", 200), ("\"v2\"", 206), ("W/\"v1\"", 200), ("\"v1\"", 206)] {
        let (address, _) = scripted(completed(9), move |number, mut exchange| async move {
            if number == 0 {
                exchange.begin_sized(200, &[("etag", "\"v1\"")], CONTAINER.len()).await;
                return exchange.raw(&CONTAINER[..10]).await;
            }
            // The last case has the right version, but another range.
            exchange.reply(status, &[("etag", tag), ("content-range", "bytes 5-35/36")], &CONTAINER[5..]).await;
        })
        .await;
        let error = client(&address).download(ID, &mut Vec::new()).await.expect_err("another version");
        assert!(matches!(error, ClientError::Protocol(_)), "{tag} {status}: {error}");
    }
}

#[tokio::test]
async fn a_full_disk_ends_a_download() {
    struct Full;
    impl std::io::Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let (address, log) =
        scripted(completed(9), |_, exchange| async move { exchange.reply(200, &[], CONTAINER).await }).await;
    let error = client(&address).download(ID, &mut Full).await.expect_err("full");
    assert!(matches!(error, ClientError::Output(_)), "{error}");
    assert_eq!(log.lock().expect("no panic").len(), 1);
}
