//! One file, and several that take their names together.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use super::hide_temporary;
use super::pending::{Pending, take_names};
use super::target::Target;
use crate::error::Error;

/// A file that takes its name once it is complete; dropped before [`AtomicFile::commit`] it leaves
/// nothing, and what stood under the name stays. A killed process leaves it under a hidden name,
/// beginning with `.cager-`.
///
/// Writing is buffered. Errors of [`Write`] and [`Seek`] carry an [`Error`] that names the file.
#[derive(Debug)]
pub struct AtomicFile {
    target: Target,
    // Before its name, so that it is closed first: not every system removes open files.
    file: BufWriter<File>,
    /// None for standard output.
    pending: Option<Pending>,
}

impl AtomicFile {
    /// Begins a file with the permissions of any new file; its folder must exist.
    ///
    /// # Errors
    /// [`Error::Target`] where there is a folder or a device, or a file that may not be replaced,
    /// [`Error::Io`] where the folder is missing or closed to writing.
    pub fn create(target: impl Into<Target>) -> Result<Self, Error> {
        let target = target.into();
        let (file, pending) = if target == Target::StandardOutput {
            (tempfile::tempfile().map_err(|cause| Error::write(&std::env::temp_dir(), cause))?, None)
        } else {
            let (file, pending) = Pending::create(target.clone())?;
            (file, Some(pending))
        };
        Ok(Self { file: BufWriter::with_capacity(1 << 16, file), target, pending })
    }

    /// The path of the target given to [`AtomicFile::create`].
    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// Makes the contents durable, for [`Self::commit`]. Gives their length in bytes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn complete(&mut self) -> Result<u64, Error> {
        let mut complete = || {
            self.file.flush()?;
            let file = self.file.get_ref();
            self.pending.as_ref().map_or(Ok(()), |pending| pending.complete(file))?;
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

/// Makes files durable and gives them their names, in place of files that had them where they may,
/// as one step: where one of them cannot have its name, none has, and those that stood there before
/// stay. What goes to standard output is copied there first.
///
/// A process killed between two names leaves a part of them; that takes microseconds, since all
/// else was done before.
///
/// # Errors
/// [`Error::Io`], or [`Error::Target`] where a file that may not be replaced has appeared
/// meanwhile; the files are then not created, unless it is a name alone that could not be made
/// durable.
pub fn commit_together(mut files: Vec<AtomicFile>) -> Result<(), Error> {
    for file in &mut files {
        file.complete()?;
    }
    for file in files.iter().filter(|file| file.pending.is_none()) {
        file.copy_to_standard_output().map_err(|cause| hide_temporary(file.path(), &cause))?;
    }
    let pending: Vec<Pending> = files.into_iter().filter_map(|file| file.pending).collect();
    take_names(&pending)
}
