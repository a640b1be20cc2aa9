//! One folder of files.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::temporary::{self, Temporary};
use super::{Place, hide_temporary, sync_folder};
use crate::error::Error;

/// A folder that takes its name once all its files are complete; dropped before [`AtomicDir::commit`] it leaves
/// nothing.
///
/// A folder cannot be without a name, so a process that is killed leaves it under a temporary one, beginning with
/// `.cager-`; on a signal that can be caught, [`remove_temporaries`](super::remove_temporaries) removes it.
#[derive(Debug)]
pub struct AtomicDir {
    path: PathBuf,
    place: Place,
    folder: Temporary,
}

impl AtomicDir {
    /// Begins a folder at `path`, where there must be nothing or an empty folder; the folder around it must exist.
    ///
    /// # Errors
    /// [`Error::Target`] where `path` is a file or a folder with something in it, [`Error::Io`] where the folder around
    /// it is missing or closed to writing.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let place = Place::new(path)?;
        check_free(path, &place.target)?;
        let begun = temporary::lock().begin(&place.folder, |path| fs::create_dir(path));
        let ((), folder) = begun.map_err(|cause| hide_temporary(path, &cause))?;
        Ok(Self { path: path.to_owned(), place, folder })
    }

    /// The path as it was given to [`AtomicDir::create`].
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The folder to write the files into, under its temporary name.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Begins a file in the folder; interruption is no error here, unlike for a file begun by its path.
    ///
    /// # Errors
    /// Those of [`File::create`].
    pub fn create_file(&self, name: &str) -> io::Result<File> {
        // Not between the removal of the folder and the end of the process.
        let _live = temporary::lock();
        File::create(self.folder().join(name))
    }

    /// Makes the files durable and gives the folder its name.
    ///
    /// # Errors
    /// [`Error::Target`] where someone else has put files there meanwhile, [`Error::Io`]; the folder is then not
    /// created, unless it is its name alone that could not be made durable.
    pub fn commit(self) -> Result<(), Error> {
        check_free(&self.path, &self.place.target)?;
        self.put_in_place().map_err(|cause| match cause.kind() {
            io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists => occupied(&self.path),
            _ => hide_temporary(&self.path, &cause),
        })
    }

    fn put_in_place(&self) -> io::Result<()> {
        for entry in fs::read_dir(self.folder())? {
            File::open(entry?.path())?.sync_all()?;
        }
        sync_folder(self.folder())?;
        {
            let mut live = temporary::lock();
            if cfg!(not(unix)) && self.place.target.exists() {
                fs::remove_dir(&self.place.target)?;
            }
            live.rename(&self.folder, &self.place.target)?;
        }
        self.place.sync_folder()
    }
}

fn check_free(path: &Path, target: &Path) -> Result<(), Error> {
    match fs::read_dir(target) {
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => Err(occupied(path)),
        },
        Err(cause) => match cause.kind() {
            io::ErrorKind::NotFound => Ok(()),
            io::ErrorKind::NotADirectory => {
                Err(Error::target(path, "is a file; name a folder, or remove the file first"))
            }
            _ => Err(Error::write(path, cause)),
        },
    }
}

fn occupied(path: &Path) -> Error {
    Error::target(path, "is a folder that is not empty; empty it or name another")
}
