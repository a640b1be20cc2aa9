//! A life of the store, with every operation of the disk failing in turn.

use super::{EIO, ENOSPC, Given, KEY, SOLVER, append, completion, content, frames, meta, write_frames};
use crate::store::faults::{Fault, Loss};
use crate::store::{Kind, Opened, Shared, Store, StoreError};
use std::io;
use std::sync::Arc;

/// What somebody was told.
#[derive(Default)]
struct Told {
    content: bool,
    prepared: bool,
    created: Vec<&'static str>,
    frames: Vec<u32>,
    container: bool,
    complete: bool,
    deleted: bool,
    errors: Vec<StoreError>,
}

const GROUPS: [&[u32]; 3] = [&[4, 5], &[0], &[1, 2, 9]];

/// A life of the store. Every step is tried again once, as a client would.
fn live(given: &Given, told: &mut Told) -> Result<(), ()> {
    fn twice<T>(errors: &mut Vec<StoreError>, mut step: impl FnMut() -> Result<T, StoreError>) -> Result<T, ()> {
        step()
            .or_else(|error| {
                errors.push(error);
                step()
            })
            .map_err(|error| errors.push(error))
    }
    let errors = &mut told.errors;
    let store = twice(errors, || Store::open(given.root(), Arc::new(given.disk.clone()), Shared::default()))?.store;
    twice(errors, || store.put_content(&KEY, &content()))?;
    told.content = true;
    twice(errors, || store.put_prepared(&KEY, &SOLVER))?;
    told.prepared = true;
    for id in ["a", "b"] {
        twice(errors, || match store.create_session(&meta(id)) {
            // Made at the first attempt, where even taking it back had failed.
            Err(StoreError::Io { cause, .. }) if cause.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            other => other,
        })?;
        told.created.push(id);
    }
    twice(errors, || append(&store, "b", &[7]))?;
    for group in GROUPS {
        twice(errors, || append(&store, "a", group))?;
        told.frames.extend(group);
    }
    let container = twice(errors, || store.write_container("a", &mut |out| write_frames(out)))?;
    told.container = true;
    assert_eq!((container.bytes, container.digest), (completion().container_bytes, completion().container_digest));
    twice(errors, || store.complete("a", &completion(), None::<&()>))?;
    told.complete = true;
    twice(errors, || store.delete(Kind::Session, "b"))?;
    told.deleted = true;
    twice(errors, || store.probe(&std::sync::Mutex::default()))
}

/// Opens the store and compares; gives what it showed, which counts from there on.
fn look(given: &Given, told: &Told, what: &str) -> Told {
    let Opened { store, sessions, quarantined, .. } = given.open();
    assert!(quarantined.is_empty(), "{what}: {quarantined:?}");
    let ids: Vec<&str> = sessions.iter().map(|session| session.id.as_str()).collect();
    for session in &sessions {
        assert_eq!(*session, meta(&session.id), "{what}");
    }
    assert!(!told.created.contains(&"a") || ids.contains(&"a"), "{what}: a session is lost");
    if told.deleted {
        assert!(!ids.contains(&"b"), "{what}: a deleted session came back");
    } else if told.created.contains(&"b") && ids.contains(&"b") {
        assert!(frames(&store, "b").unwrap().iter().all(|&frame| frame == 7), "{what}");
    }
    let mut seen =
        Told { created: Vec::new(), deleted: told.created.contains(&"b") && !ids.contains(&"b"), ..Told::default() };
    seen.created.extend(["a", "b"].iter().filter(|id| ids.contains(id)));
    if ids.contains(&"a") {
        seen.frames = frames(&store, "a").unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(told.frames.iter().all(|frame| seen.frames.contains(frame)), "{what}: {:?}", seen.frames);
        let container = std::fs::read(store.container_path("a")).ok();
        let has_container = container.is_some();
        assert!(has_container || !told.container, "{what}: the container is lost");
        if let Some(container) = container {
            assert_eq!(blake3::hash(&container).to_hex().as_str(), completion().container_digest, "{what}");
        }
        let complete = store.completion("a").unwrap();
        assert!(complete.is_some() || !told.complete, "{what}: the mark of completion is lost");
        assert!(complete.as_ref().is_none_or(|found| *found == completion() && has_container), "{what}");
        seen.complete = complete.is_some();
        // Nobody hears of a container before the session is complete.
        seen.container = seen.complete;
    }
    let found = store.content(&KEY).unwrap();
    assert!(found.is_some() || !told.content, "{what}: content is lost");
    assert!(found.as_ref().is_none_or(|found| *found == content()), "{what}");
    seen.content = found.is_some();
    let solver = store.prepared(&KEY).unwrap();
    assert!(solver.is_some() || !told.prepared, "{what}: a solver is lost");
    seen.prepared = solver.is_some();
    for empty in ["tmp", "trash", "quarantine"] {
        let left: Vec<_> = std::fs::read_dir(given.root().join(empty)).unwrap().collect();
        assert!(left.is_empty(), "{what}: {left:?}");
    }
    seen
}

