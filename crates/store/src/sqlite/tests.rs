//! What cannot be asked of a catalogue from outside.

use super::SqliteCatalog;
use crate::{Catalog as _, CatalogError};

#[test]
fn work_that_panics_is_undone_and_others_go_on() {
    let dir = tempfile::tempdir().expect("a folder");
    let catalog = SqliteCatalog::open(&dir.path().join("catalogue")).expect("a catalogue");
    let outcome = catalog.write(|connection| -> Result<(), CatalogError> {
        connection.execute("INSERT INTO chunks (record, bytes) VALUES (1, x'00')", [])?;
        panic!("on purpose");
    });
    assert_eq!(outcome, Err(CatalogError::Failed("writing panicked".to_owned())));
    assert_eq!(catalog.probe(), Ok(()));
    let count = |connection: &rusqlite::Connection| {
        Ok(connection.query_row("SELECT count(*) FROM chunks", [], |row| row.get::<_, u32>(0))?)
    };
    assert_eq!(catalog.write(count), Ok(0));
}
