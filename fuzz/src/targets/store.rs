//! What the service finds on its disk. Where the first byte says so, checksums are made right first.

use super::{byte, mend};
use crate::Target;
use crate::disk::MemoryDisk;
use cager::store::{Content, ContentKey, LogEntry, LogRecord, NamedFile, SessionMeta, Store};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_core::inversion::{Rows, Solver, SolverOptions};
use cager_geometry::mesh::TriMesh;
use cager_proto::messages::SessionOptions;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

const KEY: ContentKey = ContentKey([7; 32]);
const ID: &str = "f";
const LOG_PATH: &str = "/data/sessions/f/frames.log";
const SOLVER_PATH: &str = "/data/prepared/0707070707070707070707070707070707070707070707070707070707070707.solver";

fn open(disk: &MemoryDisk) -> Store {
    Store::open(Path::new("/data"), Arc::new(disk.clone())).expect("a store").store
}

/// The second byte says how many rows the session's cages have.
pub(super) const LOG: Target = Target {
    name: "log",
    run: log,
    seeds: || {
        let log = |mode: u8, rows: u8, groups: &[&[u32]]| {
            let disk = MemoryDisk::default();
            let (mut log, _) = open(&disk).open_log(ID, rows.into()).expect("a log");
            let cage = vec![0.5; 3 * usize::from(rows)];
            for frames in groups {
                let records: Vec<_> = frames.iter().map(|&frame| record(frame, &cage)).collect();
                log.append(&records).expect("an append");
            }
            [&[mode, rows], &disk.get(Path::new(LOG_PATH)).expect("a file")[..]].concat()
        };
        vec![log(0, 1, &[]), log(1, 2, &[&[4, 5], &[0]]), log(3, 1, &[&[1], &[2], &[1, 3]])]
    },
    words: &["CGRLOG\r\n"],
    fixed: 4 << 20,
    per_byte: 32,
};

fn record(frame: u32, cage: &[f32]) -> LogRecord<'_> {
    let full_digest = frame.is_multiple_of(2).then_some([3; 16]);
    let entry = LogEntry {
        frame,
        offset: 0,
        l2: 0.5,
        linf: f32::NAN,
        squared: 1.0,
        spread: 2.0,
        handle_digest: [frame as u8; 16],
        full_digest,
    };
    LogRecord { entry, cage }
}

fn log(mut bytes: &[u8]) {
    let (mode, rows) = (byte(&mut bytes), u32::from(byte(&mut bytes) % 8));
    let mut file = bytes.to_vec();
    if mode & 1 != 0 {
        mend_log(&mut file, rows as usize, mode & 2 != 0);
    }
    let disk = MemoryDisk::default();
    disk.put(Path::new(LOG_PATH), &file);
    let store = open(&disk);
    let opened = store.open_log(ID, rows);
    let Ok((mut log, entries)) = opened else {
        assert_eq!(disk.get(Path::new(LOG_PATH)).expect("a file"), file, "a damaged log was changed");
        return;
    };
    let frames: HashSet<u32> = entries.iter().map(|entry| entry.frame).collect();
    assert_eq!(frames.len(), entries.len(), "a frame twice");
    let mut cages = Vec::new();
    log.reader().read_cages(&entries, &mut cages).expect("what was given is readable");
    assert_eq!(cages.len(), entries.len() * 12 * rows as usize);
    let cage = vec![1.0; 3 * rows as usize];
    let new = (0..).find(|frame| !frames.contains(frame)).unwrap_or_default();
    log.append(&[record(new, &cage)]).expect("an append");
    drop(log);
    let (_, again) = store.open_log(ID, rows).expect("a log that was just written");
    assert_eq!(again.len(), entries.len() + 1);
    let same = |(a, b): (&LogEntry, &LogEntry)| (a.frame, a.offset) == (b.frame, b.offset);
    assert!(entries.iter().zip(&again).all(same), "other frames the second time");
}

/// Makes the checksums of the header, the records, and with `marks` of the marks right.
fn mend_log(file: &mut [u8], rows: usize, marks: bool) {
    if file.len() < 4096 {
        return;
    }
    mend(file, 0, 80, 80);
    let seed = crc32c::crc32c(&file[..80]);
    if marks {
        for at in [512, 1024] {
            let crc = crc32c::crc32c_append(seed, &file[at..at + 8]);
            file[at + 8..at + 12].copy_from_slice(&crc.to_le_bytes());
        }
    }
    let stride = 72 + 12 * rows + 4;
    for (k, record) in file[4096..].chunks_exact_mut(stride).enumerate() {
        let offset = (4096 + k * stride) as u64;
        let (body, crc) = record.split_at_mut(stride - 4);
        let right = crc32c::crc32c_append(crc32c::crc32c_append(seed, &offset.to_le_bytes()), body);
        crc.copy_from_slice(&right.to_le_bytes());
    }
}

pub(super) const SOLVER: Target = Target {
    name: "solver",
    run: solver,
    seeds: || {
        let corner = |k: u8| [k & 1, k >> 1 & 1, k >> 2 & 1].map(|bit| f64::from(bit) * 2.0 - 1.0);
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let cage = Cage::new(TriMesh { vertices: (0..8).map(corner).collect(), triangles }).expect("a cube");
        let points: Vec<_> =
            (0..24_u8).map(|k| [0.3, 0.5, 0.7].map(|x| (f64::from(k) * x * 1.7).sin() * 0.6)).collect();
        let options = SolverOptions { spectrum: 2, ..SolverOptions::default() };
        let systems: [&dyn CoordinateSystem; 2] = [&MeanValue, &Green::Consistent];
        let seeds = systems.into_iter().flat_map(|system| {
            let solver = Solver::prepare(system, &cage, &points, options).expect("a solver");
            let disk = MemoryDisk::default();
            open(&disk).put_prepared(&KEY, &solver).expect("a file");
            let file = disk.get(Path::new(SOLVER_PATH)).expect("a file");
            [[&[0], &file[..]].concat(), [&[1], &file[..]].concat()]
        });
        seeds.collect()
    },
    words: &["CGRSOLV\u{4}"],
    fixed: 4 << 20,
    per_byte: 64,
};

