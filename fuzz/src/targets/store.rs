//! What the service finds on its disk. Where the first byte says so, checksums are made right first.

use super::{byte, mend};
use crate::Target;
use crate::disk::MemoryDisk;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_core::inversion::{Rows, Solver, SolverOptions};
use cager_geometry::mesh::TriMesh;
use cager_proto::messages::SessionOptions;
use cager_service::store::{Content, ContentKey, Kind, NamedFile, SessionMeta, Shared, Store};
use std::path::Path;
use std::sync::Arc;

const KEY: ContentKey = ContentKey([7; 32]);
const ID: &str = "f";
const LOG_PATH: &str = "/data/sessions/f/frames.log";
const SOLVER_PATH: &str = "/data/prepared/0707070707070707070707070707070707070707070707070707070707070707.solver";

fn open(disk: &MemoryDisk) -> Store {
    Store::open(Path::new("/data"), Arc::new(disk.clone()), Shared::default()).expect("a store").store
}

/// The second byte says how many rows the session's cages have.
pub(super) const LOG: Target = Target {
    name: "log",
    run: log,
    seeds: || {
        let log = |mode: u8, rows: u8, frames: &[u32]| {
            let mut file = vec![0; 4096];
            file[..8].copy_from_slice(b"CGRLOG\r\n");
            file[8] = 1;
            file[12] = rows;
            file[16..16 + ID.len()].copy_from_slice(ID.as_bytes());
            for frame in frames {
                let durable = file.len() as u64;
                let start = file.len();
                file.resize(start + 72 + 12 * usize::from(rows) + 4, 0);
                file[start..start + 4].copy_from_slice(&frame.to_le_bytes());
                file[start + 4] = u8::from(frame.is_multiple_of(2));
                file[start + 32..start + 40].copy_from_slice(&durable.to_le_bytes());
            }
            mend_log(&mut file, rows.into(), true);
            [&[mode, rows], &file[..]].concat()
        };
        vec![log(0, 1, &[]), log(1, 2, &[4, 5, 0]), log(3, 1, &[1, 2, 1, 3])]
    },
    words: &["CGRLOG\r\n"],
    fixed: 4 << 20,
    per_byte: 32,
};

fn log(mut bytes: &[u8]) {
    let (mode, rows) = (byte(&mut bytes), u32::from(byte(&mut bytes) % 8));
    let mut file = bytes.to_vec();
    if mode & 1 != 0 {
        mend_log(&mut file, rows as usize, mode & 2 != 0);
    }
    let disk = MemoryDisk::default();
    drop(open(&disk));
    let folder = Path::new(LOG_PATH).parent().expect("a folder");
    cager_service::store::Disk::create_dir(&disk, folder).expect("a folder");
    disk.put(Path::new(FILES[0].0), &session_file());
    disk.put(Path::new(LOG_PATH), &file);
    let opened =
        Store::open(Path::new("/data"), Arc::new(disk.clone()), Shared::default()).expect("damage is no error");
    let store = opened.store;
    if !opened.quarantined.is_empty() {
        return;
    }
    assert!(opened.sessions.iter().map(|meta| &meta.id).eq([ID]), "the session is not accounted for");
    let entries = store.frames(ID).expect("what was taken over is readable");
    let mut cages = Vec::new();
    store.cages(ID, &entries, &mut cages).expect("what was given is readable");
    let is_damaged = store.damage(Kind::Session, ID).expect("a record").is_some();
    assert_eq!(disk.get(Path::new(LOG_PATH)).is_some(), is_damaged, "a damaged log stays, and no other");
}

/// The file of a session's metadata, as earlier versions wrote it.
fn session_file() -> Vec<u8> {
    let body = serde_json::to_vec(&meta()).expect("metadata");
    [head("session", &body).as_bytes(), &body, b"}\n"].concat()
}

fn meta() -> SessionMeta {
    let options = SessionOptions { lambda: Some(0.3), name: Some("n".into()), ..SessionOptions::default() };
    let idempotency = Some(cager_service::store::Idempotency { key: "k".into(), fingerprint: "f".into() });
    SessionMeta {
        made_cage: None,
        renamed: None,
        id: ID.into(),
        tenant: "t".into(),
        created_ms: 1,
        key: KEY,
        solver_version: 1,
        options,
        idempotency,
    }
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
        let content = Content {
            rest: NamedFile { name: "a.obj".into(), bytes: vec![1] },
            cage: NamedFile { name: "b.obj".into(), bytes: vec![2] },
            matrix: None,
        };
        store.put_content(&KEY, &content).expect("content");
        let completion =
            cager_service::store::Completion { frames: 6, container_bytes: 7, container_digest: "00".into() };
        let described = disk.get(Path::new(FILES[2].0)).expect("a file");
        let content = described[head("content", b"").len()..described.len() - 2].to_vec();
        let json = |value: serde_json::Result<Vec<u8>>| value.expect("JSON");
        let bodies = [json(serde_json::to_vec(&meta())), json(serde_json::to_vec(&completion)), content];
        let seeds = FILES.iter().zip(bodies).enumerate().flat_map(|(k, ((_, kind), body))| {
            let file = [head(kind, &body).as_bytes(), &body, b"}\n"].concat();
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
    cager_service::store::Disk::create_dir(&disk, folder).expect("a folder");
    disk.put(Path::new(path), &file);
    if kind == "completion" {
        disk.put(Path::new(FILES[0].0), &session_file());
    }
    let opened =
        Store::open(Path::new("/data"), Arc::new(disk.clone()), Shared::default()).expect("damage is no error");
    if kind == "session" {
        assert_eq!(opened.sessions.len() + opened.quarantined.len(), 1, "the session is not accounted for");
        assert!(opened.sessions.iter().all(|meta| meta.id == ID));
    }
    let store = opened.store;
    if let Ok(Some(completion)) = store.completion(ID) {
        assert_eq!(kind, "completion");
        store.complete(ID, &completion, None::<&()>).expect("it can be written again");
    }
    // Where it says that the parts are of other bytes than are there.
    let content = store.content(&KEY);
    assert!(!matches!(content, Ok(Some(_))), "content without its parts");
}
