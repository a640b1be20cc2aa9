//! The whole store, with every operation of the disk failing in turn.

use super::faults::{Fault, FaultyDisk, Loss};
use super::log::tests::{append, frames};
use super::{
    Completion, Content, ContentKey, FrameLog, Idempotency, LocalDisk, Opened, SessionMeta, Store, StoreError,
};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_core::inversion::{Handles, Solver, SolverOptions};
use cager_core::synthetic::{Capture, Options};
use cager_proto::messages::SessionOptions;
use std::io;
use std::path::Path;
use std::sync::{Arc, LazyLock};
use tempfile::TempDir;

const EIO: i32 = 5;
const ENOSPC: i32 = 28;

/// An empty folder on a disk that can fail.
pub(crate) struct Given {
    folder: TempDir,
    pub(crate) disk: FaultyDisk,
}

impl Given {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let disk = FaultyDisk::new(folder.path()).unwrap();
        Self { folder, disk }
    }

    pub(crate) fn root(&self) -> &Path {
        self.folder.path()
    }

    pub(crate) fn open(&self) -> Opened {
        Store::open(self.root(), Arc::new(self.disk.clone())).unwrap()
    }
}

pub(crate) fn meta(id: &str) -> SessionMeta {
    SessionMeta {
        id: id.into(),
        tenant: "someone".into(),
        created_ms: 1_700_000_000_000,
        key: KEY,
        options: SessionOptions { lambda: Some(0.1 + 0.2), name: Some("Ärmel".into()), ..SessionOptions::default() },
        idempotency: Some(Idempotency { key: "k".into(), fingerprint: "f".into() }),
    }
}

pub(crate) const KEY: ContentKey = ContentKey([0xa7; 32]);

pub(crate) fn content() -> Content {
    Content { rest_name: "rest.obj".into(), rest: vec![1; 5000], cage_name: "cage.ply".into(), cage: vec![2; 70] }
}

