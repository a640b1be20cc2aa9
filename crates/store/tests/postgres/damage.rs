//! Rows that are not as they were written.

use crate::conformance::{append, cage, open};
use crate::support::Server;
use cager_store::{Catalog, CatalogError};

#[test]
fn changed_rows_are_found() {
    let Some(server) = Server::start() else { return };
    let catalog = server.open();
    open(&catalog, "a");
    let stored = append(&catalog, "a", &[0, 1, 2].map(|frame| (frame, cage(frame, 8))));
    server.sql("CREATE TABLE kept AS SELECT * FROM frames");
    for change in [
        "frame = 77",
        "frame = -1",
        "bytes = 1::bigint << 40",
        "l2 = l2 * 1.001",
        "full_digest = NULL",
        "handle_digest = ''",
        "crc = crc + 1",
    ] {
        server.sql(&format!("UPDATE frames SET {change} WHERE frame = 1"));
        let read = catalog.frames("a");
        assert!(matches!(read, Err(CatalogError::Damaged(_))), "{change}: {read:?}");
        server.sql("DELETE FROM frames; INSERT INTO frames SELECT * FROM kept");
        assert_eq!(catalog.frames("a"), Ok(stored.clone()), "restored");
    }
    server.sql("UPDATE chunks SET bytes = set_byte(bytes, 100, get_byte(bytes, 100) # 1)");
    let mut out = b"kept".to_vec();
    let error = catalog.cages("a", &stored, &mut out).expect_err("it was read");
    assert!(matches!(&error, CatalogError::Damaged(what) if what.contains("frame 1")), "{error}");
    assert_eq!(out, b"kept");
    assert_eq!(catalog.cages("a", &stored[2..], &mut out), Ok(()));
    server.sql("UPDATE records SET phase = 3");
    assert_eq!(catalog.records(), Ok(Vec::new()));
    assert!(matches!(catalog.record(crate::conformance::session("a")), Err(CatalogError::Damaged(_))));
}