fn operations() -> u64 {
    let given = Given::new();
    let mut told = Told::default();
    live(&given, &mut told).unwrap();
    assert!(told.errors.is_empty() && told.deleted);
    given.disk.operations()
}

#[test]
fn a_life_without_faults_is_durable() {
    let given = Given::new();
    let mut told = Told::default();
    live(&given, &mut told).unwrap();
    for loss in [Loss::Nothing, Loss::Everything, Loss::Torn(1)] {
        given.disk.restart(loss).unwrap();
        let seen = look(&given, &told, "no fault");
        assert_eq!(seen.frames, [0, 1, 2, 4, 5, 9]);
        assert!(seen.complete && seen.deleted && seen.content && seen.prepared);
    }
}

#[test]
fn any_operation_may_fail() {
    for nth in 1..=operations() {
        // A full disk in both ways, the others in one of them each time.
        let turn = (nth / 2).is_multiple_of(2);
        let full = Fault::Error(ENOSPC);
        for (fault, at_once) in [(full, false), (full, true), (Fault::Ruin(EIO), turn), (Fault::Short, !turn)] {
            let given = Given::new();
            given.disk.fail(None, nth, fault);
            let mut told = Told::default();
            let lived = live(&given, &mut told);
            let what = format!("operation {nth}, {:?}, {fault:?}", given.disk.trace().get(nth as usize - 1));
            assert!(lived.is_ok(), "{what}: the second attempt failed too: {:?}", told.errors);
            for error in &told.errors {
                assert_eq!(matches!(error, StoreError::Full { .. }), fault == Fault::Error(ENOSPC), "{what}: {error}");
                assert!(!matches!(error, StoreError::Damaged { .. }), "{what}: {error}");
            }
            assert!(fault != Fault::Short || told.errors.is_empty(), "{what}: a short write is no error");
            // With the power failing at once, and after a look.
            if !at_once {
                look(&given, &told, &what);
            }
            given
                .disk
                .restart(if at_once || nth.is_multiple_of(2) { Loss::Everything } else { Loss::Torn(nth) })
                .unwrap();
            look(&given, &told, &what);
        }
    }
}

#[test]
fn a_disk_that_stays_full_loses_nothing() {
    for nth in 1..=operations() {
        let given = Given::new();
        given.disk.fail_from(None, nth, Fault::Error(ENOSPC));
        let mut told = Told::default();
        let _ = live(&given, &mut told);
        let what = format!("full from operation {nth} on");
        assert!(told.errors.iter().all(|error| matches!(error, StoreError::Full { .. })), "{what}: {:?}", told.errors);
        given.disk.disarm();
        let seen = look(&given, &told, &what);
        given.disk.restart(Loss::Everything).unwrap();
        look(&given, &seen, &what);
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
            let what = format!("stopped at operation {nth}, {loss:?}");
            let seen = look(&given, &told, &what);
            // What was shown after the first end has to be there after a second.
            given.disk.restart(Loss::Everything).unwrap();
            look(&given, &seen, &format!("{what}, then the power failed"));
        }
    }
}

#[test]
fn a_deletion_may_be_interrupted_anywhere() {
    let prepare = || {
        let given = Given::new();
        let store = given.open().store;
        for id in ["a", "b"] {
            store.create_session(&meta(id)).unwrap();
            append(&store, id, &[3, 4]).unwrap();
            store.complete(id, &completion(), None::<&()>).unwrap();
        }
        (given, store)
    };
    let (given, store) = prepare();
    let before = given.disk.operations();
    store.delete(Kind::Session, "b").unwrap();
    let count = given.disk.operations() - before;
    assert!(count > 5);
    for nth in 1..=count {
        for loss in [Loss::Nothing, Loss::Everything, Loss::Torn(nth), Loss::Torn(nth + 1000)] {
            let (given, store) = prepare();
            given.disk.fail(None, nth, Fault::Stop);
            let told = store.delete(Kind::Session, "b").is_ok();
            drop(store);
            given.disk.restart(loss).unwrap();
            let Opened { store, sessions, quarantined, .. } = given.open();
            assert!(quarantined.is_empty());
            let there = sessions.iter().any(|session| session.id == "b");
            assert!(!(told && there), "it came back, step {nth}, {loss:?}");
            for id in if there { &["a", "b"][..] } else { &["a"] } {
                assert_eq!(frames(&store, id).unwrap(), [3, 4], "step {nth}, {loss:?}");
                assert_eq!(store.completion(id).unwrap(), Some(completion()));
            }
            assert_eq!(given.root().join("sessions/b").exists(), there);
            assert!(std::fs::read_dir(given.root().join("trash")).unwrap().next().is_none());
        }
    }
}
