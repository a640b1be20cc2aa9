//! Uploads over connections that break.

mod support;

use cager_client::messages::{FrameResult, SessionState};
use cager_client::{Client, ClientError, FnFrames, MemoryFrames, Rows, UploadOptions, Uploaded};
use proptest::prelude::*;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use support::client;
use support::service::{Fault, HANDLES, POINTS, Service, capture, frame, frame_bytes, session};

/// Uploads as many frames; returns also the frames that were reported, as they came.
async fn upload(client: &Client, frames: u32) -> (Result<Uploaded, ClientError>, Vec<u32>) {
    upload_over(1, client, frames).await
}

async fn upload_over(connections: usize, client: &Client, frames: u32) -> (Result<Uploaded, ClientError>, Vec<u32>) {
    let mut reported = Vec::new();
    let mut on_frame = |result: FrameResult| reported.push(result.frame);
    let options = UploadOptions { on_frame: Some(&mut on_frame), connections, ..UploadOptions::default() };
    let source = MemoryFrames::new(POINTS as usize, capture(frames));
    let uploaded = client.upload(&session(SessionState::Ready), source, options).await;
    (uploaded, reported)
}

fn assert_whole(service: &Service, frames: u32) {
    let state = service.state();
    assert_eq!(state.solved.keys().copied().collect::<Vec<_>>(), (0..frames).collect::<Vec<_>>());
    for (&number, bytes) in &state.solved {
        assert_eq!(*bytes, frame_bytes(number), "frame {number}");
    }
}

fn assert_each_once(mut reported: Vec<u32>, frames: u32) {
    reported.sort_unstable();
    assert_eq!(reported, (0..frames).collect::<Vec<_>>());
}

#[tokio::test]
async fn an_undisturbed_upload_is_one_request() {
    let (service, address) = Service::start([]).await;
    let (uploaded, reported) = upload(&client(&address), 300).await;
    let uploaded = uploaded.expect("an upload");
    assert_eq!(uploaded, Uploaded { frames: 300, sent_bytes: 300 * (28 + 12 * u64::from(POINTS)), retries: 0 });
    assert_eq!(service.posts().len(), 1);
    assert_whole(&service, 300);
    assert_each_once(reported, 300);
}

#[tokio::test]
async fn several_connections_share_the_frames() {
    let (service, address) = Service::start([]).await;
    let frames = 20_000;
    let (uploaded, reported) = upload_over(4, &client(&address), frames).await;
    assert_eq!(uploaded.expect("an upload").retries, 0);
    assert_eq!((service.posts().len(), service.state().posted_frames), (4, frames as usize));
    assert_whole(&service, frames);
    assert_each_once(reported, frames);
}

#[tokio::test]
async fn a_cut_connection_costs_only_what_was_on_its_way() {
    let (service, address) = Service::start([Fault::Cut(7), Fault::Cut(0), Fault::Cut(90)]).await;
    let (uploaded, reported) = upload(&client(&address), 200).await;
    assert_eq!(uploaded.expect("an upload").retries, 3);
    assert_eq!(service.state().posted_frames, 200, "nothing that was solved is sent again");
    assert_whole(&service, 200);
    assert_each_once(reported, 200);
}

#[tokio::test]
async fn results_that_went_astray_are_reported_all_the_same() {
    let (service, address) = Service::start([Fault::LoseResults(40)]).await;
    let (uploaded, reported) = upload(&client(&address), 50).await;
    uploaded.expect("an upload");
    assert_whole(&service, 50);
    assert_each_once(reported, 50);
}

#[tokio::test]
async fn an_answer_that_ends_early_or_within_a_line_is_no_end() {
    let (service, address) = Service::start([Fault::End(3), Fault::HalfLine(2), Fault::End(0)]).await;
    let (uploaded, reported) = upload(&client(&address), 20).await;
    uploaded.expect("an upload");
    assert_whole(&service, 20);
    assert_each_once(reported, 20);
}

#[tokio::test]
async fn a_busy_service_is_left_alone_as_long_as_it_asks() {
    let (service, address) = Service::start([Fault::Refuse(503, "busy", Some("1"))]).await;
    let clock = Instant::now();
    upload(&client(&address), 20).await.0.expect("an upload");
    assert!(clock.elapsed() >= Duration::from_secs(1));
    assert_whole(&service, 20);
}

