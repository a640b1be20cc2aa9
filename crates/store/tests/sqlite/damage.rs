//! Rows that are not as they were written.

use crate::conformance::{append, bytes, cage, cages, open};
use crate::support::Dir;
use cager_store::{Catalog, CatalogError};

fn is_damaged<T>(read: &Result<T, CatalogError>) -> bool {
    matches!(read, Err(CatalogError::Damaged(_) | CatalogError::Corrupt(_)))
}

#[test]
fn a_changed_column_of_a_frame_is_found() {
    let dir = Dir::new();
    let catalog = dir.open();
    ["a", "b"].into_iter().for_each(|id| open(&catalog, id));
    append(&catalog, "b", &[(9, cage(9, 8))]);
    let stored = append(&catalog, "a", &[0, 1, 2].map(|frame| (frame, cage(frame, 8))));
    let mut beside = dir.beside();
    for change in [
        "frame = 77",
        "record = (SELECT number FROM records WHERE id = 'b')",
        "chunk = chunk + 1",
        "chunk = -chunk",
        "place = place + 1",
        "place = -1",
        "bytes = bytes - 1",
        "bytes = 1 << 40",
        "cage_crc = cage_crc + 1",
        "cage_crc = -1",
        "l2 = NULL",
        "l2 = l2 * 1.001",
        "linf = 0",
        "squared = squared + 1e-9",
        "spread = -spread",
        "handle_digest = zeroblob(16)",
        "handle_digest = zeroblob(15)",
        "full_digest = NULL",
        "full_digest = zeroblob(16)",
        "full_digest = zeroblob(17)",
        "crc = crc + 1",
        "crc = 1 << 33",
        "frame = -1",
        "frame = 1 << 32",
    ] {
        beside.run("CREATE TEMP TABLE kept AS SELECT * FROM frames");
        let sql = format!("UPDATE frames SET {change} WHERE frame = 1");
        assert_eq!(beside.run(&sql), 1);
        let read = [catalog.frames("a"), catalog.frames("b")];
        assert!(read.iter().any(is_damaged), "{change}: {read:?}");
        assert!(!is_damaged(&catalog.record(crate::conformance::session("a"))));
        beside.run("DELETE FROM frames; INSERT INTO frames SELECT * FROM kept; DROP TABLE kept");
        assert_eq!(catalog.frames("a"), Ok(stored.clone()), "restored");
    }
}

#[test]
fn a_flipped_bit_of_a_cage_is_found_and_the_others_are_read() {
    let dir = Dir::new();
    let catalog = dir.open();
    open(&catalog, "a");
    let stored = append(&catalog, "a", &[0, 1, 2].map(|frame| (frame, cage(frame, 8))));
    let mut beside = dir.beside();
    let chunk = beside.bytes("SELECT bytes FROM chunks");
    let mut out = b"kept".to_vec();
    let cut = chunk[..200].to_vec();
    let flipped = (0..8).map(|bit| {
        let mut flipped = chunk.clone();
        flipped[96 + 13 * bit] ^= 1 << bit;
        (flipped, vec![1])
    });
    for (changed, damaged) in flipped.chain([(cut, vec![2]), (Vec::new(), vec![0, 1, 2])]) {
        let hex: String = changed.iter().map(|byte| format!("{byte:02x}")).collect();
        beside.run(&format!("UPDATE chunks SET bytes = x'{hex}'"));
        for entry in &stored {
            let read = catalog.cages("a", std::slice::from_ref(entry), &mut out);
            assert_eq!(is_damaged(&read), damaged.contains(&entry.frame), "{}: {read:?}", entry.frame);
            if let Err(error) = read {
                assert!(error.to_string().contains(&format!("frame {}", entry.frame)), "{error}");
            }
            out.truncate(4);
        }
        assert!(is_damaged(&catalog.cages("a", &stored, &mut out)));
        assert_eq!(out, b"kept");
    }
    beside.run("DELETE FROM chunks");
    assert!(is_damaged(&catalog.cages("a", &stored, &mut out)));
    let again = append(&catalog, "a", &[(0, cage(5, 8))]);
    assert_eq!(cages(&catalog, "a", &again), bytes(&cage(5, 8)), "a frame stored again is there again");
    assert!(is_damaged(&catalog.cages("a", &stored[..1], &mut out)), "its earlier entry does not give the new cage");
}

#[test]
fn a_record_with_an_unknown_number_is_left_out() {
    let dir = Dir::new();
    let catalog = dir.open();
    open(&catalog, "a");
    for change in ["kind = 9", "phase = 200", "phase = -1", "attempts = 1 << 40", "declared = -5"] {
        dir.beside().run(&format!("UPDATE records SET {change}"));
        assert_eq!(catalog.records(), Ok(Vec::new()), "{change}");
        dir.beside().run("UPDATE records SET kind = 0, phase = 68, attempts = 0, declared = NULL");
        assert_eq!(catalog.records().map(|records| records.len()), Ok(1));
    }
}

#[test]
fn a_damaged_page_of_the_file_is_found() {
    let dir = Dir::new();
    let catalog = dir.open();
    open(&catalog, "a");
    let new: Vec<_> = (0..500).map(|frame| (frame, cage(frame, 8))).collect();
    append(&catalog, "a", &new);
    drop(catalog);
    let mut file = std::fs::read(dir.file()).expect("the file");
    // All but the first page, which says what the file is.
    file[4096..].fill(0x5a);
    std::fs::write(dir.file(), file).expect("written");
    let read = cager_store::SqliteCatalog::open(&dir.file()).and_then(|catalog| catalog.frames("a"));
    assert!(is_damaged(&read), "{read:?}");
}
