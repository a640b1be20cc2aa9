//! Files and folders that appear whole or not at all: written under a temporary name, synced, then
//! renamed.

mod dir;
mod file;
mod group;
mod target;
mod temporary;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

pub use dir::AtomicDir;
pub use file::{AtomicFile, commit_together};
pub use group::AtomicGroup;
pub use target::Target;
pub use temporary::{ScratchDir, remove_temporaries};

use crate::error::Error;

/// Where an output really goes: through symbolic links, also where there is no such file yet.
///
/// # Errors
/// A path without a name, or in a folder that is not there.
pub fn destination(path: &Path) -> Result<PathBuf, Error> {
    let Place { folder, target } = Place::new(path)?;
    let folder = folder.canonicalize().map_err(|cause| Error::write(path, cause))?;
    Ok(target.file_name().map_or_else(|| folder.clone(), |name| folder.join(name)))
}

/// Where an output really goes, through symbolic links, so that those stay; and the folder around
/// it.
#[derive(Debug)]
struct Place {
    folder: PathBuf,
    target: PathBuf,
}

impl Place {
    fn new(path: &Path) -> Result<Self, Error> {
        let target = match fs::canonicalize(path) {
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => behind_links(path),
            found => found.map_err(|cause| Error::write(path, cause))?,
        };
        if target.file_name().is_none() {
            return Err(Error::target(path, "does not end in a name; name the output"));
        }
        let folder = match target.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        match fs::metadata(&folder) {
            Ok(found) if found.is_dir() => Ok(Self { folder, target }),
            Ok(_) => Err(Error::write(path, io::ErrorKind::NotADirectory.into())),
            Err(cause) => Err(Error::write(path, cause)),
        }
    }
}

/// What a symbolic link to a file that is yet to be made names; a path that is no link as it is.
fn behind_links(path: &Path) -> PathBuf {
    const MAX_LINKS: usize = 40;
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = fs::read_link(&path) else { break };
        // An absolute one replaces the whole.
        path = path.parent().unwrap_or(Path::new("")).join(next);
    }
    path
}

/// Gives a new file or folder the mode and, where it is allowed to, the owner of the one that it
/// replaces.
fn inherit(file: &File, old: &Path) -> io::Result<()> {
    let Ok(found) = fs::metadata(old) else { return Ok(()) };
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt, fchown};
        // Only root may give files away; before the mode, since a change of owner clears parts of
        // it.
        let _ = fchown(file, Some(found.uid()), Some(found.gid()));
    }
    file.set_permissions(found.permissions())
}

/// Makes the names in a folder durable, where the system can.
fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    match File::open(folder)?.sync_all() {
        Err(cause) if matches!(cause.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
        result => result,
    }
}

/// The error of a temporary file under the name of the final one.
fn hide_temporary(path: &Path, cause: &io::Error) -> Error {
    // What comes from the system itself has no path in it.
    let cause = cause.raw_os_error().map_or_else(|| cause.kind().into(), io::Error::from_raw_os_error);
    Error::write(path, cause)
}
