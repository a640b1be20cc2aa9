//! What the store's tests share.

use super::faults::FaultyDisk;
use super::{CagePlace, Completion, Content, ContentKey, FrameEntry, Idempotency, NamedFile, NewFrame, Opened, Shared};
use super::{SessionMeta, Store, StoreError};
use cager_core::cage::Cage;
use cager_core::coordinates;
use cager_core::inversion::{Handles, Solver, SolverOptions};
use cager_demo::{Capture, Options};
use cager_proto::messages::SessionOptions;
use std::io;
use std::path::Path;
use std::sync::{Arc, LazyLock};
use tempfile::TempDir;

mod cage_jobs;
mod faults;
mod prepared;
mod recoveries;
mod sessions;

pub(crate) const EIO: i32 = 5;
pub(crate) const ENOSPC: i32 = 28;
/// Of every cage here.
pub(crate) const ROWS: u32 = 5;

/// An empty folder on a disk that can fail.
pub(crate) struct Given {
    folder: TempDir,
    pub(crate) disk: FaultyDisk,
}

impl Given {
    pub(crate) fn new() -> Self {
        // The disk is made up, so memory does, where the system offers it as a folder.
        let memory = tempfile::tempdir_in("/dev/shm");
        let folder = memory.or_else(|_| tempfile::tempdir()).unwrap();
        let disk = FaultyDisk::new(folder.path()).unwrap();
        Self { folder, disk }
    }

    pub(crate) fn root(&self) -> &Path {
        self.folder.path()
    }

    pub(crate) fn open(&self) -> Opened {
        Store::open(self.root(), Arc::new(self.disk.clone()), Shared::default()).unwrap()
    }
}

pub(crate) fn meta(id: &str) -> SessionMeta {
    SessionMeta {
        id: id.into(),
        tenant: "someone".into(),
        created_ms: 1_700_000_000_000,
        key: KEY,
        options: SessionOptions { lambda: Some(0.1 + 0.2), name: Some("Ärmel".into()), ..SessionOptions::default() },
        solver_version: cager_core::SOLVER_VERSION,
        renamed: None,
        made_cage: None,
        idempotency: Some(Idempotency { key: "k".into(), fingerprint: "f".into() }),
    }
}

pub(crate) const KEY: ContentKey = ContentKey([0xa7; 32]);

pub(crate) fn content() -> Content {
    Content {
        rest: NamedFile { name: "rest.obj".into(), bytes: vec![1; 5000] },
        cage: NamedFile { name: "cage.ply".into(), bytes: vec![2; 70] },
        matrix: Some(NamedFile { name: "d.mtx".into(), bytes: vec![3; 40] }),
    }
}

pub(crate) fn prepare(handles: Handles) -> Solver {
    prepare_with("mvc", SolverOptions { handles, ..SolverOptions::PAPER })
}

pub(crate) fn prepare_with(system: &str, options: SolverOptions) -> Solver {
    let capture = Capture::new(&Options { points: 400, frames: 2, cage_vertices: 40 });
    let cage = Cage::new(capture.cage.clone()).unwrap();
    Solver::prepare(coordinates::by_name(system).unwrap(), &cage, &capture.rest.points, options).unwrap()
}

pub(crate) static SOLVER: LazyLock<Solver> = LazyLock::new(|| prepare(Handles::MaxVol));

pub(crate) fn write_frames(out: &mut dyn io::Write) -> io::Result<()> {
    (0..1000u32).try_for_each(|i| out.write_all(&i.to_le_bytes()))
}

pub(crate) fn completion() -> Completion {
    let mut bytes = Vec::new();
    write_frames(&mut bytes).unwrap();
    Completion {
        frames: 6,
        container_bytes: bytes.len() as u64,
        container_digest: blake3::hash(&bytes).to_hex().to_string(),
    }
}

pub(crate) fn cage(frame: u32) -> Vec<f32> {
    (0..3 * ROWS).map(|i| frame as f32 * 100.0 + i as f32 + 0.25).collect()
}

pub(crate) fn entry(frame: u32) -> FrameEntry {
    let f = f64::from(frame);
    let measured = frame.is_multiple_of(2);
    FrameEntry {
        frame,
        place: CagePlace::default(),
        l2: if measured { frame as f32 + 0.5 } else { f32::NAN },
        linf: if measured { frame as f32 + 0.75 } else { f32::NAN },
        squared: f * 3.0,
        spread: f * 7.0,
        handle_digest: [frame as u8; 16],
        full_digest: measured.then_some([!(frame as u8); 16]),
    }
}

pub(crate) fn append(store: &Store, id: &str, frames: &[u32]) -> Result<Vec<FrameEntry>, StoreError> {
    let cages: Vec<Vec<f32>> = frames.iter().map(|&frame| cage(frame)).collect();
    let new = frames.iter().zip(&cages).map(|(&frame, cage)| NewFrame { entry: entry(frame), cage });
    store.append_frames(id, &new.collect::<Vec<_>>())
}

/// The frames of a session, each of which has to be what was appended to the bit.
pub(crate) fn frames(store: &Store, id: &str) -> Result<Vec<u32>, StoreError> {
    let (entries, mut bytes) = (store.frames(id)?, Vec::new());
    store.cages(id, &entries, &mut bytes)?;
    let expected: Vec<u8> = entries.iter().flat_map(|e| cage(e.frame)).flat_map(f32::to_le_bytes).collect();
    assert!(bytes == expected, "other cages than were stored");
    for found in &entries {
        let right = entry(found.frame);
        assert!(found.l2 == right.l2 || (found.l2.is_nan() && right.l2.is_nan()));
        assert!(found.linf == right.linf || (found.linf.is_nan() && right.linf.is_nan()));
        assert_eq!((found.squared, found.spread), (right.squared, right.spread));
        assert_eq!((found.handle_digest, found.full_digest), (right.handle_digest, right.full_digest));
    }
    Ok(entries.iter().map(|entry| entry.frame).collect())
}
