//! One folder of files.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::temporary::{self, Temporary};
use super::{Place, hide_temporary, inherit, sync_folder};
use crate::error::Error;

/// A folder that takes its name once all its files are complete; dropped before
/// [`AtomicDir::commit`] it leaves nothing.
///
/// A killed process leaves it under a hidden name, as with [`AtomicFile`](super::AtomicFile).
#[derive(Debug)]
pub struct AtomicDir {
    path: PathBuf,
    place: Place,
    folder: Temporary,
    /// Files that were there at the beginning and are replaced.
    replaced: BTreeSet<OsString>,
}

impl AtomicDir {
    /// Begins a folder at `path`, where there must be nothing, or a folder with nothing but files
    /// that may be replaced by their names. They go when the new folder takes the name. The folder
    /// around it must exist.
    ///
    /// # Errors
    /// [`Error::Target`] where `path` is a file or a folder with something else in it,
    /// [`Error::Io`] where the folder around it is missing or closed to writing.
    pub fn create(path: impl AsRef<Path>, may_replace: impl Fn(&str) -> bool) -> Result<Self, Error> {
        let path = path.as_ref();
        let place = Place::new(path)?;
        let replaced = check_free(path, &place.target, |name| name.to_str().is_some_and(&may_replace))?;
        let begun = temporary::lock().begin(&place.folder, |path| fs::create_dir(path));
        let ((), folder) = begun.map_err(|cause| hide_temporary(path, &cause))?;
        Ok(Self { path: path.to_owned(), place, folder, replaced })
    }

    /// The folder to write the files into, under its temporary name.
    pub fn folder(&self) -> &Path {
        &self.folder.0
    }

    /// Begins a file in the folder; interruption is no error here, unlike for a file begun by its
    /// path.
    ///
    /// # Errors
    /// Those of [`File::create`].
    pub fn create_file(&self, name: &str) -> io::Result<File> {
        // Not between the removal of the folder and the end of the process.
        let _names = temporary::lock();
        File::create(self.folder().join(name))
    }

    /// Makes the files durable and gives the folder its name.
    ///
    /// # Errors
    /// [`Error::Target`] where someone else has put files there meanwhile, [`Error::Io`]; the
    /// folder is then not created, unless it is its name alone that could not be made durable.
    pub fn commit(self) -> Result<(), Error> {
        let failed = |cause| hide_temporary(&self.path, &cause);
        self.make_durable().map_err(failed)?;
        // Outlives the lock, which removing it takes.
        let mut old = None;
        let (mut names, target) = (temporary::lock(), &self.place.target);
        if target.exists() {
            let aside = names.begin(&self.place.folder, |aside| fs::rename(target, aside)).map_err(failed)?.1;
            let aside = old.insert(aside);
            // Where nobody adds to it any more.
            let free = check_free(&self.path, &aside.0, |name| self.replaced.contains(name));
            if let Err(error) = free {
                names.give_back(&mut old, target).map_err(failed)?;
                return Err(error);
            }
        }
        if let Err(cause) = fs::rename(&self.folder.0, target) {
            names.give_back(&mut old, target).map_err(failed)?;
            return Err(failed(cause));
        }
        drop(names);
        drop(old);
        sync_folder(&self.place.folder).map_err(failed)
    }

    fn make_durable(&self) -> io::Result<()> {
        for entry in fs::read_dir(self.folder())? {
            File::open(entry?.path())?.sync_all()?;
        }
        if cfg!(unix) {
            inherit(&File::open(self.folder())?, &self.place.target)?;
        }
        sync_folder(self.folder())
    }
}

/// What is in the way of a folder: nothing, or files that may be replaced.
fn check_free(
    path: &Path,
    target: &Path,
    may_replace: impl Fn(&OsString) -> bool,
) -> Result<BTreeSet<OsString>, Error> {
    let entries = match fs::read_dir(target) {
        Ok(entries) => entries,
        Err(cause) => match cause.kind() {
            io::ErrorKind::NotFound => return Ok(BTreeSet::new()),
            io::ErrorKind::NotADirectory => {
                return Err(Error::target(path, "is a file; name a folder, or remove the file first"));
            }
            _ => return Err(Error::write(path, cause)),
        },
    };
    let mut replaced = BTreeSet::new();
    for entry in entries {
        let entry = entry.map_err(|cause| Error::write(path, cause))?;
        let name = entry.file_name();
        if !(entry.file_type().is_ok_and(|kind| kind.is_file()) && may_replace(&name)) {
            return Err(not_empty(path, &name));
        }
        replaced.insert(name);
    }
    Ok(replaced)
}

fn not_empty(path: &Path, holds: &OsStr) -> Error {
    Error::target(
        path,
        format!("is a folder that is not empty, as it holds {}; empty it or name another", holds.display()),
    )
}