pub(crate) fn prepare(handles: Handles) -> Solver {
    let capture = Capture::new(&Options { points: 400, frames: 2, cage_vertices: 40 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    Solver::prepare(&MeanValue, &cage, &capture.rest.points, SolverOptions { handles, ..SolverOptions::default() })
        .unwrap()
}

pub(crate) static SOLVER: LazyLock<Solver> = LazyLock::new(|| prepare(Handles::MaxVol));

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

const ROWS: u32 = 5;
const GROUPS: [&[u32]; 3] = [&[4, 5], &[0], &[1, 2, 9]];

fn write_frames(out: &mut dyn io::Write) -> io::Result<()> {
    (0..1000u32).try_for_each(|i| out.write_all(&i.to_le_bytes()))
}

fn completion() -> Completion {
    let mut bytes = Vec::new();
    write_frames(&mut bytes).unwrap();
    Completion {
        frames: 6,
        container_bytes: bytes.len() as u64,
        container_digest: blake3::hash(&bytes).to_hex().to_string(),
    }
}

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
    let store = twice(errors, || Store::open(given.root(), Arc::new(given.disk.clone())))?.store;
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
    let mut log: FrameLog = twice(errors, || store.open_log("a", ROWS))?.0;
    let (mut other, _) = twice(errors, || store.open_log("b", ROWS))?;
    twice(errors, || append(&mut other, &[7]))?;
    for group in GROUPS {
        twice(errors, || append(&mut log, group))?;
        told.frames.extend(group);
    }
    let container = twice(errors, || store.write_container("a", &mut |out| write_frames(out)))?;
    told.container = true;
    assert_eq!((container.bytes, container.digest), (completion().container_bytes, completion().container_digest));
    twice(errors, || store.complete("a", &completion()))?;
    told.complete = true;
    twice(errors, || store.delete_session("b"))?;
    told.deleted = true;
    twice(errors, || store.probe())
}

/// Opens the store and compares; gives what it showed, which counts from there on.
fn look(given: &Given, told: &Told, what: &str) -> Told {
    let Opened { store, sessions, quarantined } = given.open();
    assert!(quarantined.is_empty(), "{what}: {quarantined:?}");
    let ids: Vec<&str> = sessions.iter().map(|session| session.id.as_str()).collect();
    for session in &sessions {
        assert_eq!(*session, meta(&session.id), "{what}");
    }
    assert!(!told.created.contains(&"a") || ids.contains(&"a"), "{what}: a session is lost");
    if told.deleted {
        assert!(!ids.contains(&"b"), "{what}: a deleted session came back");
    } else if told.created.contains(&"b") && ids.contains(&"b") {
        let (log, entries) = store.open_log("b", ROWS).unwrap();
        assert!(frames(&log, &entries).iter().all(|&frame| frame == 7), "{what}");
    }
    let mut seen =
        Told { created: Vec::new(), deleted: told.created.contains(&"b") && !ids.contains(&"b"), ..Told::default() };
    seen.created.extend(["a", "b"].iter().filter(|id| ids.contains(id)));
    if ids.contains(&"a") {
        let (log, entries) = store.open_log("a", ROWS).unwrap_or_else(|error| panic!("{what}: {error}"));
        seen.frames = frames(&log, &entries);
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
        assert_eq!(seen.frames, GROUPS.concat());
        assert!(seen.complete && seen.deleted && seen.content && seen.prepared);
    }
}

#[test]
fn any_operation_may_fail() {
    for nth in 1..=operations() {
        for fault in [Fault::Error(ENOSPC), Fault::Ruin(EIO), Fault::Short] {
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
            look(&given, &told, &what);
            given.disk.restart(if nth % 2 == 0 { Loss::Everything } else { Loss::Torn(nth) }).unwrap();
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
        let refused =
            |error: &StoreError| matches!(error, StoreError::Full { .. }) || error.to_string().contains("anew");
        assert!(told.errors.iter().all(refused), "{what}: {:?}", told.errors);
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
            append(&mut store.open_log(id, ROWS).unwrap().0, &[3, 4]).unwrap();
            store.complete(id, &completion()).unwrap();
        }
        (given, store)
    };
    let (given, store) = prepare();
    let before = given.disk.operations();
    store.delete_session("b").unwrap();
    let count = given.disk.operations() - before;
    assert!(count > 5);
    for nth in 1..=count {
        for loss in [Loss::Nothing, Loss::Everything, Loss::Torn(nth), Loss::Torn(nth + 1000)] {
            let (given, store) = prepare();
            given.disk.fail(None, nth, Fault::Stop);
            let told = store.delete_session("b").is_ok();
            drop(store);
            given.disk.restart(loss).unwrap();
            let Opened { store, sessions, quarantined } = given.open();
            assert!(quarantined.is_empty());
            let there = sessions.iter().any(|session| session.id == "b");
            assert!(!(told && there), "it came back, step {nth}, {loss:?}");
            for id in if there { &["a", "b"][..] } else { &["a"] } {
                let (log, entries) = store.open_log(id, ROWS).unwrap();
                assert_eq!(frames(&log, &entries), [3, 4], "step {nth}, {loss:?}");
                assert_eq!(store.completion(id).unwrap(), Some(completion()));
            }
            assert_eq!(given.root().join("sessions/b").exists(), there);
            assert!(std::fs::read_dir(given.root().join("trash")).unwrap().next().is_none());
        }
    }
}

#[test]
fn a_damaged_session_is_set_aside_and_blocks_nobody() {
    let given = Given::new();
    let store = given.open().store;
    for id in ["a", "b", "c", "d", "e"] {
        store.create_session(&meta(id)).unwrap();
    }
    drop(store);
    let sessions = given.root().join("sessions");
    let mut bytes = std::fs::read(sessions.join("b/session.json")).unwrap();
    bytes[200] ^= 1;
    std::fs::write(sessions.join("b/session.json"), bytes).unwrap();
    std::fs::remove_file(sessions.join("c/session.json")).unwrap();
    std::fs::copy(sessions.join("a/session.json"), sessions.join("d/session.json")).unwrap();
    std::fs::create_dir(sessions.join("Not an id")).unwrap();
    for _ in 0..2 {
        // A name that is taken in quarantine is no obstacle.
        std::fs::write(sessions.join("stray"), "x").unwrap();
        let Opened { sessions, quarantined, .. } = Store::open(given.root(), Arc::new(LocalDisk)).unwrap();
        assert_eq!(sessions, [meta("a"), meta("e")]);
        for found in &quarantined {
            assert!(found.path.starts_with(given.root().join("quarantine")) && found.path.exists(), "{found:?}");
            assert!(found.why.contains(&found.name), "{found:?}");
        }
        let names: Vec<&str> = quarantined.iter().map(|found| found.name.as_str()).collect();
        assert!(names == ["Not an id", "b", "c", "d", "stray"] || names == ["stray"], "{names:?}");
    }
    let Opened { store, .. } = Store::open(given.root(), Arc::new(LocalDisk)).unwrap();
    store.quarantine_session("e", "its log is damaged").unwrap();
    let note = std::fs::read_to_string(given.root().join("quarantine/e.why.txt")).unwrap();
    assert_eq!(note, "its log is damaged\n");
}

#[test]
fn a_session_that_cannot_be_read_now_is_left_where_it_is() {
    let given = Given::new();
    given.open().store.create_session(&meta("a")).unwrap();
    given.disk.fail(Some(super::faults::Op::Read), 2, Fault::Error(EIO));
    let opened = given.open();
    assert_eq!((opened.sessions.len(), opened.quarantined.len()), (0, 1));
    drop(opened);
    assert_eq!(given.open().sessions, [meta("a")]);
}

#[test]
fn one_process_at_a_time() {
    let given = Given::new();
    let opened = given.open();
    let refused = Store::open(given.root(), Arc::new(LocalDisk));
    assert!(matches!(refused, Err(StoreError::Locked { .. })), "{refused:?}");
    let log = opened.store.create_session(&meta("a")).and_then(|()| opened.store.open_log("a", ROWS)).unwrap();
    drop(opened);
    assert!(matches!(Store::open(given.root(), Arc::new(LocalDisk)), Err(StoreError::Locked { .. })), "a log is open");
    drop(log);
    given.open();
}

#[test]
fn names_from_outside_touch_no_path() {
    let given = Given::new();
    let store = given.open().store;
    for id in ["", ".", "..", "a/b", "../x", "A", "a.b", "a\0", &"a".repeat(65), "ä"] {
        let refused = [
            store.create_session(&SessionMeta { id: id.into(), ..meta("a") }),
            store.delete_session(id),
            store.quarantine_session(id, "?"),
            store.open_log(id, ROWS).map(|_| ()),
            store.write_container(id, &mut |_| Ok(())).map(|_| ()),
            store.complete(id, &completion()),
            store.completion(id).map(|_| ()),
        ];
        assert!(refused.iter().all(|r| matches!(r, Err(StoreError::BadId { .. }))), "{id:?}: {refused:?}");
        assert!(store.container_path(id).starts_with(given.root().join("sessions/.no-session")));
        assert_eq!(store.session_bytes(id), 0);
    }
    store.create_session(&meta(&"a-0".repeat(21))).unwrap();
}

#[test]
fn an_id_is_taken_once() {
    let given = Given::new();
    let store = given.open().store;
    store.create_session(&meta("a")).unwrap();
    let again = store.create_session(&SessionMeta { tenant: "another".into(), ..meta("a") });
    assert!(matches!(again, Err(StoreError::Io { cause, .. }) if cause.kind() == io::ErrorKind::AlreadyExists));
    drop(store);
    assert_eq!(given.open().sessions, [meta("a")]);
}

#[test]
fn a_container_is_replaced_whole_or_not_at_all() {
    let given = Given::new();
    let store = given.open().store;
    store.create_session(&meta("a")).unwrap();
    let big: Vec<u8> = (0..1_000_000u32).map(|i| (i % 251) as u8).collect();
    let container = store
        .write_container("a", &mut |out| {
            out.write_all(&big[..10])?;
            out.write_all(&big[10..900_000])?;
            out.write_all(&big[900_000..])
        })
        .unwrap();
    assert_eq!(std::fs::read(store.container_path("a")).unwrap(), big);
    assert_eq!(container.digest, blake3::hash(&big).to_hex().as_str());
    assert!(store.session_bytes("a") > container.bytes);
    let damage = || StoreError::Damaged { path: "x".into(), what: "y".into() };
    let failed = store.write_container("a", &mut |out| {
        out.write_all(b"half")?;
        Err(damage().into())
    });
    assert!(matches!(failed, Err(StoreError::Damaged { .. })), "an error of the store comes out as it was: {failed:?}");
    assert_eq!(std::fs::read(store.container_path("a")).unwrap(), big);
    given.disk.fail(Some(super::faults::Op::Write), 2, Fault::Error(ENOSPC));
    let failed = store.write_container("a", &mut |out| {
        let _ = out.write_all(&big);
        let _ = out.flush();
        out.write_all(&big)?;
        Ok(())
    });
    assert!(failed.is_err() || std::fs::read(store.container_path("a")).unwrap().len() == 2 * big.len());
}

#[test]
fn a_full_disk_is_not_ready() {
    let given = Given::new();
    let store = given.open().store;
    store.probe().unwrap();
    assert!(store.free_bytes() > 0);
    given.disk.set_free_bytes(Some(5));
    assert_eq!(store.free_bytes(), 5);
    given.disk.fail(Some(super::faults::Op::Write), 1, Fault::Error(ENOSPC));
    assert!(matches!(store.probe(), Err(StoreError::Full { .. })));
    store.probe().unwrap();
}
