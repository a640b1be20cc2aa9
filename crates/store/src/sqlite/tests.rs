//! What cannot be asked of a catalogue from outside.

use super::SqliteCatalog;
use crate::trouble::Trouble;
use crate::{Catalog as _, CatalogError};

#[test]
fn work_that_panics_is_undone_and_others_go_on() {
    let dir = tempfile::tempdir().expect("a folder");
    let catalog = SqliteCatalog::open(&dir.path().join("catalogue")).expect("a catalogue");
    let outcome = catalog.run(|link| -> Result<(), Trouble> {
        link.execute("INSERT INTO chunks (record, bytes) VALUES (1, x'00')", &[])?;
        panic!("on purpose");
    });
    assert_eq!(outcome, Err(CatalogError::Failed("writing panicked".to_owned())));
    assert_eq!(catalog.probe(), Ok(()));
    assert_eq!(catalog.run(|link| link.only::<i64>("SELECT count(*) FROM chunks", &[])), Ok(0));
}
