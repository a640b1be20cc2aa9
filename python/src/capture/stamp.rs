//! What tells whether a file is still the one that was opened.

use cager_formats::{Action, Error};
use std::path::Path;
use std::time::SystemTime;

/// What tells a file from one that was written in its place: its length, and when it was written.
pub(super) type Stamp = (u64, Option<SystemTime>);

pub(super) fn stamp(path: &Path) -> Result<Stamp, Error> {
    let found = std::fs::metadata(path);
    let found = found.map_err(|cause| Error::Io { path: path.to_owned(), action: Action::Read, cause })?;
    Ok((found.len(), found.modified().ok()))
}