#[tokio::test]
async fn a_refusal_is_told_even_if_the_connection_breaks_over_it() {
    // Much more than the connection's buffers hold: the server closes while the client writes.
    let frames = 20_000;
    let faults = std::iter::repeat_n(Fault::Refuse(413, "too-large", None), 5);
    let (_, address) = Service::start(faults).await;
    let error = upload(&client(&address), frames).await.0.expect_err("too large");
    let ClientError::Refused(problem) = error else { panic!("{error}") };
    assert_eq!((problem.status, problem.word()), (413, "too-large"));
}

#[tokio::test]
async fn a_proxy_that_limits_bodies_gets_fewer_frames_at_a_time() {
    // A record of a frame has 88 bytes.
    for (limit, frames) in [(1 << 20, 60_000), (1000, 300), (88, 9)] {
        for connections in [1, 3] {
            let (service, address) = Service::start([Fault::Limit(limit)]).await;
            let (uploaded, reported) = upload_over(connections, &client(&address), frames).await;
            assert_eq!(uploaded.expect("an upload").retries, 0, "no failure");
            assert_whole(&service, frames);
            assert_each_once(reported, frames);
            let posts = service.posts().len();
            // What worked is kept: not each request begins with too much.
            let at_best = (frames as usize * 88).div_ceil(limit);
            assert!(posts <= 4 * at_best + 20, "{posts} requests where {at_best} do");
        }
    }
}

#[tokio::test]
async fn a_capture_of_unknown_length_passes_a_limit_too() {
    let (service, address) = Service::start([Fault::Limit(400)]).await;
    let source = FnFrames::new(POINTS as usize, None, |number, into: &mut Vec<f32>| {
        into.clone_from(&frame(number));
        Ok(number < 64)
    });
    let uploaded = client(&address).upload(&session(SessionState::Ready), source, UploadOptions::default()).await;
    assert_eq!(uploaded.expect("an upload").frames, 64);
    assert_whole(&service, 64);
}

#[tokio::test]
async fn a_limit_below_a_single_frame_is_told_with_what_to_raise() {
    let (service, address) = Service::start([Fault::Limit(50)]).await;
    let error = upload(&client(&address), 300).await.0.expect_err("no frame passes");
    assert!(error.is_body_limit() && error.status() == Some(413), "{error}");
    let said = error.to_string();
    assert!(said.starts_with("a single frame of 60 bytes is too much: a proxy before the service"), "{said}");
    assert!(said.contains("client_max_body_size") && said.contains("413 Request Entity Too Large nginx"), "{said}");
    assert!(service.posts().len() < 15, "{} requests", service.posts().len());
}

#[tokio::test]
async fn a_bad_frame_is_named_and_those_before_it_are_solved() {
    let (service, address) = Service::start([Fault::Problem(6, 422), Fault::Problem(0, 422)]).await;
    let (uploaded, reported) = upload(&client(&address), 20).await;
    assert_eq!(uploaded.expect_err("a bad frame").status(), Some(422));
    assert_eq!(service.state().solved.len(), 6);
    assert_each_once(reported, 6);
}

#[tokio::test]
async fn a_proxys_page_is_reported_in_its_words() {
    let (_, address) = Service::start([Fault::Page(403)]).await;
    let error = upload(&client(&address), 3).await.0.expect_err("forbidden");
    assert!(matches!(&error, ClientError::Refused(p) if p.status == 403), "{error}");
    assert!(error.to_string().contains("Gateway sorry"), "{error}");
}

#[tokio::test]
async fn a_proxy_without_its_server_is_asked_again() {
    let (service, address) = Service::start([Fault::Page(502), Fault::Page(504)]).await;
    upload(&client(&address), 9).await.0.expect("an upload");
    assert_whole(&service, 9);
}

#[tokio::test]
async fn it_gives_up_without_progress_but_not_with_it() {
    let (service, address) = Service::start(std::iter::repeat_n(Fault::Cut(1), 10)).await;
    assert_eq!(upload(&client(&address), 12).await.0.expect("slow but sure").retries, 10);
    assert_whole(&service, 12);

    let (_, address) = Service::start(std::iter::repeat_n(Fault::Cut(0), 50)).await;
    let error = upload(&client(&address), 12).await.0.expect_err("no progress");
    assert!(matches!(error, ClientError::GaveUp { attempts: 5, .. }), "{error}");
}

#[tokio::test]
async fn answers_of_another_kind_of_server_end_the_upload() {
    for fault in [Fault::Garbage, Fault::Endless] {
        let (_, address) = Service::start([fault]).await;
        let error = upload(&client(&address), 12).await.0.expect_err("no such service");
        assert!(matches!(error, ClientError::Protocol(_)), "{error}");
    }
}