const SOLVER_HEADER: usize = 260;

fn solver(mut bytes: &[u8]) {
    let mode = byte(&mut bytes);
    let mut file = bytes.to_vec();
    if mode & 1 != 0 && file.len() >= SOLVER_HEADER + 4 {
        let end = file.len() - 4;
        mend(&mut file, 0, SOLVER_HEADER - 4, SOLVER_HEADER - 4);
        mend(&mut file, 0, end, end);
    }
    let disk = MemoryDisk::default();
    disk.put(Path::new(SOLVER_PATH), &file);
    let store = open(&disk);
    let Some(solver) = store.prepared(&KEY).expect("damage is no error") else {
        assert!(disk.get(Path::new(SOLVER_PATH)).is_none(), "a damaged solver stays");
        return;
    };
    let decoder = solver.decoder();
    assert!(4 * decoder.points() * decoder.columns() <= file.len());
    assert!(solver.handles().iter().all(|&handle| (handle as usize) < decoder.points()), "a handle lies outside");
    let cage = vec![0.5; 3 * decoder.unknowns()];
    let mut out = [Vec::new()];
    decoder.decode(&[&cage[..]], &mut out);
    assert_eq!(out[0].len(), 3 * decoder.points());
    let frame = vec![0.5_f32; 3 * decoder.points()];
    solver.invert(Rows::All, None, &[&frame[..]]);
}

/// The first byte says which file it is, and whether its wrapper is made right.
pub(super) const SMALL_FILES: Target = Target {
    name: "small-files",
    run: small_file,
    seeds: || {
        let disk = MemoryDisk::default();
        let store = open(&disk);
        let options = SessionOptions { lambda: Some(0.3), name: Some("n".into()), ..SessionOptions::default() };
        let idempotency = Some(cager::store::Idempotency { key: "k".into(), fingerprint: "f".into() });
        let meta = SessionMeta {
            made_cage: None,
            id: ID.into(),
            tenant: "t".into(),
            created_ms: 1,
            key: KEY,
            solver_version: 1,
            options,
            idempotency,
        };
        store.create_session(&meta).expect("a session");
        let completion = cager::store::Completion { frames: 6, container_bytes: 7, container_digest: "00".into() };
        store.complete(ID, &completion).expect("a completion");
        let content = Content {
            rest: NamedFile { name: "a.obj".into(), bytes: vec![1] },
            cage: NamedFile { name: "b.obj".into(), bytes: vec![2] },
            matrix: None,
        };
        store.put_content(&KEY, &content).expect("content");
        let seeds = FILES.iter().enumerate().flat_map(|(k, (path, kind))| {
            let file = disk.get(Path::new(path)).expect("a file");
            let body = file[head(kind, b"").len()..file.len() - 2].to_vec();
            [[&[k as u8], &file[..]].concat(), [&[k as u8 | 0x80], &body[..]].concat()]
        });
        seeds.collect()
    },
    words: &[
        "{\"format\":1,\"kind\":\"",
        "\"blake3\":\"",
        "\"body\":",
        "}\n",
        "null",
        "\"id\":",
        "\"tenant\":",
        "\"created_ms\":",
        "\"../\"",
        "\"options\":{",
        "\"frames\":",
        "\"bytes\":",
    ],
    fixed: 4 << 20,
    per_byte: 256,
};

const FILES: [(&str, &str); 3] = [
    ("/data/sessions/f/session.json", "session"),
    ("/data/sessions/f/complete.json", "completion"),
    ("/data/contents/0707070707070707070707070707070707070707070707070707070707070707/content.json", "content"),
];

fn head(kind: &str, body: &[u8]) -> String {
    format!(r#"{{"format":1,"kind":"{kind}","blake3":"{}","body":"#, blake3::hash(body).to_hex())
}

fn small_file(mut bytes: &[u8]) {
    let mode = byte(&mut bytes);
    let (path, kind) = FILES[usize::from(mode & 0x7f) % FILES.len()];
    let file = if mode & 0x80 == 0 { bytes.to_vec() } else { [head(kind, bytes).as_bytes(), bytes, b"}\n"].concat() };
    let disk = MemoryDisk::default();
    drop(open(&disk));
    let folder = Path::new(path).parent().expect("a folder");
    cager::store::Disk::create_dir(&disk, folder).expect("a folder");
    disk.put(Path::new(path), &file);
    let opened = Store::open(Path::new("/data"), Arc::new(disk.clone())).expect("damage is no error");
    if kind == "session" {
        assert_eq!(
            opened.sessions.len() + opened.quarantined.len() + opened.unread.len(),
            1,
            "the session is not accounted for"
        );
        assert!(opened.sessions.iter().all(|meta| meta.id == ID));
    }
    let store = opened.store;
    if let Ok(Some(completion)) = store.completion(ID) {
        assert_eq!(kind, "completion");
        store.complete("g", &completion).expect("it can be written again");
    }
    // Where it says that the parts are of other bytes than are there.
    let content = store.content(&KEY);
    assert!(!matches!(content, Ok(Some(_))), "content without its parts");
}
