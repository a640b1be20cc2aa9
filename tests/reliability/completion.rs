//! Completions and creations that fail: they leave nothing that counts, and nothing that changes what comes after them.

use crate::capture::Reference;
use crate::faults::{Fault, Loss, Op};
use crate::inside::Inside;
use crate::process::HANG;
use cager_client::messages::{Session, SessionOptions};
use std::sync::LazyLock;
use std::time::Duration;

const BROKEN: Fault = Fault::Error(5);

/// Frames of a group of [`LONG`].
const GROUP: u32 = 256;

/// More than one group, the last one short.
static LONG: LazyLock<Reference> = LazyLock::new(|| Reference::new(200, 32, 300));
static SMALL: LazyLock<Reference> = LazyLock::new(|| Reference::new(300, 40, 60));

async fn coded(inside: &Inside, name: &str, options: &SessionOptions) -> Session {
    let mut new = LONG.session(name, None);
    new.options = SessionOptions { name: Some(name.to_owned()), ..options.clone() };
    let session = inside.client().create(&new).await.expect("a session");
    inside.client().wait_ready(&session.id, HANG).await.expect("a session that is ready")
}

async fn container(inside: &Inside, id: &str) -> Vec<u8> {
    let mut container = Vec::new();
    inside.client().download(id, &mut container).await.expect("the container");
    container
}

/// What goes wrong with the first completion.
#[derive(Clone, Copy, Debug, PartialEq)]
enum First {
    Nothing,
    /// The container does not get into its place.
    Refused,
    /// The process ends before it does.
    Stopped,
}

/// Posts the first frames and completes with these, which goes wrong; then posts the others and completes with all.
async fn completed(inside: &mut Inside, id: &str, frames: u32, first: First) -> Vec<u8> {
    inside.post(id, 0, LONG.many(0..frames)).await;
    while inside.client().session(id).await.expect("it").coding.expect("it is coded").frames < frames / GROUP * GROUP {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let before = inside.names(&format!("sessions/{id}"));
    // After the last group.
    let fault = if first == First::Stopped { Fault::Stop } else { BROKEN };
    if first != First::Nothing {
        inside.disk.fail(Some(Op::Rename), 2, fault);
        inside.impatient().complete(id, frames).await.expect_err("the disk refuses");
    }
    if first == First::Stopped {
        inside.restart(Loss::Nothing).await;
        inside.client().wait_ready(id, HANG).await.expect("ready");
    }
    inside.disk.disarm();
    inside.client().errors(id).await.expect("errors");
    let left = inside.names(&format!("sessions/{id}"));
    let new: Vec<&String> = left.iter().filter(|name| !before.contains(name)).collect();
    assert!(new.is_empty(), "{new:?} is left");
    let posted = inside.post(id, frames, LONG.many(frames..300)).await;
    assert_eq!(posted.problem, None, "what has not come can still come");
    inside.client().complete(id, 300).await.expect("a completion");
    container(inside, id).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_failed_completion_of_coded_frames_leaves_no_group_behind() {
    let bound = SessionOptions { max_error: Some(1e-3), ..SessionOptions::default() };
    let size = SessionOptions { target_size: Some(60_000), frames: Some(300), ..SessionOptions::default() };
    for (what, options) in [("bound", bound), ("size", size)] {
        let mut inside = Inside::new().await;
        let id = coded(&inside, "whole", &options).await.id;
        let expected = completed(&mut inside, &id, 270, First::Nothing).await;
        for (frames, first) in [(100, First::Refused), (270, First::Refused), (270, First::Stopped)] {
            let id = coded(&inside, &format!("{frames} {first:?}"), &options).await.id;
            let found = completed(&mut inside, &id, frames, first).await;
            assert!(found == expected, "{what}: other bytes after a completion with {frames} frames, {first:?}");
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_completed_session_keeps_its_last_group_through_restarts_and_damage() {
    let mut inside = Inside::new().await;
    let options = SessionOptions { max_error: Some(1e-3), ..SessionOptions::default() };
    let id = coded(&inside, "kept", &options).await.id;
    inside.post(&id, 0, LONG.many(0..300)).await;
    inside.client().complete(&id, 300).await.expect("a completion");
    let expected = container(&inside, &id).await;
    inside.restart(Loss::Everything).await;
    assert!(container(&inside, &id).await == expected);
    // A damaged container is written again from the groups, also where its mark is damaged.
    for what in ["container", "mark"] {
        let path = inside.folder("sessions").join(&id).join("capture.cager");
        let bytes = std::fs::read(&path).expect("a container");
        match what {
            "container" => std::fs::write(&path, &bytes[..bytes.len() / 2]).expect("a container"),
            _ => inside.disk.sql("UPDATE records SET completion = substr(completion, 1, 40)"),
        }
        inside.restart(Loss::Nothing).await;
        inside.client().complete(&id, 300).await.expect("a completion");
        assert!(container(&inside, &id).await == expected, "{what}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_container_counts_as_long_as_it_is_there() {
    let inside = Inside::new().await;
    let session = inside.ready(&SMALL, "counted").await;
    inside.post(&session.id, 0, SMALL.many(0..SMALL.count())).await;
    let before = inside.counted_bytes().await;
    // Of the container, of the mark of completion, and of both.
    for (op, nth) in
        [(Op::Rename, 1), (Op::Change, 1), (Op::Create, 1), (Op::Write, 1), (Op::Sync, 1), (Op::SyncDir, 1)]
    {
        inside.disk.fail(Some(op), nth, BROKEN);
        let completed = inside.impatient().complete(&session.id, SMALL.count()).await;
        inside.disk.disarm();
        completed.expect_err("the disk refuses");
        let there = inside.names(&format!("sessions/{}", session.id)).contains(&"capture.cager".to_owned());
        let container = if there { SMALL.container.len() as u64 } else { 0 };
        assert_eq!(inside.counted_bytes().await - before, container, "{op:?} {nth}");
    }
    inside.client().complete(&session.id, SMALL.count()).await.expect("a completion");
    assert_eq!(inside.counted_bytes().await - before, container(&inside, &session.id).await.len() as u64);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn content_of_a_session_that_could_not_be_created_takes_no_space() {
    let inside = Inside::new().await;
    // The content has three files in a folder; the session comes after it.
    for (op, nth) in [
        (Op::CreateDir, 2),
        (Op::Change, 1),
        (Op::Answer, 1),
        (Op::Change, 2),
        (Op::Answer, 2),
        (Op::Rename, 2),
        (Op::SyncDir, 4),
    ] {
        inside.disk.fail(Some(op), nth, BROKEN);
        let made = inside.impatient().create(&SMALL.session(&format!("{op:?}-{nth}"), None)).await;
        inside.disk.disarm();
        made.expect_err("the disk refuses");
        for folder in ["sessions", "contents"] {
            assert!(inside.names(folder).is_empty(), "{op:?} {nth}: {folder}");
        }
        assert_eq!(inside.counted_bytes().await, 0, "{op:?} {nth}");
    }
    // Content that another session uses stays.
    let session = inside.ready(&SMALL, "first").await;
    inside.disk.fail(Some(Op::CreateDir), 1, BROKEN);
    inside.impatient().create(&SMALL.session("second", None)).await.expect_err("the disk refuses");
    inside.disk.disarm();
    assert_eq!(inside.names("contents").len(), 1);
    inside.finish(&SMALL, &session).await;
}
