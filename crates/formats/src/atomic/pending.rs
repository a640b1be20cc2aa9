//! Complete files that wait for their names.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use tempfile::TempPath;

use super::target::Target;
use super::temporary::{self, Names, Temporary};
use super::{Place, hide_temporary, inherit, sync_folder};
use crate::error::Error;

/// A file under a temporary name beside its target.
#[derive(Debug)]
pub(super) struct Pending {
    target: Target,
    place: Place,
    temporary: Temporary,
}

impl Pending {
    /// Begins a file; the folder must exist.
    ///
    /// # Errors
    /// As of [`AtomicFile::create`](super::AtomicFile::create).
    pub(super) fn create(target: Target) -> Result<(File, Self), Error> {
        let path = target.path();
        let place = Place::new(path)?;
        match fs::metadata(&place.target) {
            Ok(found) if found.is_dir() => return Err(Error::target(path, "is a folder; name a file in it")),
            Ok(found) if !found.is_file() => return Err(Error::target(path, "is not a regular file; name one")),
            Ok(_) if !target.replaces() => return Err(occupied(path)),
            _ => {}
        }
        let open = |path: &Path| File::options().read(true).write(true).create_new(true).open(path);
        let begun = temporary::lock().begin(&place.folder, open);
        let (file, temporary) = begun.map_err(|cause| hide_temporary(path, &cause))?;
        Ok((file, Self { target, place, temporary }))
    }

    /// Makes the contents durable, `file` being open for them.
    pub(super) fn complete(&self, file: &File) -> io::Result<()> {
        inherit(file, &self.place.target)?;
        file.sync_all()
    }

    /// Opens the file again.
    pub(super) fn open(&self) -> io::Result<File> {
        File::open(&self.temporary.0)
    }

    pub(super) fn error(&self, cause: &io::Error) -> Error {
        match cause.kind() {
            io::ErrorKind::AlreadyExists if !self.target.replaces() => occupied(self.target.path()),
            _ => hide_temporary(self.target.path(), cause),
        }
    }

    /// Keeps what has the name under a second one, or as a copy where there are no hard links.
    fn keep_old(&self, names: &mut Names) -> io::Result<Option<Temporary>> {
        let (folder, old) = (&self.place.folder, &self.place.target);
        if !self.target.replaces() || !old.exists() {
            return Ok(None);
        }
        let linked = names.begin(folder, |path| fs::hard_link(old, path));
        let kept = linked.or_else(|_| names.begin(folder, |path| fs::copy(old, path).map(drop)));
        kept.map(|((), kept)| Some(kept))
    }

    fn take_name(&self) -> io::Result<()> {
        let (from, to) = (&self.temporary.0, &self.place.target);
        if self.target.replaces() {
            return fs::rename(from, to);
        }
        // Where that fails it is removed, as its drop would do.
        let Err(error) = TempPath::try_from_path(from)?.persist_noclobber(to) else { return Ok(()) };
        if error.error.kind() == io::ErrorKind::AlreadyExists || to.exists() {
            return Err(error.into());
        }
        // File systems without hard links, where nothing better than looking first can be had.
        fs::rename(error.path.keep()?, to)
    }

    fn give_back_name(&self, old: Option<&Temporary>) -> io::Result<()> {
        old.map_or_else(|| fs::remove_file(&self.place.target), |old| fs::rename(&old.0, &self.place.target))
    }
}

/// Gives complete files their names, all or none.
pub(super) fn take_names(files: &[Pending]) -> Result<(), Error> {
    // Outlives the lock, which dropping it takes.
    let mut before = Vec::new();
    let mut names = temporary::lock();
    for (k, file) in files.iter().enumerate() {
        // After the last one nothing is left that could fail.
        let kept = if k + 1 < files.len() { file.keep_old(&mut names) } else { Ok(None) };
        let taken = kept.and_then(|kept| {
            before.push(kept);
            file.take_name()
        });
        if let Err(cause) = taken {
            for (file, before) in files.iter().zip(&before).take(k) {
                // The first error is the one to tell.
                let _ = file.give_back_name(before.as_ref());
            }
            return Err(file.error(&cause));
        }
    }
    drop(names);
    drop(before);
    let mut synced = None;
    for file in files {
        if synced.replace(&file.place.folder) != Some(&file.place.folder) {
            sync_folder(&file.place.folder).map_err(|cause| file.error(&cause))?;
        }
    }
    Ok(())
}

/// The error of an output where there was to be nothing.
fn occupied(path: &Path) -> Error {
    Error::target(path, "is there already; name another file")
}
