//! The catalogue in a database, and how it and the data folder know each other: by a number that both have, or a service that lacks the folder would take
//! its sessions for lost, and one that lacks the database their files for left-overs.

use super::files::Files;
use super::records::has_objects;
use super::{CATALOG, StoreError, of_catalog};
use cager_store::{Catalog, CatalogError, PostgresCatalog};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Has the number of the folder where its catalogue is in a database.
pub(super) const NUMBER: &str = "catalog.database";
/// Longest file of that name.
pub(super) const LIMIT: u64 = 256;
/// The catalogue's file once a database has all that it had.
const MOVED: &str = "catalog.db.moved";

/// A catalogue in a database, and what it is called.
pub(super) struct Database {
    catalog: Arc<PostgresCatalog>,
    name: PathBuf,
    /// How often it was taken.
    pub(super) taken: i64,
}

/// Opens the catalogue in the database at `url` for this process alone.
pub(super) fn open(url: &str) -> Result<Database, StoreError> {
    let catalog = PostgresCatalog::open(url);
    let catalog = catalog.map_err(|error| of_catalog(Path::new("the database"), "reach", error))?;
    let name = PathBuf::from(catalog.name());
    let failed = |error| match error {
        CatalogError::InUse(what) => StoreError::InUse { what },
        error => of_catalog(&name, "reach", error),
    };
    let taken = catalog.claim().map_err(failed)?;
    Ok(Database { catalog: Arc::new(catalog), name, taken })
}

impl Database {
    /// Sees that it belongs to the folder.
    pub(super) fn check_folder(&self, files: &Files) -> Result<(), StoreError> {
        match_folder(files, &self.catalog, &self.name)
    }

    /// Sees that it belongs to the folder, and takes over what the folder's own catalogue has. Gives what it is called too.
    pub(super) fn of_folder(self, files: &Files) -> Result<(Arc<dyn Catalog>, PathBuf), StoreError> {
        self.check_folder(files)?;
        take_over(files, &self.catalog, &self.name)?;
        Ok((self.catalog, self.name))
    }
}

/// Refuses a folder whose catalogue is in a database.
pub(super) fn refuse(files: &Files) -> Result<(), StoreError> {
    match files.exists(&files.root.join(NUMBER))? {
        true => Err(StoreError::Elsewhere {
            what: format!(
                "what is known of the sessions in the data folder {} is in a database: name it by --catalog",
                files.root.display()
            ),
        }),
        false => Ok(()),
    }
}

/// Sees that the database and the folder belong together; the first time they are made to.
fn match_folder(files: &Files, catalog: &PostgresCatalog, name: &Path) -> Result<(), StoreError> {
    let failed = |error| of_catalog(name, "open", error);
    let path = files.root.join(NUMBER);
    let known = catalog.folder().map_err(failed)?;
    let number = files.read(&path, LIMIT)?.map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    let number = match (number, &known) {
        // Another database may have what is known of it.
        (Some(_), None) if !files.exists(&files.root.join(CATALOG))? && has_objects(files)? => {
            let what = format!(
                "{} is empty, and the data folder {} has sessions: name the database and the schema that know of them, or restore it",
                name.display(),
                files.root.display()
            );
            return Err(StoreError::Elsewhere { what });
        }
        (Some(number), _) => number,
        (None, None) => {
            let number = uuid::Uuid::now_v7().simple().to_string();
            files.replace(&path, format!("{number}\n").as_bytes())?;
            number
        }
        (None, Some(_)) => {
            let what = format!(
                "{} has the sessions of another data folder than {}, which is new: is the right one mounted, and named by --data?",
                name.display(),
                files.root.display()
            );
            return Err(StoreError::Elsewhere { what });
        }
    };
    let known = catalog.set_folder(&number).map_err(failed)?;
    if known == number {
        return Ok(());
    }
    let what = format!(
        "the data folder {} and {} do not belong together: name the right ones by --data and --catalog, or another schema in the address",
        files.root.display(),
        name.display()
    );
    Err(StoreError::Elsewhere { what })
}

/// Copies what the folder's own catalogue has, and puts its file aside.
fn take_over(files: &Files, catalog: &PostgresCatalog, name: &Path) -> Result<(), StoreError> {
    let path = files.root.join(CATALOG);
    if !files.exists(&path)? {
        return Ok(());
    }
    let own = files.disk.catalog(&path).map_err(|error| of_catalog(&path, "open", error))?;
    let copied = cager_store::copy(&*own, catalog).map_err(|error| of_catalog(name, "write", error))?;
    // What its log has is in the file then.
    drop(own);
    files.publish(&path, &files.root.join(MOVED))?;
    tracing::info!(records = copied, to = %name.display(), "the folder's catalogue was copied; its file is {MOVED} now");
    Ok(())
}
