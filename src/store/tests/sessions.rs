//! Sessions: damaged, locked, misnamed, and their containers.

use super::{EIO, ENOSPC, Given, ROWS, completion, meta};
use crate::store::faults::{Fault, Op};
use crate::store::{Kind, LocalDisk, Opened, SessionMeta, Store, StoreError};
use std::io;
use std::sync::Arc;

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
    store.quarantine(Kind::Session, "e", "its log is damaged").unwrap();
    let note = std::fs::read_to_string(given.root().join("quarantine/e.why.txt")).unwrap();
    assert_eq!(note, "its log is damaged\n");
}

#[test]
fn a_session_that_cannot_be_read_now_is_left_where_it_is() {
    let given = Given::new();
    given.open().store.create_session(&meta("a")).unwrap();
    given.disk.fail(Some(Op::Read), 2, Fault::Error(EIO));
    let opened = given.open();
    assert_eq!((opened.sessions.len(), opened.quarantined.len(), opened.unread.len()), (0, 0, 1));
    let left = &opened.unread[0];
    assert!(left.path.ends_with("sessions/a") && left.path.exists() && left.why.contains("session.json"), "{left:?}");
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
            store.delete(Kind::Session, id),
            store.quarantine(Kind::Session, id, "?"),
            store.open_log(id, ROWS).map(|_| ()),
            store.write_container(id, &mut |_| Ok(())).map(|_| ()),
            store.complete(id, &completion()),
            store.completion(id).map(|_| ()),
        ];
        assert!(refused.iter().all(|r| matches!(r, Err(StoreError::BadId { .. }))), "{id:?}: {refused:?}");
        assert!(store.container_path(id).starts_with(given.root().join("sessions/.no-session")));
        assert!(store.bytes(Kind::Session, id).is_err());
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
    assert!(store.bytes(Kind::Session, "a").expect("a session") > container.bytes);
    let damage = || StoreError::Damaged { path: "x".into(), what: "y".into() };
    let failed = store.write_container("a", &mut |out| {
        out.write_all(b"half")?;
        Err(damage().into())
    });
    assert!(matches!(failed, Err(StoreError::Damaged { .. })), "an error of the store comes out as it was: {failed:?}");
    assert_eq!(std::fs::read(store.container_path("a")).unwrap(), big);
    given.disk.fail(Some(Op::Write), 2, Fault::Error(ENOSPC));
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
    given.disk.fail(Some(Op::Write), 1, Fault::Error(ENOSPC));
    assert!(matches!(store.probe(), Err(StoreError::Full { .. })));
    store.probe().unwrap();
}
