//! Disks that are full or broken, seen over HTTP.

use crate::capture::Reference;
use crate::faults::{Fault, Loss, Op};
use crate::inside::Inside;
use crate::process::HANG;
use cager_client::ClientError;
use cager_client::messages::SessionState;
use std::sync::LazyLock;

const FULL: Fault = Fault::Error(28);
const BROKEN: Fault = Fault::Error(5);

static SMALL: LazyLock<Reference> = LazyLock::new(|| Reference::new(300, 40, 120));

fn word(error: &ClientError) -> String {
    error.problem().map(|problem| format!("{} {}", problem.status, problem.word())).unwrap_or_default()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_disk_makes_no_half_of_a_session() {
    let inside = Inside::new().await;
    let mut refused = 0;
    for op in [Op::Create, Op::CreateDir, Op::Write, Op::Sync, Op::Rename, Op::SyncDir] {
        for nth in 1..=6 {
            let wish = SMALL.session(&format!("{op:?}-{nth}"), Some(&format!("{op:?}-{nth}")));
            inside.disk.fail_from(Some(op), nth, FULL);
            let made = inside.impatient().create(&wish).await;
            inside.disk.disarm();
            let session = match made {
                Err(error) => {
                    assert_eq!(word(&error), "507 storage-full", "{op:?} {nth}: {error}");
                    refused += 1;
                    assert!(inside.client().sessions().await.expect("a list").is_empty(), "{op:?} {nth}");
                    assert!(inside.names("sessions").is_empty(), "{op:?} {nth}");
                    // The same wish is granted when there is room.
                    inside.client().create(&wish).await.expect("a session")
                }
                // The fault met what runs after the answer, if anything.
                Ok(session) => session,
            };
            // Preparing may have met it as well; that is over after a restart, and here it is deleted.
            let _ = inside.client().wait_ready(&session.id, HANG).await;
            inside.client().delete(&session.id).await.expect("a deletion");
            assert!(inside.names("contents").is_empty(), "{op:?} {nth}");
        }
    }
    assert!(refused >= 15, "only {refused} creations met the fault");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_go_on_after_a_disk_that_refused() {
    let mut inside = Inside::new().await;
    let faults = [(Op::Change, FULL, 507), (Op::Change, BROKEN, 503), (Op::Answer, BROKEN, 503)];
    for (number, (op, fault, status)) in faults.into_iter().enumerate() {
        for nth in [1, 3, 6] {
            let session = inside.ready(&SMALL, &format!("{number}-{nth}")).await;
            let mut answered = inside.post(&session.id, 0, SMALL.many(0..3)).await.frames;
            assert_eq!(answered.len(), 3);
            inside.disk.fail_from(Some(op), nth, fault);
            let posted = inside.post(&session.id, 3, SMALL.many(3..SMALL.count())).await;
            let what = format!("{op:?} {fault:?} {nth}: {posted:?}");
            match &posted.problem {
                Some(problem) => {
                    assert_eq!(problem.status, status, "{what}");
                    assert!(problem.frame.is_some_and(|frame| frame >= 3), "{what}");
                }
                // All was written before, a few frames at a time.
                None => assert_eq!(posted.frames.len() as u32, SMALL.count() - 3, "{what}"),
            }
            answered.extend(posted.frames);
            // A look at the disk counts for a second.
            let expected = if status == 507 { 507 } else { 503 };
            let clock = std::time::Instant::now();
            let mut ready = inside.status("/readyz").await;
            while ready == 200 && clock.elapsed().as_secs() < 5 {
                tokio::time::sleep(std::time::Duration::from_millis(50)).await;
                ready = inside.status("/readyz").await;
            }
            assert_eq!(ready, expected, "{what}");
            assert_eq!(inside.status("/healthz").await, 200);
            inside.check(&SMALL, &session.id, &answered).await;
            inside.disk.disarm();
            assert_eq!(inside.status("/readyz").await, 200);
            inside.check(&SMALL, &session.id, &answered).await;
            if nth == 3 {
                // What was stored without an answer is found.
                let last = SMALL.count() - 1;
                answered.extend(inside.post(&session.id, last, SMALL.bytes(last)).await.frames);
                assert!(answered.contains_key(&last), "{what}");
                inside.restart(if number % 2 == 0 { Loss::Everything } else { Loss::Torn(number as u64) }).await;
                inside.check(&SMALL, &session.id, &answered).await;
            }
            inside.finish(&SMALL, &session).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn short_writes_are_gone_on_with() {
    let inside = Inside::new().await;
    inside.disk.fail_from(Some(Op::Write), 2, Fault::Short);
    let session = inside.ready(&SMALL, "short").await;
    inside.finish(&SMALL, &session).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_completion_that_fails_can_be_repeated() {
    let mut inside = Inside::new().await;
    let session = inside.ready(&SMALL, "complete").await;
    let posted = inside.post(&session.id, 0, SMALL.many(0..SMALL.count())).await;
    assert_eq!(posted.frames.len() as u32, SMALL.count());
    let faults = [(Op::Rename, 1), (Op::Change, 1), (Op::Create, 1), (Op::Write, 1), (Op::Sync, 1), (Op::SyncDir, 1)];
    for (op, nth) in faults {
        for (fault, expected) in [(FULL, "507 storage-full"), (BROKEN, "503 storage-failed")] {
            inside.disk.fail(Some(op), nth, fault);
            let error = inside.impatient().complete(&session.id, SMALL.count()).await.expect_err("the disk refuses");
            assert_eq!(word(&error), expected, "{op:?} {nth}: {error}");
            inside.disk.disarm();
            let now = inside.client().session(&session.id).await.expect("the session");
            assert_eq!(now.state, SessionState::Ready, "{op:?} {nth}");
            let container = inside.status(&format!("/v1/sessions/{}/capture.cager", session.id)).await;
            assert_eq!(container, 409, "{op:?} {nth}");
        }
        // Frames are known as before, and what has not come can still come.
        assert_eq!(inside.post(&session.id, 5, SMALL.bytes(5)).await.frames.len(), 1);
    }
    inside.restart(Loss::Everything).await;
    inside.finish(&SMALL, &session).await;
    inside.restart(Loss::Everything).await;
    let now = inside.client().session(&session.id).await.expect("the session");
    assert_eq!(now.state, SessionState::Completed);
    inside.check_container(&SMALL, &session.id).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_deletion_that_fails_leaves_the_session_whole() {
    let inside = Inside::new().await;
    let session = inside.ready(&SMALL, "delete").await;
    let posted = inside.post(&session.id, 0, SMALL.many(0..50)).await;
    inside.disk.fail(Some(Op::Change), 1, BROKEN);
    let error = inside.impatient().delete(&session.id).await.expect_err("the disk refuses");
    assert_eq!(word(&error), "503 storage-failed");
    inside.check(&SMALL, &session.id, &posted.frames).await;
    inside.finish(&SMALL, &session).await;
    inside.client().delete(&session.id).await.expect("a deletion");
    for folder in ["sessions", "contents", "tmp", "trash"] {
        assert!(inside.names(folder).is_empty(), "{folder}: {:?}", inside.names(folder));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn frames_answered_after_a_completion_that_failed_are_there_after_a_restart() {
    for (loss, mended) in [(Loss::Nothing, false), (Loss::Everything, false), (Loss::Everything, true)] {
        let mut inside = Inside::new().await;
        let session = inside.ready(&SMALL, "unsettled").await;
        let mut answered = inside.post(&session.id, 0, SMALL.many(0..40)).await.frames;
        // The container is put in place; whether the mark of completion is, nobody can say.
        inside.disk.fail_from(Some(Op::Answer), 1, Fault::Mute(5));
        inside.impatient().complete(&session.id, 40).await.expect_err("the disk refuses");
        let posted = inside.post(&session.id, 40, SMALL.many(40..50)).await;
        answered.extend(posted.frames);
        if mended {
            inside.disk.disarm();
            let posted = inside.post(&session.id, 40, SMALL.many(40..50)).await;
            assert_eq!(posted.problem.map(|problem| problem.status), Some(409));
            answered.extend(posted.frames);
            inside.impatient().complete(&session.id, 40).await.expect("it is completed");
        }
        inside.restart(loss).await;
        inside.check(&SMALL, &session.id, &answered).await;
        let now = inside.client().session(&session.id).await.expect("the session");
        assert_eq!(now.state, SessionState::Completed, "{loss:?}, mended: {mended}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_frame_that_was_stored_without_an_answer_is_none_to_another_of_its_number() {
    let mut inside = Inside::new().await;
    let session = inside.ready(&SMALL, "adopted").await;
    let mut answered = inside.post(&session.id, 0, SMALL.many(0..3)).await.frames;
    inside.disk.fail(Some(Op::Answer), 1, BROKEN);
    let posted = inside.post(&session.id, 3, SMALL.bytes(3)).await;
    assert!(posted.frames.is_empty() && posted.problem.is_some(), "{posted:?}");
    inside.disk.disarm();
    let posted = inside.post(&session.id, 3, SMALL.bytes(7)).await;
    assert!(posted.frames.is_empty(), "another frame's result is told: {posted:?}");
    assert_eq!(posted.problem.expect("a refusal").word(), "frame-conflict");
    answered.extend(inside.post(&session.id, 3, SMALL.bytes(3)).await.frames);
    assert!(answered.contains_key(&3));
    inside.restart(Loss::Everything).await;
    inside.check(&SMALL, &session.id, &answered).await;
    inside.finish(&SMALL, &session).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_waits_for_room_on_the_disk() {
    let inside = Inside::new().await;
    let session = inside.ready(&SMALL, "exported").await;
    inside.finish(&SMALL, &session).await;
    let path = format!("/v1/sessions/{}/export?format=npy", session.id);
    inside.disk.set_free_bytes(Some(1 << 16));
    assert_eq!(inside.status(&path).await, 507);
    inside.disk.set_free_bytes(None);
    assert_eq!(inside.status(&path).await, 200);
}
