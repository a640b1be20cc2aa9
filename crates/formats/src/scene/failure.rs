//! Why a scene could not be read: its bytes, or the disk.

use std::io;
use std::path::Path;

use crate::error::{Error, Fault};

#[derive(Debug)]
pub(crate) enum Failure {
    Io(io::Error),
    Fault(Fault),
}

impl From<io::Error> for Failure {
    fn from(cause: io::Error) -> Self {
        Self::Io(cause)
    }
}

impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

impl Failure {
    /// What is wrong with bytes that no disk was needed for.
    pub(crate) fn of_bytes(self) -> Fault {
        match self {
            Self::Io(cause) => Fault::damaged(format!("cannot be read ({cause}); copy the file again")),
            Self::Fault(fault) => fault,
        }
    }

    pub(crate) fn at(self, path: &Path) -> Error {
        match self {
            Self::Io(cause) => Error::read(path, cause),
            Self::Fault(fault) => fault.at(path),
        }
    }
}