#[tokio::test]
async fn a_service_that_falls_silent_is_asked_again() {
    let (service, address) = Service::start([Fault::Silence]).await;
    upload(&client(&address), 12).await.0.expect("an upload");
    assert_whole(&service, 12);
}

#[tokio::test]
async fn where_a_proxy_carries_one_direction_at_a_time_results_come_after_each_request() {
    let (service, address) = Service::start([Fault::OneWay(7)]).await;
    let client = client(&address);
    let (uploaded, reported) = upload(&client, 200).await;
    assert_eq!(uploaded.expect("an upload").retries, 1);
    assert_whole(&service, 200);
    assert_each_once(reported, 200);
    let live: Vec<bool> = service.posts().iter().map(|post| post.contains("live=true")).collect();
    assert_eq!(live, [true, false]);
    // What was found out holds for the client's later uploads.
    service.state().solved.clear();
    upload(&client, 3).await.0.expect("an upload");
    assert!(!service.posts()[2].contains("live"), "{:?}", service.posts());
}

#[tokio::test]
async fn where_a_proxy_loses_bytes_of_a_live_request_they_are_sent_again_without() {
    let (service, address) = Service::start([Fault::Problem(6, 422)]).await;
    let client = client(&address);
    assert_eq!(upload(&client, 20).await.0.expect("an upload").retries, 1);
    assert_whole(&service, 20);
    service.state().solved.clear();
    upload(&client, 3).await.0.expect("an upload");
    let live: Vec<bool> = service.posts().iter().map(|post| post.contains("live=true")).collect();
    assert_eq!(live, [true, false, false]);
}

#[tokio::test]
async fn a_source_that_takes_its_time_is_no_standstill() {
    let (service, address) = Service::start([]).await;
    let client = client(&address);
    // Longer than a live request may stand still, and shorter than any may.
    let pause = Duration::from_millis(1400);
    let source = FnFrames::new(POINTS as usize, Some(3), move |number, out| {
        std::thread::sleep(pause);
        out.extend(frame(number));
        Ok(true)
    });
    client.upload(&session(SessionState::Ready), source, UploadOptions::default()).await.expect("an upload");
    assert_eq!(service.posts().len(), 1, "{:?}", service.posts());
}

#[tokio::test]
async fn scattered_gaps_are_filled_by_one_request_and_all_results_reported() {
    let (service, address) = Service::start([]).await;
    for number in [0, 3, 4, 9] {
        service.state().solved.insert(number, frame_bytes(number));
    }
    let (uploaded, reported) = upload(&client(&address), 15).await;
    assert_eq!(uploaded.expect("an upload").frames, 15);
    assert_eq!((service.posts().len(), service.state().posted_frames), (1, 11));
    assert_whole(&service, 15);
    assert_each_once(reported, 15);
}

#[tokio::test]
async fn a_complete_session_needs_no_request() {
    let (service, address) = Service::start([]).await;
    for number in 0..4 {
        service.state().solved.insert(number, frame_bytes(number));
    }
    service.state().completed = Some(4);
    let source = FnFrames::new(POINTS as usize, None, |_, _: &mut Vec<f32>| panic!("nothing is to be read"));
    let uploaded = client(&address).upload(&session(SessionState::Completed), source, UploadOptions::default()).await;
    assert_eq!(uploaded.expect("nothing to do").frames, 4);
    assert!(service.posts().is_empty());
}

