//! One file.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::{Place, builder, hide_temporary};
use crate::error::Error;

/// A file that takes its name once it is complete; dropped before [`AtomicFile::commit`] it leaves nothing, and what
/// stood under the name stays.
///
/// Writing is buffered. The errors of [`Write`] and [`Seek`] carry an [`Error`] that names the file.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    place: Place,
    file: BufWriter<NamedTempFile>,
}

impl AtomicFile {
    /// Begins a file at `path` with the permissions of any new file; its folder must exist.
    ///
    /// # Errors
    /// [`Error::Target`] where `path` is a folder or a device, [`Error::Io`] where the folder is missing or closed to
    /// writing.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let place = Place::new(path)?;
        if place.target.is_dir() {
            return Err(Error::target(path, "is a folder; name a file in it"));
        }
        if place.target.exists() && !place.target.is_file() {
            return Err(Error::target(path, "is not a regular file; name one"));
        }
        let prefix = ".cager-".into();
        let mut builder = builder(&prefix);
        #[cfg(unix)]
        {
            use std::fs::Permissions;
            use std::os::unix::fs::PermissionsExt;
            // As for any new file, the system takes the umask away from these.
            builder.permissions(Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(&place.folder).map_err(|cause| hide_temporary(path, &cause))?;
        Ok(Self { path: path.to_owned(), place, file: BufWriter::with_capacity(1 << 16, file) })
    }

    /// The path as it was given to [`AtomicFile::create`].
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes the contents durable and gives the file its name, in place of a file that had it.
    ///
    /// # Errors
    /// [`Error::Io`]; the file is then not
    /// created, unless it is its name alone that could not be made durable.
    pub fn commit(self) -> Result<(), Error> {
        let Self { path, place, file } = self;
        let put_in_place = || {
            let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
            file.as_file().sync_all()?;
            let _: File = file.persist(&place.target).map_err(|failed| failed.error)?;
            place.sync_folder()
        };
        put_in_place().map_err(|cause| hide_temporary(&path, &cause))
    }

    fn name<T>(&self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|cause| {
            let kind = cause.kind();
            io::Error::new(kind, hide_temporary(&self.path, &cause))
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
