//! Temporary names, and their removal when the process is told to end.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::error::Error;

static NAMES: Mutex<Names> = Mutex::new(Names(BTreeSet::new()));

/// The temporary names of this process. Whoever makes, renames or removes one holds the lock, so
/// that none is missing here and several outputs that belong together take their names in one step.
pub(super) struct Names(BTreeSet<PathBuf>);

pub(super) fn lock() -> MutexGuard<'static, Names> {
    // A panic elsewhere leaves the set as good as it was.
    NAMES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files and folders of this process, for one that ends without dropping its
/// outputs, as on a signal.
///
/// From then on no output can be begun, given its name or dropped: a thread that tries waits until
/// the process has ended, which is to follow at once. So no thread reports the missing files as an
/// error of its own.
pub fn remove_temporaries() {
    let names = lock();
    names.0.iter().for_each(|path| remove(path));
    std::mem::forget(names);
}

impl Names {
    /// Has `make` make something under a new name in `folder`, a name that says whose leftover it
    /// is, should the process be killed.
    pub(super) fn begin<T>(
        &mut self,
        folder: &Path,
        make: impl FnMut(&Path) -> io::Result<T>,
    ) -> io::Result<(T, Temporary)> {
        let made = tempfile::Builder::new().prefix(".cager-").suffix(".tmp").make_in(folder, make)?;
        let (made, path) = made.keep()?;
        self.0.insert(path.clone());
        Ok((made, Temporary(path)))
    }

    /// Gives what was moved aside its name back. Where that fails it stays under its temporary
    /// name, since it is the user's.
    pub(super) fn give_back(&mut self, aside: &mut Option<Temporary>, target: &Path) -> io::Result<()> {
        let Some(mut aside) = aside.take() else { return Ok(()) };
        let path = std::mem::take(&mut aside.0);
        std::mem::forget(aside);
        self.0.remove(&path);
        fs::rename(&path, target)
            .map_err(|cause| io::Error::new(cause.kind(), format!("{cause}; what was there is in {}", path.display())))
    }
}

/// A temporary file or folder, removed when dropped unless it has been renamed. Dropping takes the
/// lock.
#[derive(Debug)]
pub(super) struct Temporary(pub(super) PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // Held while removing, so that a signal does not end the process halfway through a folder.
        let mut names = lock();
        remove(&self.0);
        names.0.remove(&self.0);
    }
}

/// How often the removal of a folder is tried.
const REMOVALS: usize = 5;

/// Removes a file, or a folder that other threads may still write into: under another name they do
/// not find it any more. Nobody is left to be told of what cannot be removed.
fn remove(path: &Path) {
    let gone = path.with_extension("gone.tmp");
    while fs::symlink_metadata(path).is_ok_and(|found| found.is_dir()) {
        // Not all systems rename folders with open files in them.
        let renamed = fs::rename(path, &gone);
        let place = if renamed.is_ok() { &gone } else { path };
        // A file that was just being made may come after its folder was looked through.
        let is_removed = (0..REMOVALS).any(|_| fs::remove_dir_all(place).is_ok());
        if renamed.is_err() || !is_removed {
            return;
        }
        // Again, where someone was just about to make what was missing.
    }
    let _ = fs::remove_file(path);
}

/// A folder of a temporary name, removed with all that is in it when dropped, or by
/// [`remove_temporaries`] on a signal.
#[derive(Debug)]
pub struct ScratchDir(Temporary);

impl ScratchDir {
    /// Makes one in `folder`, which must exist.
    ///
    /// # Errors
    /// [`Error::Io`] where the folder is missing or closed to writing.
    pub fn create(folder: impl AsRef<Path>) -> Result<Self, Error> {
        let folder = folder.as_ref();
        let begun = lock().begin(folder, |path| fs::create_dir(path));
        begun.map(|((), made)| Self(made)).map_err(|cause| Error::write(folder, cause))
    }

    /// Runs what may make the folder anew where it is missing: [`remove_temporaries`] waits for it,
    /// so it should be short. It must not begin, name or drop an output.
    pub fn undisturbed<T>(&self, work: impl FnOnce() -> T) -> T {
        let _names = lock();
        work()
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0.0
    }
}