#[tokio::test]
async fn handles_alone_are_sent_where_they_are_asked_for() {
    let (service, address) = Service::start([Fault::Cut(3)]).await;
    let options = UploadOptions { rows: Rows::Handles, ..UploadOptions::default() };
    let source = MemoryFrames::new(POINTS as usize, capture(8));
    client(&address).upload(&session(SessionState::Ready), source, options).await.expect("an upload");
    assert!(service.posts().iter().all(|post| post.contains("rows=handles")), "{:?}", service.posts());
    for (&number, bytes) in &service.state().solved {
        let rows = HANDLES.iter().flat_map(|&h| frame(number)[3 * h as usize..][..3].to_vec());
        assert_eq!(*bytes, rows.flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    }
}

#[tokio::test]
async fn frames_of_unknown_number_are_sent_to_their_end() {
    let (service, address) = Service::start([Fault::Cut(5), Fault::LoseResults(25)]).await;
    let source = FnFrames::new(POINTS as usize, None, |number, out| {
        out.extend(frame(number));
        Ok(number < 30)
    });
    let uploaded = client(&address).upload(&session(SessionState::Ready), source, UploadOptions::default()).await;
    assert_eq!(uploaded.expect("an upload").frames, 30);
    assert_whole(&service, 30);
}

#[tokio::test]
async fn frames_of_a_slow_source_have_their_results_before_the_next_is_read() {
    let (_, address) = Service::start([]).await;
    let seen = Arc::new(AtomicU32::new(0));
    let results = Arc::clone(&seen);
    let source = FnFrames::new(POINTS as usize, Some(5), move |number, out| {
        out.extend(frame(number));
        std::thread::sleep(Duration::from_millis(50));
        // The one before may still be on its way.
        let begun = Instant::now();
        while results.load(Ordering::Relaxed) + 1 < number {
            assert!(begun.elapsed() < Duration::from_secs(10), "{number} frames were kept back");
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(true)
    });
    let mut on_frame = |_: FrameResult| _ = seen.fetch_add(1, Ordering::Relaxed);
    let options = UploadOptions { on_frame: Some(&mut on_frame), ..UploadOptions::default() };
    client(&address).upload(&session(SessionState::Ready), source, options).await.expect("an upload");
}

#[tokio::test]
async fn a_frame_that_cannot_be_read_is_named_and_those_before_it_are_solved() {
    let (service, address) = Service::start([]).await;
    let source = FnFrames::new(POINTS as usize, Some(20), |number, out| {
        out.extend(frame(number));
        if number == 7 { Err(io::Error::other("7.obj: line 3 is no vertex")) } else { Ok(true) }
    });
    let error = client(&address).upload(&session(SessionState::Ready), source, UploadOptions::default()).await;
    let error = error.expect_err("a broken source");
    assert!(matches!(error, ClientError::Source { frame: 7, .. }), "{error}");
    assert_eq!(error.to_string(), "7.obj: line 3 is no vertex");
    assert_whole(&service, 7);
}

#[tokio::test]
async fn a_source_that_panics_ends_the_upload() {
    let (_, address) = Service::start([]).await;
    let source = FnFrames::new(POINTS as usize, Some(3), |_, _: &mut Vec<f32>| panic!("on purpose"));
    let error = client(&address).upload(&session(SessionState::Ready), source, UploadOptions::default()).await;
    assert!(matches!(error, Err(ClientError::Source { .. })), "{error:?}");
}

#[tokio::test]
async fn frames_that_do_not_fit_are_refused_before_anything_is_sent() {
    let (service, address) = Service::start([]).await;
    let source = MemoryFrames::new(4, vec![0.0; 24]);
    let error = client(&address).upload(&session(SessionState::Ready), source, UploadOptions::default()).await;
    assert!(matches!(error, Err(ClientError::Mismatch(_))), "{error:?}");
    let source = FnFrames::new(POINTS as usize, Some(3), |_, out| {
        out.extend([1.0; 14]);
        Ok(true)
    });
    let error = client(&address).upload(&session(SessionState::Ready), source, UploadOptions::default()).await;
    assert!(matches!(error, Err(ClientError::Mismatch(_))), "{error:?}");
    assert!(service.state().solved.is_empty());
}

fn faults() -> impl Strategy<Value = Vec<Fault>> {
    let one = prop_oneof![
        (0..60_usize).prop_map(Fault::Cut),
        (0..60_usize).prop_map(Fault::LoseResults),
        (0..60_usize).prop_map(Fault::End),
        (0..60_usize).prop_map(Fault::HalfLine),
        Just(Fault::Refuse(503, "busy", None)),
        Just(Fault::Page(502)),
    ];
    // As many as the client's patience without any progress.
    prop::collection::vec(one, 0..=4)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn whatever_breaks_every_frame_arrives_and_is_reported_once(
        faults in faults(),
        frames in 1..80_u32,
        connections in 1..4_usize,
        there in prop::collection::btree_set(0..80_u32, 0..20),
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        runtime.block_on(async {
            let (service, address) = Service::start(faults).await;
            for number in there.into_iter().filter(|&number| number < frames) {
                service.state().solved.insert(number, frame_bytes(number));
            }
            let (uploaded, reported) = upload_over(connections, &client(&address), frames).await;
            assert_eq!(uploaded.expect("an upload").frames, frames);
            assert_whole(&service, frames);
            assert_each_once(reported, frames);
        });
    }
}
