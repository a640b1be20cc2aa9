//! Sessions: damaged, lost, locked, misnamed, and their containers.

use super::{ENOSPC, Given, append, completion, frames, meta};
use crate::store::faults::{Fault, Op};
use crate::store::{Kind, LocalDisk, Opened, SessionMeta, Shared, Store, StoreError};
use cager_store::{Key, NewRecord, Phase};
use std::io;
use std::sync::Arc;

#[test]
fn a_record_that_cannot_be_read_stays_and_blocks_nobody() {
    let given = Given::new();
    let store = given.open().store;
    for id in ["a", "e"] {
        store.create_session(&meta(id)).unwrap();
    }
    let mut changed = store.sealed("session", &meta("b")).unwrap();
    changed[200] ^= 1;
    let of_another = store.sealed("session", &meta("a")).unwrap();
    for (id, bytes) in [("b", &changed), ("d", &of_another), ("../x", &of_another)] {
        let key = Key { kind: Kind::Session, id };
        let record = NewRecord { key, created_ms: 1, phase: Phase::Open, meta: bytes };
        store.catalog().create(record).unwrap();
    }
    drop(store);
    let sessions = given.root().join("sessions");
    std::fs::create_dir(sessions.join("Not an id")).unwrap();
    std::fs::create_dir(sessions.join("unknown")).unwrap();
    std::fs::write(sessions.join("unknown/capture.cager"), "x").unwrap();
    for round in 0..2 {
        // A name that is taken in quarantine is no obstacle.
        std::fs::write(sessions.join("stray"), "x").unwrap();
        let Opened { sessions, quarantined, .. } = given.open();
        assert_eq!(sessions, [meta("a"), meta("e")]);
        assert!(quarantined.iter().all(|found| found.path.exists()), "{quarantined:?}");
        let names: Vec<&str> = quarantined.iter().map(|found| found.name.as_str()).collect();
        let expected = ["../x", "b", "d", "stray", "unknown"];
        assert_eq!(names, expected[..if round == 0 { 5 } else { 4 }], "records stay where they are");
    }
    let note = std::fs::read_to_string(given.root().join("quarantine/unknown.why.txt")).unwrap();
    assert_eq!(note, "there is no session of this name in the catalogue\n");
    assert!(!sessions.join("Not an id").exists(), "an empty folder is nothing");
}

#[test]
fn a_damaged_session_stays_so_until_it_is_deleted() {
    let given = Given::new();
    let store = given.open().store;
    store.create_session(&meta("a")).unwrap();
    store.mark_damaged(Kind::Session, "a", "frame 3").unwrap();
    drop(store);
    let Opened { store, sessions, .. } = given.open();
    assert_eq!(sessions, [meta("a")]);
    assert_eq!(store.damage(Kind::Session, "a").unwrap().as_deref(), Some("frame 3"));
    store.delete(Kind::Session, "a").unwrap();
    assert!(store.mark_damaged(Kind::Session, "a", "frame 4").is_err_and(|error| error.is_not_found()));
}

#[test]
fn a_folder_that_has_lost_its_catalogue_is_left_as_it_is() {
    let given = Given::new();
    let folder = given.root().join("data");
    let open = || Store::open(&folder, Arc::new(LocalDisk), Shared::default());
    let store = open().unwrap().store;
    store.create_session(&meta("a")).unwrap();
    append(&store, "a", &[1, 2]).unwrap();
    store.write_container("a", &mut |out| out.write_all(b"container")).unwrap();
    drop(store);
    let catalog = folder.join("catalog.db");
    std::fs::rename(&catalog, folder.join("elsewhere")).unwrap();
    let refused = open();
    assert!(matches!(&refused, Err(StoreError::CatalogDamaged { path, .. }) if *path == catalog), "{refused:?}");
    assert!(folder.join("sessions/a/capture.cager").exists() && !catalog.exists());
    std::fs::write(&catalog, "not a database, whatever it is").unwrap();
    let refused = open();
    assert!(matches!(&refused, Err(StoreError::CatalogDamaged { path, .. }) if *path == catalog), "{refused:?}");
    std::fs::rename(folder.join("elsewhere"), &catalog).unwrap();
    let Opened { store, sessions, quarantined, .. } = open().unwrap();
    assert!(quarantined.is_empty() && sessions == [meta("a")]);
    assert_eq!(frames(&store, "a").unwrap(), [1, 2]);
}

#[test]
fn one_process_at_a_time() {
    let given = Given::new();
    let opened = given.open();
    let refused = Store::open(given.root(), Arc::new(LocalDisk), Shared::default());
    assert!(matches!(refused, Err(StoreError::Locked { .. })), "{refused:?}");
    let store = opened.store.clone();
    drop(opened);
    assert!(
        matches!(Store::open(given.root(), Arc::new(LocalDisk), Shared::default()), Err(StoreError::Locked { .. })),
        "it is in use"
    );
    drop(store);
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
            store.mark_damaged(Kind::Session, id, "?"),
            append(&store, id, &[1]).map(|_| ()),
            store.frames(id).map(|_| ()),
            store.write_container(id, &mut |_| Ok(())).map(|_| ()),
            store.complete(id, &completion(), None::<&()>),
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
    assert_eq!(store.bytes(Kind::Session, "a").expect("a session"), container.bytes);
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
    let part = std::sync::Mutex::default();
    store.probe(&part).unwrap();
    assert!(store.free_bytes() > 0);
    given.disk.set_free_bytes(Some(5));
    assert_eq!(store.free_bytes(), 5);
    given.disk.fail(Some(Op::Write), 1, Fault::Error(ENOSPC));
    assert!(matches!(store.probe(&part), Err(StoreError::Full { .. })));
    store.probe(&part).unwrap();
}
