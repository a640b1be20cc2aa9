//! A service that is killed again and again while clients of every kind use it. `make soak` kills it a hundred times.

mod faults;
mod ledger;
mod posts;
mod workers;

use crate::capture::Reference;
use crate::process::{Door, HANG, Server, Setup};
use fastrand::Rng;
use ledger::{Ledger, PHASES, Phase};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::time::timeout;
use workers::{Style, Worker};

/// Longest time until a restarted service is ready.
const READY: Duration = Duration::from_secs(2);

/// Sessions that are checked after each kill; after the last one, all are.
const CHECKED: usize = 30;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name} is no number: {text}")))
}

/// `CAGER_SOAK_KILLS` and `CAGER_SOAK_SEED` change how often and when. With `CAGER_TEST_CATALOG=postgres` the database is killed as well.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_service_that_is_killed_keeps_what_it_said() {
    let kills = number("CAGER_SOAK_KILLS").unwrap_or(8);
    let seed = number("CAGER_SOAK_SEED").unwrap_or_else(|| fastrand::u64(..));
    println!("soak: {kills} kills, CAGER_SOAK_SEED={seed}");
    soak(kills, seed).await;
}

/// Waits until a service whose database was away is ready.
async fn within_ready(server: &Server) {
    let clock = Instant::now();
    while server.get("/readyz").await != Some(200) {
        assert!(clock.elapsed() < HANG, "it is not ready although its database is back");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

async fn soak(kills: u64, seed: u64) {
    let clock = Instant::now();
    let mut rng = Rng::with_seed(seed);
    let (small, large) = (Arc::new(Reference::new(400, 48, 200)), Arc::new(Reference::new(3000, 120, 30)));
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    let mut setup = Setup::new(&data, &[]);
    let mut server = setup.start().await;
    // From now on it comes back at the same place.
    setup.listen = server.address;
    let ledger = Arc::new(Ledger::default());
    let stop = Arc::new(AtomicBool::new(false));
    let styles = [
        (Style::Client, &small),
        (Style::ClientHandles, &small),
        (Style::Raw, &small),
        (Style::Records, &large),
        (Style::Churn, &large),
    ];
    let workers: Vec<_> = styles
        .map(|(style, reference)| {
            let worker = Worker {
                style,
                door: Door::clone(&server),
                reference: Arc::clone(reference),
                ledger: Arc::clone(&ledger),
                stop: Arc::clone(&stop),
                rng: rng.fork(),
            };
            tokio::spawn(worker.run())
        })
        .into_iter()
        .collect();

    let mut slowest = Duration::ZERO;
    let mut during = BTreeMap::<Phase, u64>::new();
    let mut faults = faults::Done::new();
    for kill in 0..kills {
        // Every phase is waited for in turn; a moment later the process ends.
        let phase = PHASES[kill as usize % PHASES.len()];
        let _ = timeout(Duration::from_millis(1500), ledger.entered(phase)).await;
        let longest = if phase == Phase::Upload { 200_000 } else { 20_000 };
        tokio::time::sleep(Duration::from_micros(rng.u64(..longest))).await;
        ledger.active().for_each(|phase| *during.entry(phase).or_default() += 1);
        match &setup.database {
            // The database alone, and the service lives on.
            Some(database) if kill % 4 == 3 => {
                database.kill();
                database.run();
                within_ready(&server).await;
            }
            database => {
                server.kill();
                match database {
                    // Both.
                    Some(database) if kill % 4 == 1 => {
                        database.kill();
                        database.run();
                    }
                    None if kill % 4 == 1 => faults::check(&data, &ledger, &mut rng, &mut faults).await,
                    _ => {}
                }
                server = setup.start().await;
                slowest = slowest.max(server.ready);
                if server.ready > READY {
                    ledger.violation(format!("it took {:?} to be ready", server.ready));
                }
            }
        }
        ledger.check_some(&server, None, CHECKED).await;
        let aside = std::fs::read_dir(data.join("quarantine")).expect("quarantine").count();
        if aside > 0 {
            ledger.violation(format!("{aside} files are in quarantine"));
        }
        let violations = ledger.violations();
        assert!(violations.is_empty(), "after kill {kill} of seed {seed}:\n{}", violations.join("\n"));
    }
    stop.store(true, Ordering::SeqCst);
    for worker in workers {
        timeout(Duration::from_secs(60), worker).await.expect("a worker hangs").expect("a worker");
    }
    ledger.check(&server).await;
    let count = |counter: &std::sync::atomic::AtomicUsize| counter.load(Ordering::Relaxed);
    println!(
        "soak: {kills} kills in {:.1} s, at work then: {during:?}\n\
         soak: {} answers, {} of them and {} cages checked after restarts, {} containers the same, {} sessions deleted\n\
         soak: files that could not be read, were gone or damaged: {faults:?}\n\
         soak: ready after {} ms at most; losses and other violations: {}",
        clock.elapsed().as_secs_f64(),
        count(&ledger.answers),
        count(&ledger.frames_checked),
        count(&ledger.cages_checked),
        count(&ledger.containers),
        count(&ledger.deletions),
        slowest.as_millis(),
        ledger.violations().len(),
    );
    let violations = ledger.violations();
    assert!(violations.is_empty(), "seed {seed}:\n{}", violations.join("\n"));
    assert!(count(&ledger.frames_checked) > 0 && count(&ledger.containers) > 0, "nothing was checked");
}
