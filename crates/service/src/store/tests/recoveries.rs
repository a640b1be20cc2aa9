//! Recoveries, with every operation of the disk failing in turn.

use super::{EIO, ENOSPC, Given};
use crate::store::faults::{Fault, Loss};
use crate::store::{Kind, NamedFile, Opened, RecoveryMeta, RecoveryParts, Shared, Store, StoreError, StoredPart};
use cager_proto::recovery_messages::RecoveryOptions;
use std::convert::Infallible;
use std::io;

const FRAMES: [(&str, &[u8]); 2] = [("scan_1.ply", &[1; 5000]), ("Ärmel.obj", b"v 0 0 0\nv 1 0 0\n")];
const RESULT: &[u8] = b"a container";
const OUTCOME: &str = "an animation";

fn parts() -> RecoveryParts<NamedFile> {
    let file = |name: &str, bytes: &[u8]| NamedFile { name: name.to_owned(), bytes: bytes.to_vec() };
    RecoveryParts {
        template: file("rest.obj", b"v 0 0 0\n"),
        cage: None,
        rig: Some(file("rig.json", b"{}")),
        manifold: Some(file("poses.json", b"[]")),
    }
}

pub(super) fn meta(id: &str) -> RecoveryMeta {
    let Ok(parts) = parts().map(|_, part| Ok::<_, Infallible>(StoredPart::of(&part.name, &part.bytes)));
    RecoveryMeta {
        id: id.into(),
        tenant: "someone".into(),
        created_ms: 1_700_000_000_000,
        options: RecoveryOptions { max_error: Some(0.1 + 0.2), ..RecoveryOptions::default() },
        points: 1,
        origin: Some([691_235.0, 0.5, 0.0]),
        parts,
        idempotency: None,
    }
}

/// What somebody was told.
#[derive(Default)]
struct Told {
    created: bool,
    frames: usize,
    declared: bool,
    finished: bool,
    deleted: bool,
}

fn part(frame: usize) -> StoredPart {
    StoredPart::of(FRAMES[frame].0, FRAMES[frame].1)
}

fn finish(store: &Store) -> Result<(), StoreError> {
    let workshop = store.workshop()?;
    workshop.write("capture.cager", RESULT)?;
    let results = [StoredPart::of("capture.cager", RESULT)];
    store.finish_job(Kind::Recovery, "a", &OUTCOME, Some((&workshop, &results)))?;
    store.forget_recovery_input("a");
    Ok(())
}

/// A life of two recoveries. Every step is tried again once.
fn live(given: &Given, told: &mut Told) -> Result<(), StoreError> {
    fn twice<T>(mut step: impl FnMut() -> Result<T, StoreError>) -> Result<T, StoreError> {
        step().or_else(|_| step())
    }
    let store = twice(|| Store::open(given.root(), std::sync::Arc::new(given.disk.clone()), Shared::default()))?.store;
    for id in ["a", "b"] {
        twice(|| match store.create_recovery(&meta(id), &parts()) {
            // Made at the first attempt, where even taking it back had failed.
            Err(StoreError::Io { cause, .. }) if cause.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            other => other,
        })?;
    }
    told.created = true;
    for (frame, (_, content)) in FRAMES.iter().enumerate() {
        twice(|| store.put_recovery_frame("a", frame as u32, &part(frame), content))?;
        told.frames += 1;
    }
    twice(|| store.declare_recovery("a", 2))?;
    told.declared = true;
    twice(|| store.count_attempt(Kind::Recovery, "a"))?;
    twice(|| finish(&store))?;
    told.finished = true;
    twice(|| store.delete(Kind::Recovery, "b"))?;
    told.deleted = true;
    Ok(())
}

/// Opens the store and compares.
fn look(given: &Given, told: &Told, what: &str) {
    let Opened { store, recoveries, quarantined, .. } = given.open();
    assert!(quarantined.is_empty(), "{what}: {quarantined:?}");
    recoveries.iter().for_each(|found| assert_eq!(*found, meta(&found.id), "{what}"));
    let there = |id: &str| recoveries.iter().any(|found| found.id == id);
    assert!(!told.created || there("a"), "{what}: a recovery is lost");
    assert!(!(told.deleted && there("b")), "{what}: a deleted recovery came back");
    if there("a") {
        let outcome: Option<String> = store.outcome(Kind::Recovery, "a").unwrap();
        assert!(outcome.is_some() || !told.finished, "{what}: an outcome is lost");
        if let Some(outcome) = outcome {
            assert_eq!(outcome, OUTCOME, "{what}");
            let path = store.job_file(Kind::Recovery, "a", "capture.cager").unwrap();
            assert_eq!(std::fs::read(path).unwrap(), RESULT, "{what}");
        } else {
            assert_eq!(store.recovery_parts(&meta("a")).unwrap(), parts(), "{what}");
            let frames = store.recovery_frames("a").unwrap_or_else(|error| panic!("{what}: {error}"));
            assert!(frames.len() >= told.frames, "{what}: a frame is lost");
            for (at, (frame, found)) in frames.iter().enumerate() {
                assert_eq!((*frame as usize, found), (at, &part(at)), "{what}");
                assert_eq!(store.recovery_frame("a", *frame, found).unwrap(), FRAMES[at].1, "{what}");
            }
            let declared = store.declared_recovery("a").unwrap();
            assert!(declared == Some(2) || (declared.is_none() && !told.declared), "{what}");
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
fn what_is_over_keeps_its_results_and_not_its_input() {
    let given = Given::new();
    live(&given, &mut Told::default()).unwrap();
    let store = given.open().store;
    store.forget_recovery_input("a");
    let names = std::fs::read_dir(given.root().join("recoveries/a")).unwrap();
    let mut names: Vec<_> = names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["capture.cager"]);
    assert!(store.put_recovery_frame("b", 0, &part(0), FRAMES[0].1).is_err(), "it was deleted");
    assert!(store.put_recovery_frame("../a", 0, &part(0), FRAMES[0].1).is_err());
}

#[test]
fn every_change_of_a_frame_is_found() {
    let given = Given::new();
    let store = given.open().store;
    store.create_recovery(&meta("a"), &parts()).unwrap();
    store.put_recovery_frame("a", 0, &part(1), FRAMES[1].1).unwrap();
    let path = given.root().join("recoveries/a/frame-0");
    let file = std::fs::read(&path).unwrap();
    for at in 0..file.len() {
        let mut changed = file.clone();
        changed[at] ^= 1;
        std::fs::write(&path, changed).unwrap();
        assert!(store.recovery_frame("a", 0, &part(1)).is_err(), "byte {at}");
    }
    std::fs::write(&path, &file[..file.len() - 1]).unwrap();
    assert!(store.recovery_frame("a", 0, &part(1)).is_err());
    std::fs::write(path.with_file_name("frame-x"), &file).unwrap();
    assert!(matches!(store.recovery_frames("a"), Err(StoreError::Damaged { .. })));
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
