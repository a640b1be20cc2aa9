//! What versions before the catalogue stored, taken over.

use super::{Given, ROWS, cage, completion, entry, frames, meta};
use crate::store::faults::{Fault, Loss};
use crate::store::{Disk as _, Kind, Opened, SessionMeta, Shared, meta as files};
use serde::Serialize;
use std::path::Path;

const FRAMES: [u32; 5] = [4, 5, 0, 1, 2];
const OUTCOME: &str = "ready";

fn put<T: Serialize>(given: &Given, path: &str, kind: &str, value: &T) {
    put_bytes(given, path, &files::wrap(Path::new(path), kind, value).unwrap());
}

/// Durably, on the disk that fails.
fn put_bytes(given: &Given, path: &str, bytes: &[u8]) {
    let (disk, path) = (&given.disk, given.root().join(path));
    let _ = disk.create_dir(path.parent().unwrap());
    let file = disk.create_new(&path).unwrap();
    file.write_all_at(bytes, 0).and_then(|()| file.sync_data()).unwrap();
    let mut folder = path.parent();
    while let Some(path) = folder.filter(|path| path.starts_with(given.root())) {
        disk.sync_dir(path).unwrap();
        folder = path.parent();
    }
}

/// The log of a session as earlier versions wrote it.
fn log(id: &str, frames: &[u32]) -> Vec<u8> {
    let mut file = vec![0; 4096];
    file[..8].copy_from_slice(b"CGRLOG\r\n");
    file[8] = 1;
    file[12..16].copy_from_slice(&ROWS.to_le_bytes());
    file[16..16 + id.len()].copy_from_slice(id.as_bytes());
    let seed = crc32c::crc32c(&file[..80]);
    file[80..84].copy_from_slice(&seed.to_le_bytes());
    for &frame in frames {
        let (offset, known) = (file.len() as u64, entry(frame));
        let start = file.len();
        file.extend_from_slice(&frame.to_le_bytes());
        file.extend_from_slice(&u32::from(known.full_digest.is_some()).to_le_bytes());
        file.extend_from_slice(&known.l2.to_le_bytes());
        file.extend_from_slice(&known.linf.to_le_bytes());
        file.extend_from_slice(&known.squared.to_le_bytes());
        file.extend_from_slice(&known.spread.to_le_bytes());
        file.extend_from_slice(&offset.to_le_bytes());
        file.extend_from_slice(&known.handle_digest);
        file.extend_from_slice(&known.full_digest.unwrap_or_default());
        file.extend(cage(frame).into_iter().flat_map(f32::to_le_bytes));
        let crc = crc32c::crc32c_append(crc32c::crc32c_append(seed, &offset.to_le_bytes()), &file[start..]);
        file.extend_from_slice(&crc.to_le_bytes());
    }
    let durable = (file.len() as u64).to_le_bytes();
    file[512..520].copy_from_slice(&durable);
    let crc = crc32c::crc32c_append(seed, &durable);
    file[520..524].copy_from_slice(&crc.to_le_bytes());
    file
}

/// A folder of an earlier version: a session with everything, one with nothing but itself, and a recovery.
fn old() -> Given {
    let given = Given::new();
    for folder in ["sessions", "cages", "recoveries", "transfers"] {
        given.disk.create_dir(&given.root().join(folder)).unwrap();
    }
    for id in ["a", "b"] {
        put(&given, &format!("sessions/{id}/session.json"), "session", &meta(id));
    }
    put_bytes(&given, "sessions/a/frames.log", &log("a", &FRAMES));
    put(&given, "sessions/a/outcome.json", "outcome", &OUTCOME);
    put(&given, "sessions/a/complete.json", "completion", &completion());
    put(&given, "sessions/a/announce.json", "announce", &7_u32);
    put_bytes(&given, "sessions/a/capture.cager", b"container");
    put(&given, "recoveries/r/recovery.json", "recovery", &super::recoveries::meta("r"));
    put(&given, "recoveries/r/complete.json", "completion", &12_u32);
    put(&given, "recoveries/r/reached.json", "progress", &3_u32);
    put(&given, "recoveries/r/attempts.json", "attempts", &2_u32);
    put_bytes(&given, "recoveries/r/template", b"v 0 0 0");
    given
}

