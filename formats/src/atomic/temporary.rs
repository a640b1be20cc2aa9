//! Temporary names, and their removal when the process is told to end.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

static LIVE: Mutex<Live> = Mutex::new(Live(BTreeSet::new()));

/// The temporary names of this process. Whoever makes, renames or removes one holds the lock, so that none is missing
/// here and several outputs that belong together take their names in one step.
pub(super) struct Live(BTreeSet<PathBuf>);

pub(super) fn lock() -> MutexGuard<'static, Live> {
    // A panic elsewhere leaves the set as good as it was.
    LIVE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files and folders of this process, for one that ends without dropping its outputs, as on a
/// signal.
///
/// From then on no output can be begun, given its name or dropped: a thread that tries waits until the process has
/// ended, which is to follow at once. So no thread reports the missing files as an error of its own.
pub fn remove_temporaries() {
    let live = lock();
    for path in &live.0 {
        // Nobody is left to be told of what cannot be removed.
        let _ = remove(path);
    }
    std::mem::forget(live);
}

impl Live {
    /// Has `make` make something under a new name in `folder`, a name that says whose leftover it is, should the process
    /// be killed.
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

    /// Gives a temporary its name for good, in place of a file or an empty folder that had it.
    pub(super) fn rename(&mut self, temporary: &Temporary, target: &Path) -> io::Result<()> {
        fs::rename(&temporary.0, target)?;
        self.0.remove(&temporary.0);
        Ok(())
    }

    /// Gives a temporary file its name for good, where nothing has it; the temporary name goes when it is dropped.
    pub(super) fn name_new(&mut self, temporary: &Temporary, target: &Path) -> io::Result<()> {
        match fs::hard_link(&temporary.0, target) {
            Err(cause) if cause.kind() != io::ErrorKind::AlreadyExists => {
                // A file system without second names: it is looked just before.
                if target.exists() { Err(io::ErrorKind::AlreadyExists.into()) } else { self.rename(temporary, target) }
            }
            linked => linked,
        }
    }
}

/// A temporary file or folder, removed when dropped unless it has been renamed. Dropping takes the lock.
#[derive(Debug)]
pub(super) struct Temporary(PathBuf);

impl Temporary {
    pub(super) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Held while removing, so that a signal does not end the process halfway through a folder.
        let mut live = lock();
        if live.0.remove(&self.0) {
            let _ = remove(&self.0);
        }
    }
}

fn remove(path: &Path) -> io::Result<()> {
    if fs::symlink_metadata(path)?.is_dir() { remove_dir(path) } else { fs::remove_file(path) }
}

/// Removes a folder that other threads may still write into: under another name they do not find it any more.
fn remove_dir(path: &Path) -> io::Result<()> {
    let gone = path.with_extension("gone.tmp");
    loop {
        match fs::rename(path, &gone) {
            Ok(()) => fs::remove_dir_all(&gone)?,
            // Systems that do not rename folders with open files in them.
            Err(_) => return fs::remove_dir_all(path),
        }
        // Someone was just about to make what was missing.
        if !path.exists() {
            return Ok(());
        }
    }
}
