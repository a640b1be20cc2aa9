//! Cage jobs, with every operation of the disk failing in turn.

use super::{EIO, ENOSPC, Given, KEY};
use crate::store::faults::{Fault, Loss};
use crate::store::{CageJobMeta, Kind, Opened, Shared, Store, StoreError, StoredPart};
use cager_proto::cage_messages::CageOptions;
use std::io::{self, Read as _};

const REST: &[u8] = b"v 0 0 0\n";
const PIECES: [&[u8]; 2] = [&[1; 5000], &[2; 3000]];
const CAGE: &[u8] = b"v 1 2 3\nf 1 2 3\n";
const OUTCOME: &str = "a cage";

fn meta(id: &str) -> CageJobMeta {
    CageJobMeta {
        id: id.into(),
        tenant: "someone".into(),
        created_ms: 1_700_000_000_000,
        key: KEY,
        options: CageOptions { mean_error: Some(0.1 + 0.2), name: Some("Käfig".into()), ..CageOptions::default() },
        points: 1,
        frame_count: 7,
        rest: StoredPart::of("rest.obj", REST),
        frames: StoredPart::of("frames", &PIECES.concat()),
        idempotency: None,
    }
}

/// What somebody was told.
#[derive(Default)]
struct Told {
    created: Vec<&'static str>,
    finished: bool,
    deleted: bool,
}

fn create(store: &Store, id: &str) -> Result<(), StoreError> {
    let mut spool = store.spool()?;
    PIECES.iter().try_for_each(|piece| spool.append(piece))?;
    assert_eq!((spool.bytes(), spool.digest()), (8000, blake3::hash(&PIECES.concat())));
    match store.create_cage_job(&meta(id), REST, spool) {
        // Made at the first attempt, where even taking it back had failed.
        Err(StoreError::Io { cause, .. }) if cause.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        other => other,
    }
}

/// Completes the first job.
fn finish(store: &Store) -> Result<(), StoreError> {
    let workshop = store.workshop()?;
    workshop.write("cage.obj", CAGE)?;
    store.finish_job(Kind::CageJob, "a", &OUTCOME, Some((&workshop, &[StoredPart::of("cage.obj", CAGE)])))?;
    store.forget_cage_job_input("a");
    Ok(())
}

/// A life of two jobs. Every step is tried again once.
fn live(given: &Given, told: &mut Told) -> Result<(), StoreError> {
    fn twice<T>(mut step: impl FnMut() -> Result<T, StoreError>) -> Result<T, StoreError> {
        step().or_else(|_| step())
    }
    let store = twice(|| Store::open(given.root(), std::sync::Arc::new(given.disk.clone()), Shared::default()))?.store;
    for id in ["a", "b"] {
        twice(|| create(&store, id))?;
        told.created.push(id);
    }
    twice(|| store.count_attempt(Kind::CageJob, "a"))?;
    twice(|| finish(&store))?;
    told.finished = true;
    twice(|| store.delete(Kind::CageJob, "b"))?;
    told.deleted = true;
    Ok(())
}

/// Opens the store and compares.
fn look(given: &Given, told: &Told, what: &str) {
    let Opened { store, cage_jobs, quarantined, .. } = given.open();
    assert!(quarantined.is_empty(), "{what}: {quarantined:?}");
    let there = |id: &str| cage_jobs.iter().any(|job| job.id == id);
    for job in &cage_jobs {
        assert_eq!(*job, meta(&job.id), "{what}");
    }
    assert!(!told.created.contains(&"a") || there("a"), "{what}: a job is lost");
    assert!(!(told.deleted && there("b")), "{what}: a deleted job came back");
    for id in ["a", "b"].into_iter().filter(|id| there(id)) {
        let outcome: Option<String> =
            store.outcome(Kind::CageJob, id).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(outcome.is_some() || !(told.finished && id == "a"), "{what}: an outcome is lost");
        match outcome {
            Some(outcome) => {
                assert_eq!(outcome, OUTCOME, "{what}");
                let cage = StoredPart::of("cage.obj", CAGE);
                assert_eq!(store.cage_job_cage(id, cage.bytes, &cage.blake3).unwrap(), CAGE, "{what}");
            }
            None => {
                assert_eq!(store.cage_job_rest(&meta(id)).unwrap(), REST, "{what}");
                let mut frames = Vec::new();
                store.cage_job_frames(&meta(id)).unwrap().read_to_end(&mut frames).unwrap();
                assert!(frames == PIECES.concat(), "{what}");
            }
        }
    }
    for empty in ["tmp", "trash", "quarantine"] {
        assert!(std::fs::read_dir(given.root().join(empty)).unwrap().next().is_none(), "{what}: {empty}");
    }
}

