//! Containers as they are opened to be decoded or edited, and why that stops.

use cager_core::cage::CageError;
use cager_core::coordinates::CoordinatesError;
use cager_core::inversion::PrepareError;
use cager_formats::{Action, Signature};
use cager_proto::container::{self, ContainerReader};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Why decoding stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// The container cannot be read.
    #[error("{}: {cause}", .path.display())]
    Container {
        /// The container.
        path: PathBuf,
        /// What went wrong; part of the message, so not a source as well.
        cause: container::Error,
    },
    /// The container is a folder.
    #[error("{}: is a folder; name a .cager file", .path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// The container is a pipe or a device.
    #[error("{}: is a pipe or a device, and frames are read from anywhere in a .cager file; save it as a file first", .path.display())]
    NotAFile {
        /// The container.
        path: PathBuf,
    },
    /// The cage in the container is invalid.
    #[error("{}: {cause}", .path.display())]
    Cage {
        /// The container.
        path: PathBuf,
        /// What is wrong with it; part of the message, so not a source as well.
        cause: CageError,
    },
    /// The container needs a feature that this version lacks.
    #[error("{}: {what}; use a newer cager, or encode the capture again where one before 0.2.0 wrote it", .path.display())]
    Unsupported {
        /// The container.
        path: PathBuf,
        /// What it needs.
        what: String,
    },
    /// Another model cannot be moved by a cage whose components carry parts of the capture's own.
    #[error("{}: the components of its cage carry a part of its own model each, so that nothing says which of them moves {}; encode the capture with one cage (--per-part no) to move other models by it", .path.display(), .model.display())]
    ByComponent {
        /// The container.
        path: PathBuf,
        /// The other model.
        model: PathBuf,
    },
    /// A part that was asked for is not there.
    #[error("{}: {what}", .path.display())]
    Parts {
        /// The container.
        path: PathBuf,
        /// What there is instead.
        what: String,
    },
    /// No frame that was asked for is intact.
    #[error("{}: no frame is left: {what}; get the file again", .path.display())]
    Lost {
        /// The container.
        path: PathBuf,
        /// Which frames are damaged.
        what: String,
    },
    /// The coordinates of the file's model do not exist.
    #[error("{}: {cause}", .path.display())]
    Coordinates {
        /// The input.
        path: PathBuf,
        /// Why; part of the message, so not a source as well.
        cause: CoordinatesError,
    },
    /// A point of another model lies too far from the cage.
    #[error("{}: {cause}", .path.display())]
    Model {
        /// The model.
        path: PathBuf,
        /// Which point, and how far; part of the message, so not a source as well.
        cause: PrepareError,
    },
    /// The coordinates do not fit into memory.
    #[error("{}: its coordinates need {gigabytes:.0} GB of memory; decode it on a larger machine", .path.display())]
    Memory {
        /// The container.
        path: PathBuf,
        /// What decoding needs.
        gigabytes: f64,
    },
    /// The edited cages do not belong to the container.
    #[error("{}: {what}", .path.display())]
    Edited {
        /// The file of edited cages.
        path: PathBuf,
        /// What is wrong with it, and what to do.
        what: String,
    },
    /// A unit or an axis that the container does not know its own of.
    #[error("{}: {what}", .path.display())]
    Meaning {
        /// The container.
        path: PathBuf,
        /// What it does not know, and what to do.
        what: String,
    },
    /// The positions cannot be written, or the edited cages not be read.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
}

impl DecodeError {
    /// Of what reading the container at `path` gave.
    pub fn container(path: &Path, cause: container::Error) -> Self {
        let path = path.to_owned();
        match cause {
            container::Error::Io(cause) => cager_formats::Error::Io { path, action: Action::Read, cause }.into(),
            cause => Self::Container { path, cause },
        }
    }

    /// The message without the path that it begins with: the one of a service is its own.
    pub fn without(&self, path: &Path) -> String {
        let message = self.to_string();
        message.strip_prefix(&format!("{}: ", path.display())).unwrap_or(&message).to_owned()
    }
}

/// An opened container.
pub type Container = ContainerReader<BufReader<File>>;

/// Opens a container.
///
/// # Errors
/// A file that cannot be read or is no container; the path is named.
pub fn open(path: &Path) -> Result<Container, DecodeError> {
    open_with(path, ContainerReader::open)
}

/// Opens what is there of a container that was damaged or cut.
///
/// # Errors
/// As [`open`]; a file without a whole model and cage.
pub fn open_cut(path: &Path) -> Result<Container, DecodeError> {
    match open(path) {
        Err(DecodeError::Container { cause: container::Error::Corrupt { .. }, .. }) => {
            open_with(path, ContainerReader::open_cut)
        }
        opened => opened.map(ContainerReader::passing_over_damaged_layers),
    }
}

fn open_with(
    path: &Path,
    read: impl FnOnce(BufReader<File>) -> Result<Container, container::Error>,
) -> Result<Container, DecodeError> {
    let fail = |cause| DecodeError::container(path, cause);
    // Opening a pipe would block until another process writes to it.
    if std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return Err(DecodeError::NotAFile { path: path.to_owned() });
    }
    let file = File::open(path).map_err(|e| fail(container::Error::from(e)))?;
    if file.metadata().is_ok_and(|m| m.is_dir()) {
        return Err(DecodeError::Folder { path: path.to_owned() });
    }
    read(BufReader::new(file)).map_err(|cause| match Signature::stand_in_of(path) {
        Some(other) if matches!(cause, container::Error::NotAContainer) => other.into(),
        _ => fail(cause),
    })
}
