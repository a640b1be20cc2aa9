//! Files without a name, which vanish with their process however that ends.

#[cfg(target_os = "linux")]
pub(super) use linux::{create, link};
#[cfg(not(target_os = "linux"))]
pub(super) use nowhere::{create, link};

#[cfg(target_os = "linux")]
mod linux {
    use std::fs::{self, File};
    use std::io;
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::MetadataExt;
    use std::path::{Path, PathBuf};

    use rustix::fs::{AtFlags, CWD, Mode, OFlags};

    /// A file in the file system of `folder`, with the permissions of any new file; none where the system has no such
    /// files, or where they could not be named later.
    pub(in super::super) fn create(folder: &Path) -> Option<File> {
        let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
        let file = File::from(rustix::fs::open(folder, flags, Mode::from_raw_mode(0o666)).ok()?);
        // Its name is to be linked to what /proc shows, which some sandboxes lack: better found out before the work.
        let (own, shown) = (file.metadata().ok()?, fs::metadata(shown(&file)).ok()?);
        ((own.dev(), own.ino()) == (shown.dev(), shown.ino())).then_some(file)
    }

    /// Gives a file of [`create`] its name, at which there must be nothing; once only.
    pub(in super::super) fn link(file: &File, name: &Path) -> io::Result<()> {
        Ok(rustix::fs::linkat(CWD, shown(file), CWD, name, AtFlags::SYMLINK_FOLLOW)?)
    }

    fn shown(file: &File) -> PathBuf {
        PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
    }
}

#[cfg(not(target_os = "linux"))]
mod nowhere {
    use std::fs::File;
    use std::io;
    use std::path::Path;

    pub(in super::super) fn create(_: &Path) -> Option<File> {
        None
    }

    pub(in super::super) fn link(_: &File, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}
