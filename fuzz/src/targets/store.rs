//! What the service finds on its disk. Where the first byte says so, checksums are made right first.

use super::{byte, mend};
use crate::Target;
use crate::disk::MemoryDisk;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green, MeanValue};
use cager_core::inversion::{Rows, Solver, SolverOptions};
use cager_geometry::mesh::TriMesh;
use cager_service::store::{Content, ContentKey, NamedFile, Shared, Store};
use std::path::Path;
use std::sync::Arc;

const KEY: ContentKey = ContentKey([7; 32]);
const SOLVER_PATH: &str = "/data/prepared/0707070707070707070707070707070707070707070707070707070707070707.solver";

fn open(disk: &MemoryDisk) -> Store {
    Store::open(Path::new("/data"), Arc::new(disk.clone()), Shared::default()).expect("a store").store
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

/// The file that describes content; the first byte says whether its wrapper is made right.
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
        let file = disk.get(Path::new(CONTENT_PATH)).expect("a file");
        let body = &file[head(b"").len()..file.len() - 2];
        vec![[&[0], &file[..]].concat(), [&[0x80], body].concat()]
    },
    words: &[
        "{\"format\":1,\"kind\":\"content\"",
        "\"blake3\":\"",
        "\"body\":",
        "}\n",
        "null",
        "\"../\"",
        "\"rest\":",
        "\"bytes\":",
    ],
    fixed: 4 << 20,
    per_byte: 256,
};

const CONTENT_PATH: &str =
    "/data/contents/0707070707070707070707070707070707070707070707070707070707070707/content.json";

fn head(body: &[u8]) -> String {
    format!(r#"{{"format":1,"kind":"content","blake3":"{}","body":"#, blake3::hash(body).to_hex())
}

fn small_file(mut bytes: &[u8]) {
    let mode = byte(&mut bytes);
    let file = if mode & 0x80 == 0 { bytes.to_vec() } else { [head(bytes).as_bytes(), bytes, b"}\n"].concat() };
    let disk = MemoryDisk::default();
    drop(open(&disk));
    let path = Path::new(CONTENT_PATH);
    cager_service::store::Disk::create_dir(&disk, path.parent().expect("a folder")).expect("a folder");
    disk.put(path, &file);
    // Where it says that the parts are of other bytes than are there.
    let content = open(&disk).content(&KEY);
    assert!(!matches!(content, Ok(Some(_))), "content without its parts");
}
