//! One file, and several that take their names together.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use tempfile::TempPath;

use super::target::Target;
use super::temporary::{self, Names, Temporary};
use super::{Place, hide_temporary, inherit, sync_folder};
use crate::error::Error;

/// A file that takes its name once it is complete; dropped before [`AtomicFile::commit`] it leaves
/// nothing, and what stood under the name stays. A killed process leaves it under a hidden name,
/// beginning with `.cager-`.
///
/// Writing is buffered. The errors of [`Write`] and [`Seek`] carry an [`Error`] that names the
/// file.
#[derive(Debug)]
pub struct AtomicFile {
    target: Target,
    // Before its name, so that it is closed first: not every system removes open files.
    file: BufWriter<File>,
    /// None for standard output.
    named: Option<(Place, Temporary)>,
}

impl AtomicFile {
    /// Begins a file with the permissions of any new file; its folder must exist.
    ///
    /// # Errors
    /// [`Error::Target`] where there is a folder or a device, or a file that may not be replaced,
    /// [`Error::Io`] where the folder is missing or closed to writing.
    pub fn create(target: impl Into<Target>) -> Result<Self, Error> {
        let target = target.into();
        let path = target.path();
        let (file, named) = if target == Target::StandardOutput {
            (tempfile::tempfile().map_err(|cause| Error::write(&std::env::temp_dir(), cause))?, None)
        } else {
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
            (file, Some((place, temporary)))
        };
        Ok(Self { file: BufWriter::with_capacity(1 << 16, file), target, named })
    }

    /// The path of the target given to [`AtomicFile::create`].
    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// Makes the contents durable; all that is left to do is to give the file its name. Gives its
    /// length in bytes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn complete(&mut self) -> Result<u64, Error> {
        let mut complete = || {
            self.file.flush()?;
            let file = self.file.get_ref();
            if let Some((place, _)) = &self.named {
                inherit(file, &place.target)?;
                file.sync_all()?;
            }
            Ok(file.metadata()?.len())
        };
        complete().map_err(|cause: io::Error| hide_temporary(self.target.path(), &cause))
    }

    /// The contents from their start, for whoever checks them before they take their name. One
    /// reader at a time: all share one position with whoever writes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn reader(&mut self) -> Result<File, Error> {
        let reader = self.file.rewind().and_then(|()| self.file.get_ref().try_clone());
        reader.map_err(|cause| hide_temporary(self.path(), &cause))
    }

    /// [`commit_together`] for one file.
    ///
    /// # Errors
    /// Those of [`commit_together`].
    pub fn commit(self) -> Result<(), Error> {
        commit_together(vec![self])
    }

    fn name<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|cause| io::Error::new(cause.kind(), hide_temporary(self.target.path(), &cause)))
    }

    fn keep_old(&self, names: &mut Names) -> Before {
        match &self.named {
            Some((place, _)) if self.target.replaces() && place.target.exists() => {
                let kept = names.begin(&place.folder, |path| fs::hard_link(&place.target, path));
                kept.map_or(Before::Lost, |((), kept)| Before::Kept(kept))
            }
            _ => Before::Nothing,
        }
    }

    fn take_name(&self) -> io::Result<()> {
        let Some((place, temporary)) = &self.named else { return Ok(()) };
        if self.target.replaces() {
            return fs::rename(&temporary.0, &place.target);
        }
        // Where that fails it is removed, as its drop would do.
        let Err(error) = TempPath::try_from_path(&temporary.0)?.persist_noclobber(&place.target) else { return Ok(()) };
        if error.error.kind() == io::ErrorKind::AlreadyExists || place.target.exists() {
            return Err(error.into());
        }
        // File systems without hard links, where nothing better than looking first can be had.
        fs::rename(error.path.keep()?, &place.target)
    }

    fn give_back_name(&self, before: &Before) -> io::Result<()> {
        match (&self.named, before) {
            (Some((place, _)), Before::Nothing) => fs::remove_file(&place.target),
            (Some((place, _)), Before::Kept(old)) => fs::rename(&old.0, &place.target),
            _ => Ok(()),
        }
    }

    fn copy_to_standard_output(&self) -> io::Result<()> {
        let mut file = self.file.get_ref();
        file.rewind()?;
        let mut out = io::stdout().lock();
        match io::copy(&mut file, &mut out).and_then(|_| out.flush()) {
            // A reader that has seen enough, as `head` has, is no failure.
            Err(cause) if cause.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            copied => copied,
        }
    }

    fn error(&self, cause: &io::Error) -> Error {
        match cause.kind() {
            io::ErrorKind::AlreadyExists if !self.target.replaces() => occupied(self.path()),
            _ => hide_temporary(self.path(), cause),
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let result = self.file.write(bytes);
        self.name(result)
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.file.flush();
        self.name(result)
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        let result = self.file.seek(position);
        self.name(result)
    }
}

/// What had a file's name before.
enum Before {
    Nothing,
    Kept(Temporary),
    /// A file, on a system that gives no file a second name to keep it by.
    Lost,
}

/// Makes files durable and gives them their names, in place of files that had them where they may,
/// as one step: where one of them cannot have its name, none has, and those that stood there before
/// stay. What goes to standard output is copied there first.
///
/// A process killed between two names leaves a part of them; that takes microseconds, since all
/// else was done before. What was replaced can be restored only where the system lets a file have
/// two names.
///
/// # Errors
/// [`Error::Io`], or [`Error::Target`] where a file that may not be replaced has appeared
/// meanwhile; the files are then not created, unless it is a name alone that could not be made
/// durable.
pub fn commit_together(mut files: Vec<AtomicFile>) -> Result<(), Error> {
    for file in &mut files {
        file.complete()?;
    }
    for file in files.iter().filter(|file| file.named.is_none()) {
        file.copy_to_standard_output().map_err(|cause| file.error(&cause))?;
    }
    // Outlives the lock, which dropping it takes.
    let mut before = Vec::new();
    let mut names = temporary::lock();
    for (k, file) in files.iter().enumerate() {
        before.push(file.keep_old(&mut names));
        if let Err(cause) = file.take_name() {
            for (file, before) in files.iter().zip(&before).take(k) {
                // The first error is the one to tell.
                let _ = file.give_back_name(before);
            }
            return Err(file.error(&cause));
        }
    }
    drop(names);
    drop(before);
    for file in &files {
        file.named
            .as_ref()
            .map_or(Ok(()), |(place, _)| sync_folder(&place.folder))
            .map_err(|cause| file.error(&cause))?;
    }
    Ok(())
}

/// The error of an output where there was to be nothing.
fn occupied(path: &Path) -> Error {
    Error::target(path, "is there already; name another file")
}
