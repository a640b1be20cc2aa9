//! What can go wrong, sorted by what a caller can do about it.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why a file could not be read or written: a sentence that says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused: correct the path, the permissions or the disk, and try again.
    #[error("{}: cannot be {action} ({cause}); {}", .path.display(), advice(*action, cause))]
    Io {
        /// The file as the caller named it.
        path: PathBuf,
        /// What was being done with it.
        action: Action,
        /// What the operating system said; part of the message, so not a source as well.
        cause: io::Error,
    },
    /// The bytes do not follow the format, or end too early: get the file again.
    #[error("{}: {what}", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where it departs from the format, and what to do.
        what: String,
    },
    /// A file of a kind, or with a feature, that is not read here: convert it.
    #[error("{}: {what}", .path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What was found, what is supported, and what to do.
        what: String,
    },
    /// Well-formed contents that cannot be used: repair the geometry.
    #[error("{}: {what}", .path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Which line, vertex or face is wrong and why, and what to do.
        what: String,
    },
    /// The files of a folder or pattern are not one sequence: pick one with a pattern.
    #[error("{}: {what}", .path.display())]
    SeveralSequences {
        /// The folder or pattern.
        path: PathBuf,
        /// What was found, and patterns that pick some of it.
        what: String,
    },
    /// A frame, or a whole capture, does not belong to the rest pose: pair the right files.
    #[error("{}: {}has {found} points where {expected} are expected; use a capture of the same mesh as the rest pose", .path.display(), in_frame(*frame))]
    PointCount {
        /// The file.
        path: PathBuf,
        /// The frame, from 0, where one frame is at fault.
        frame: Option<usize>,
        /// Points that the caller expects.
        expected: usize,
        /// Points that the file has.
        found: u64,
    },
    /// A frame has a NaN or an infinity: leave the frame out or repair it.
    #[error("{}: frame {frame}: point {point} has a coordinate that is NaN or infinite; repair the frame or leave it \
             out", .path.display())]
    NonFinite {
        /// The file.
        path: PathBuf,
        /// The frame, from 0.
        frame: usize,
        /// The point, from 0.
        point: usize,
    },
    /// The output cannot go there: choose another place.
    #[error("{}: {what}", .path.display())]
    Target {
        /// The output.
        path: PathBuf,
        /// Why not, and what to do.
        what: String,
    },
    /// More or fewer frames were written than announced; the output was not created.
    #[error("{}: was announced with {announced} frames but given {written}; write exactly as many as announced", .path.display())]
    FrameCount {
        /// The output.
        path: PathBuf,
        /// Frames announced when it was created.
        announced: usize,
        /// Frames written.
        written: usize,
    },
}

/// What was being done with a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// It was being opened or read.
    Read,
    /// It was being created or written.
    Write,
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Read => "read",
            Self::Write => "written",
        })
    }
}

/// The words before "has … points" where one frame is at fault.
fn in_frame(frame: Option<usize>) -> String {
    frame.map_or(String::new(), |frame| format!("frame {frame} "))
}

impl Error {
    pub(crate) fn read(path: &Path, cause: io::Error) -> Self {
        Self::io(path, Action::Read, cause)
    }

    pub(crate) fn write(path: &Path, cause: io::Error) -> Self {
        Self::io(path, Action::Write, cause)
    }

    fn io(path: &Path, action: Action, cause: io::Error) -> Self {
        // `AtomicFile` passes its errors through `io::Write` with the path in them already.
        cause.downcast::<Self>().unwrap_or_else(|cause| Self::Io { path: path.to_owned(), action, cause })
    }

    pub(crate) fn target(path: &Path, what: impl Into<String>) -> Self {
        Self::Target { path: path.to_owned(), what: what.into() }
    }

    /// Prefixes the message with the frame, for errors in one file of a sequence.
    pub(crate) fn in_frame(mut self, frame: usize) -> Self {
        match &mut self {
            Self::Damaged { what, .. } | Self::Unsupported { what, .. } | Self::Invalid { what, .. } => {
                *what = format!("frame {frame}: {what}");
            }
            _ => {}
        }
        self
    }
}

fn advice(action: Action, cause: &io::Error) -> &'static str {
    use io::ErrorKind::{
        FileTooLarge, IsADirectory, NotADirectory, NotFound, NotSeekable, PermissionDenied, QuotaExceeded,
        ReadOnlyFilesystem, StorageFull,
    };
    match (action, cause.kind()) {
        (Action::Read, NotFound | NotADirectory) => "check the path",
        (Action::Read, PermissionDenied) => "change its permissions or copy it elsewhere",
        (Action::Read, IsADirectory) => "name a file",
        (Action::Read, NotSeekable) => "save what the pipe carries as a file first",
        (Action::Write, NotFound | NotADirectory) => "create its folder first",
        (Action::Write, PermissionDenied | ReadOnlyFilesystem) => "choose a folder that you may write to",
        (Action::Write, StorageFull | QuotaExceeded | FileTooLarge) => "free some space or write to another disk",
        (Action::Read, _) => "check the disk and try again",
        (Action::Write, _) => "check the disk or choose another folder",
    }
}

/// An [`Error`] of a parser, which knows bytes and not the file that they came from.
#[derive(Debug)]
pub(crate) enum Fault {
    /// The disk, of what is read where it is asked for.
    Io(io::Error),
    Damaged(String),
    Unsupported(String),
    Invalid(String),
}

impl Fault {
    pub(crate) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged(what.into())
    }

    pub(crate) fn unsupported(what: impl Into<String>) -> Self {
        Self::Unsupported(what.into())
    }

    pub(crate) fn invalid(what: impl Into<String>) -> Self {
        Self::Invalid(what.into())
    }

    /// Of something in a file.
    pub(crate) fn within(self, place: &str) -> Self {
        let named = |what: String| format!("{place}: {what}");
        match self {
            Self::Io(cause) => Self::Io(cause),
            Self::Damaged(what) => Self::Damaged(named(what)),
            Self::Unsupported(what) => Self::Unsupported(named(what)),
            Self::Invalid(what) => Self::Invalid(named(what)),
        }
    }

    pub(crate) fn at(self, path: &Path) -> Error {
        let path = path.to_owned();
        match self {
            Self::Io(cause) => Error::read(&path, cause),
            Self::Damaged(what) => Error::Damaged { path, what },
            Self::Unsupported(what) => Error::Unsupported { path, what },
            Self::Invalid(what) => Error::Invalid { path, what },
        }
    }
}

impl From<io::Error> for Fault {
    fn from(cause: io::Error) -> Self {
        Self::Io(cause)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_named_with_the_file_and_a_way_out() {
        let error = Error::write(Path::new("out.cager"), io::Error::from(io::ErrorKind::StorageFull));
        assert_eq!(
            error.to_string(),
            "out.cager: cannot be written (no storage space); free some space or write to another disk"
        );
    }

    #[test]
    fn an_error_that_passed_through_io_write_keeps_its_own_path() {
        let inner = Error::write(Path::new("a.npy"), io::Error::from(io::ErrorKind::StorageFull));
        let outer = Error::write(Path::new("b.npy"), io::Error::other(inner));
        assert!(outer.to_string().starts_with("a.npy: "));
    }
}
