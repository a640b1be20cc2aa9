//! Power cuts at any operation of the disk: what was answered is there afterwards.

use crate::capture::Reference;
use crate::faults::{Fault, Loss};
use crate::inside::Inside;
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