fn operations() -> u64 {
    let given = Given::new();
    live(&given, &mut Told::default()).unwrap();
    given.disk.operations()
}

#[test]
fn a_job_keeps_its_input_until_it_is_over_and_its_cage_from_then_on() {
    let given = Given::new();
    let store = given.open().store;
    create(&store, "a").unwrap();
    assert!(store.bytes(Kind::CageJob, "a").expect("a job") > 8000);
    assert_eq!(
        [store.count_attempt(Kind::CageJob, "a").unwrap(), store.count_attempt(Kind::CageJob, "a").unwrap()],
        [1, 2]
    );
    finish(&store).unwrap();
    assert!(store.bytes(Kind::CageJob, "a").expect("a job") < 2000);
    assert!(matches!(store.cage_job_rest(&meta("a")), Err(StoreError::Damaged { .. })));
    store.create_finished_cage_job(&meta("b"), &OUTCOME, CAGE).unwrap();
    drop(store);
    look(&given, &Told { created: vec!["a"], finished: true, deleted: false }, "two finished jobs");
    // What is over cannot become so again where it was deleted.
    let store = given.open().store;
    store.delete(Kind::CageJob, "a").unwrap();
    assert!(finish(&store).is_err());
    assert!(store.create_cage_job(&meta("../a"), REST, store.spool().unwrap()).is_err());
}

#[test]
fn what_does_not_match_its_checksum_is_found() {
    let given = Given::new();
    let store = given.open().store;
    create(&store, "a").unwrap();
    let folder = given.root().join("cages/a");
    std::fs::write(folder.join("rest"), b"v 0 0 1\n").unwrap();
    assert!(matches!(store.cage_job_rest(&meta("a")), Err(StoreError::Damaged { .. })));
    std::fs::write(folder.join("frames"), b"short").unwrap();
    assert!(matches!(store.cage_job_frames(&meta("a")), Err(StoreError::Damaged { .. })));
}

#[test]
fn any_operation_may_fail_once() {
    for nth in 1..=operations() {
        for fault in [Fault::Error(ENOSPC), Fault::Ruin(EIO), Fault::Short] {
            let given = Given::new();
            given.disk.fail(None, nth, fault);
            let mut told = Told::default();
            let what = format!("operation {nth}, {:?}, {fault:?}", given.disk.trace().get(nth as usize - 1));
            live(&given, &mut told).unwrap_or_else(|error| panic!("{what}: {error}"));
            given.disk.restart(Loss::Everything).unwrap();
            look(&given, &told, &what);
        }
    }
}

#[test]
fn the_process_may_end_and_the_power_may_fail_anywhere() {
    for nth in 1..=operations() {
        for loss in [Loss::Nothing, Loss::Everything, Loss::Torn(nth), Loss::Torn(nth + 1000)] {
            let given = Given::new();
            given.disk.fail(None, nth, Fault::Stop);
            let mut told = Told::default();
            let _ = live(&given, &mut told);
            given.disk.restart(loss).unwrap();
            look(&given, &told, &format!("stopped at operation {nth}, {loss:?}"));
        }
    }
}
