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
    pub(crate) fn at(self, path: &Path) -> Error {
        match self {
            Self::Io(cause) => Error::read(path, cause),
            Self::Fault(fault) => fault.at(path),
        }
    }
}