/// Opens the folder, and sees whether all was taken over.
fn look(given: &Given, what: &str) {
    let Opened { store, sessions, recoveries, quarantined, .. } = given.open();
    assert!(quarantined.is_empty(), "{what}: {quarantined:?}");
    assert_eq!(sessions, [meta("a"), meta("b")], "{what}");
    assert_eq!(recoveries, [super::recoveries::meta("r")], "{what}");
    assert_eq!(frames(&store, "a").unwrap(), [0, 1, 2, 4, 5], "{what}");
    assert!(frames(&store, "b").unwrap().is_empty(), "{what}");
    assert_eq!(store.outcome::<String>(Kind::Session, "a").unwrap().as_deref(), Some(OUTCOME), "{what}");
    assert_eq!(store.outcome::<String>(Kind::Session, "b").unwrap(), None, "{what}");
    assert_eq!(store.completion("a").unwrap(), Some(completion()), "{what}");
    assert_eq!(store.announcement::<u32>("a").unwrap(), Some(7), "{what}");
    assert_eq!((store.declared_recovery("r").unwrap(), store.reached_recovery("r").unwrap()), (Some(12), 3), "{what}");
    assert_eq!(store.count_attempt(Kind::Recovery, "r").unwrap(), 3, "{what}");
    store.set_attempts(Kind::Recovery, "r", |_| 2).unwrap();
    let names = |folder: &str| {
        let names = std::fs::read_dir(given.root().join(folder)).unwrap();
        names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(names("sessions/a"), ["capture.cager"], "{what}");
    assert!(names("sessions/b").is_empty(), "{what}");
    assert_eq!(names("recoveries/r"), ["template"], "{what}");
}

#[test]
fn all_is_taken_over_and_stays() {
    let given = old();
    look(&given, "taken over");
    given.disk.restart(Loss::Everything).unwrap();
    look(&given, "once more");
}

#[test]
fn taking_over_may_stop_anywhere() {
    let count = {
        let given = old();
        let before = given.disk.operations();
        drop(given.open());
        given.disk.operations() - before
    };
    assert!(count > 40);
    for nth in 1..=count {
        for loss in [Loss::Nothing, Loss::Everything, Loss::Torn(nth)] {
            let given = old();
            given.disk.fail(None, nth, Fault::Stop);
            let stopped =
                crate::store::Store::open(given.root(), std::sync::Arc::new(given.disk.clone()), Shared::default());
            drop(stopped);
            given.disk.restart(loss).unwrap();
            look(&given, &format!("stopped at operation {nth}, {loss:?}"));
        }
    }
}

#[test]
fn damage_is_told_and_costs_nobody_else_anything() {
    let given = old();
    let of_another = files::wrap(Path::new("x"), "session", &SessionMeta { id: "z".into(), ..meta("c") }).unwrap();
    put_bytes(&given, "sessions/c/session.json", &of_another);
    put(&given, "sessions/d/session.json", "session", &meta("d"));
    let mut damaged = log("d", &FRAMES);
    let third = 4096 + 2 * (72 + 12 * ROWS as usize + 4);
    damaged[third + 100] ^= 1;
    put_bytes(&given, "sessions/d/frames.log", &damaged);
    put(&given, "sessions/e/session.json", "session", &meta("e"));
    let mut torn = log("e", &FRAMES);
    // A mark and records of the durable length that there was two frames before.
    let durable = (third as u64).to_le_bytes();
    let seed = crc32c::crc32c(&torn[..80]);
    torn[512..520].copy_from_slice(&durable);
    torn[520..524].copy_from_slice(&crc32c::crc32c_append(seed, &durable).to_le_bytes());
    torn.truncate(third + 100);
    put_bytes(&given, "sessions/e/frames.log", &torn);
    let Opened { store, sessions, quarantined, .. } = given.open();
    let names: Vec<&str> = quarantined.iter().map(|found| found.name.as_str()).collect();
    assert_eq!(names, ["c"], "{quarantined:?}");
    assert_eq!(sessions, ["a", "b", "d", "e"].map(meta));
    assert!(store.damage(Kind::Session, "d").unwrap().is_some_and(|what| what.contains("acknowledged")));
    assert_eq!(frames(&store, "d").unwrap(), [4, 5]);
    assert!(given.root().join("sessions/d/frames.log").exists(), "a person may save what can be");
    assert_eq!((store.damage(Kind::Session, "e").unwrap(), frames(&store, "e").unwrap()), (None, vec![4, 5]));
}
