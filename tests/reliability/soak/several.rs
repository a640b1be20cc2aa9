//! Several processes on one database and one bucket, of which any may answer, while they, the database and the bucket are killed and connections are cut.

use super::ledger::Ledger;
use super::number;
use super::relay::Relay;
use super::workers::{Style, Worker};
use crate::capture::Reference;
use crate::database::Database;
use crate::overload::entry;
use crate::process::{Door, HANG, Server, Setup};
use fastrand::Rng;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::time::{sleep, timeout};

const PROCESSES: usize = 3;
const TENANTS: [&str; 4] = ["east", "north", "south", "west"];
/// Longest time until the tenants of a process that was killed are answered by others. Half a second is usual; the bucket may just have been killed too, and
/// the machine be busy.
const TAKEN_OVER: Duration = Duration::from_secs(5);
/// Sessions of each tenant that are checked after each kill; after the last one, all are.
const CHECKED: usize = 8;

fn token(tenant: &str) -> String {
    format!("{tenant}-{tenant}-{tenant}-{tenant}")
}

/// `CAGER_SOAK_KILLS` and `CAGER_SOAK_SEED` change how often and when.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn several_processes_keep_what_any_of_them_said() {
    let Some(database) = Database::with_bucket() else { return };
    let kills = number("CAGER_SOAK_KILLS").unwrap_or(6);
    let seed = number("CAGER_SOAK_SEED").unwrap_or_else(|| fastrand::u64(..));
    println!("soak: {PROCESSES} processes, {kills} kills, CAGER_SOAK_SEED={seed}");
    soak(&database, kills, seed).await;
}

/// Waits until all tenants are answered; gives how long that took.
async fn answered(doors: &[Door]) -> Duration {
    let clock = Instant::now();
    for door in doors {
        while !matches!(timeout(HANG, door.get("/v1/sessions")).await, Ok(Some(200))) {
            assert!(clock.elapsed() < 3 * HANG, "{:?} is not answered", door.token);
            sleep(Duration::from_millis(5)).await;
        }
    }
    clock.elapsed()
}

async fn soak(database: &Database, kills: u64, seed: u64) {
    let clock = Instant::now();
    let mut rng = Rng::with_seed(seed);
    let (small, large) = (Arc::new(Reference::new(400, 48, 200)), Arc::new(Reference::new(3000, 120, 30)));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("tokens.toml");
    std::fs::write(&file, TENANTS.map(|tenant| entry(tenant, &token(tenant))).concat()).expect("tokens");
    let mut setups = Vec::new();
    let mut servers: Vec<Option<Server>> = Vec::new();
    for k in 0..PROCESSES {
        let mut setup = Setup::new(&folder.path().join(format!("data-{k}")), &["shards=6"]);
        setup.tokens = Some(file.clone());
        setup.database = Some(database.clone());
        servers.push(Some(setup.start().await));
        setups.push(setup);
    }
    let addresses = servers.iter().flatten().map(|server| server.address).collect();
    let relay = Relay::start(addresses, rng.fork()).await;
    let stop = Arc::new(AtomicBool::new(false));
    let door = |tenant: &str| Door { address: relay.address, token: Some(token(tenant)) };
    let doors = TENANTS.map(door);
    let ledgers = TENANTS.map(|_| Arc::new(Ledger::default()));
    let mut workers = Vec::new();
    let styles = [Style::Client, Style::Raw, Style::Records, Style::Churn, Style::ClientHandles];
    for (k, style) in styles.into_iter().enumerate() {
        let worker = Worker {
            style,
            door: doors[k % TENANTS.len()].clone(),
            reference: Arc::clone(if k % 2 == 0 { &small } else { &large }),
            ledger: Arc::clone(&ledgers[k % TENANTS.len()]),
            stop: Arc::clone(&stop),
            rng: rng.fork(),
        };
        workers.push(tokio::spawn(worker.run()));
    }

    let (mut slowest, mut slowest_after_all) = (Duration::ZERO, Duration::ZERO);
    for kill in 0..kills {
        sleep(Duration::from_micros(rng.u64(100_000..900_000))).await;
        match kill % 4 {
            2 => {
                database.kill();
                database.run();
                slowest_after_all = slowest_after_all.max(answered(&doors).await);
            }
            3 => {
                database.kill_bucket();
                sleep(Duration::from_millis(rng.u64(..500))).await;
                database.run_bucket();
                slowest_after_all = slowest_after_all.max(answered(&doors).await);
            }
            _ => {
                let which = rng.usize(..PROCESSES);
                servers[which].take().expect("it runs").kill();
                let took = answered(&doors).await;
                slowest = slowest.max(took);
                if took > TAKEN_OVER {
                    ledgers[0].violation(format!("it took {took:?} until all tenants were answered"));
                }
                let server = setups[which].start().await;
                relay.moved(which, server.address);
                servers[which] = Some(server);
            }
        }
        for (door, ledger) in doors.iter().zip(&ledgers) {
            ledger.check_some(door, None, CHECKED).await;
        }
        let violations: Vec<String> = ledgers.iter().flat_map(|ledger| ledger.violations()).collect();
        assert!(violations.is_empty(), "after kill {kill} of seed {seed}:\n{}", violations.join("\n"));
    }
    stop.store(true, Ordering::SeqCst);
    for worker in workers {
        timeout(Duration::from_secs(90), worker).await.expect("a worker hangs").expect("a worker");
    }
    for (door, ledger) in doors.iter().zip(&ledgers) {
        ledger.check(door).await;
    }
    let sum =
        |of: fn(&Ledger) -> &AtomicUsize| -> usize { ledgers.iter().map(|l| of(l).load(Ordering::Relaxed)).sum() };
    let (frames, containers) = (sum(|ledger| &ledger.frames_checked), sum(|ledger| &ledger.containers));
    println!(
        "soak: {kills} kills in {:.1} s; {} answers, {frames} of them checked after kills, {containers} containers the same, {} sessions deleted\n\
         soak: after a process was killed, all tenants answered within {} ms; after database or bucket within {} ms",
        clock.elapsed().as_secs_f64(),
        sum(|ledger| &ledger.answers),
        sum(|ledger| &ledger.deletions),
        slowest.as_millis(),
        slowest_after_all.as_millis(),
    );
    let violations: Vec<String> = ledgers.iter().flat_map(|ledger| ledger.violations()).collect();
    assert!(violations.is_empty(), "seed {seed}:\n{}", violations.join("\n"));
    assert!(frames > 0 && containers > 0, "nothing was checked");
}
