//! Power cuts at any operation of the disk: what was answered is there afterwards.

use crate::capture::Reference;
use crate::faults::{Fault, Loss};
use crate::inside::Inside;
use crate::process::HANG;
use fastrand::Rng;
use std::collections::BTreeMap;
use std::sync::LazyLock;

static SMALL: LazyLock<Reference> = LazyLock::new(|| Reference::new(300, 40, 90));

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_power_cut_loses_no_answered_frame() {
    let seed = fastrand::u64(..);
    println!("seed {seed}");
    let mut rng = Rng::with_seed(seed);
    let mut inside = Inside::new().await;
    for round in 0..4 {
        let name = format!("round-{round}");
        let mut session = inside.ready(&SMALL, &name).await;
        let mut answered = BTreeMap::new();
        for cut in 0..6 {
            inside.disk.fail(None, rng.u64(1..60), Fault::Stop);
            // Three uploads at once, which have some frames in common.
            let part = SMALL.count() / 3;
            let uploads = (0..3).map(|k| {
                let (first, end) = (k * part, ((k + 1) * part + 5).min(SMALL.count()));
                inside.post(&session.id, first, SMALL.many(first..end))
            });
            for posted in futures_util::future::join_all(uploads).await {
                assert!(matches!(posted.status, 200 | 503), "seed {seed}: {posted:?}");
                answered.extend(posted.frames);
            }
            let loss = [Loss::Nothing, Loss::Everything, Loss::Torn(rng.u64(..))][rng.usize(..3)];
            inside.restart(loss).await;
            println!("round {round} cut {cut}: {} answered, {loss:?}", answered.len());
            // The session was answered too, so the same wish finds it.
            let again = inside.ready(&SMALL, &name).await;
            assert_eq!(again.id, session.id, "seed {seed}: it was made again");
            session = again;
            inside.check(&SMALL, &session.id, &answered).await;
            assert!(inside.names("quarantine").is_empty(), "seed {seed}: {:?}", inside.names("quarantine"));
        }
        inside.finish(&SMALL, &session).await;
        inside.restart(Loss::Everything).await;
        inside.check_container(&SMALL, &session.id).await;
    }
}

static LONG: LazyLock<Reference> = LazyLock::new(|| Reference::new(120, 24, 300));

/// More than a group of frames that are coded, so that they wait on disk, are coded and completed between cuts.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_power_cut_loses_no_frame_that_waits_to_be_coded() {
    let seed = fastrand::u64(..);
    println!("seed {seed}");
    let mut rng = Rng::with_seed(seed);
    let mut inside = Inside::new().await;
    let coded = |name: &str| {
        let mut new = LONG.session(name, None);
        new.options.quality = Some("standard".to_owned());
        new
    };
    let mut expected = Vec::new();
    for name in ["undisturbed", "first", "second"] {
        let cuts = if name == "undisturbed" { 0 } else { 6 };
        let created = inside.client().create(&coded(name)).await.expect("a session").id;
        inside.client().wait_ready(&created, HANG).await.expect("ready");
        for cut in 0..cuts {
            inside.disk.fail(None, rng.u64(1..40), Fault::Stop);
            let (first, end) = (50 * cut, (50 * (cut + 1)).min(LONG.count()));
            let posted = inside.post(&created, first, LONG.many(first..end)).await;
            assert!(matches!(posted.status, 200 | 503), "seed {seed}: {posted:?}");
            if cut + 1 == cuts {
                // The cut may come while the last group is coded, or the container written.
                inside.disk.fail(None, rng.u64(1..40), Fault::Stop);
                let _ = inside.post(&created, 0, LONG.many(0..LONG.count())).await;
                let _ = inside.impatient().complete(&created, LONG.count()).await;
            }
            let loss = [Loss::Nothing, Loss::Everything, Loss::Torn(rng.u64(..))][rng.usize(..3)];
            inside.restart(loss).await;
            inside.client().wait_ready(&created, HANG).await.expect("ready");
            let session = inside.client().session(&created).await.expect("the session");
            println!("{name} cut {cut}: {:?}, {loss:?}", session.coding);
            assert!(inside.names("quarantine").is_empty(), "seed {seed}: {:?}", inside.names("quarantine"));
        }
        inside.post(&created, 0, LONG.many(0..LONG.count())).await;
        inside.client().complete(&created, LONG.count()).await.expect("complete");
        let mut container = Vec::new();
        inside.client().download(&created, &mut container).await.expect("the container");
        if name == "undisturbed" {
            expected = container;
        } else {
            assert!(container == expected, "seed {seed}: {name} has another container");
        }
    }
}
