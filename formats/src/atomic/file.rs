//! One file.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use super::complete::{CompleteFile, commit_together};
use super::target::Target;
use super::temporary::{self, Temporary};
use super::{Place, anonymous, hide_temporary, occupied};
use crate::error::Error;

/// A file that takes its name once it is complete; dropped before [`AtomicFile::commit`] it leaves nothing, and what
/// stood under the name stays.
///
/// Until then it has no name where the system can do that (`O_TMPFILE` on Linux), so that not even a killed process
/// leaves anything, and a temporary one elsewhere, which [`remove_temporaries`](super::remove_temporaries) knows.
///
/// Writing is buffered. The errors of [`Write`] and [`Seek`] carry an [`Error`] that names the file.
#[derive(Debug)]
pub struct AtomicFile {
    target: Target,
    /// None for standard output.
    place: Option<Place>,
    // Before its name, so that it is closed first: not every system removes open files.
    file: BufWriter<File>,
    temporary: Option<Temporary>,
}

impl AtomicFile {
    /// Begins a file with the permissions of any new file; its folder must exist.
    ///
    /// # Errors
    /// [`Error::Target`] where there is a folder or a device, or a file that may not be replaced, [`Error::Io`] where the
    /// folder is missing or closed to writing.
    pub fn create(target: impl Into<Target>) -> Result<Self, Error> {
        Self::create_as(target.into(), anonymous::create)
    }

    pub(super) fn create_as(target: Target, unnamed: impl FnOnce(&Path) -> Option<File>) -> Result<Self, Error> {
        let buffered = |file| BufWriter::with_capacity(1 << 16, file);
        if target.is_standard_output() {
            let file = tempfile::tempfile().map_err(|cause| Error::write(&std::env::temp_dir(), cause))?;
            return Ok(Self { target, place: None, file: buffered(file), temporary: None });
        }
        let path = target.path();
        let place = Place::new(path)?;
        if place.target.is_dir() {
            return Err(Error::target(path, "is a folder; name a file in it"));
        }
        if place.target.exists() && !place.target.is_file() {
            return Err(Error::target(path, "is not a regular file; name one"));
        }
        if !target.replaces() && place.target.exists() {
            return Err(occupied(path));
        }
        let (file, temporary) = match unnamed(&place.folder) {
            Some(file) => (file, None),
            None => {
                let begun = temporary::lock()
                    .begin(&place.folder, |path| File::options().read(true).write(true).create_new(true).open(path));
                let (file, temporary) = begun.map_err(|cause| hide_temporary(path, &cause))?;
                (file, Some(temporary))
            }
        };
        Ok(Self { target, place: Some(place), file: buffered(file), temporary })
    }

    /// The path of the target given to [`AtomicFile::create`].
    pub fn path(&self) -> &Path {
        self.target.path()
    }

    /// Makes the contents durable; all that is left to do is to give the file its name.
    ///
    /// # Errors
    /// [`Error::Io`]; the file is then not created.
    pub fn complete(self) -> Result<CompleteFile, Error> {
        let Self { target, place, file, temporary } = self;
        let finish = || {
            let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
            if place.is_some() {
                file.sync_all()?;
            }
            let length = file.metadata()?.len();
            Ok((file, length))
        };
        let (file, length) = finish().map_err(|cause: io::Error| hide_temporary(target.path(), &cause))?;
        Ok(CompleteFile { target, place, file, temporary, replaced: None, length })
    }

    /// Makes the contents durable and gives the file its name, or copies them to standard output.
    ///
    /// # Errors
    /// [`Error::Io`]; the file is then not created, unless it is its name alone that could not be made durable.
    pub fn commit(self) -> Result<(), Error> {
        commit_together(vec![self.complete()?])
    }

    fn name<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|cause| {
            let kind = cause.kind();
            io::Error::new(kind, hide_temporary(self.target.path(), &cause))
        })
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
