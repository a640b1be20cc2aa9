//! Files of entries beside the settings: access tokens, webhooks. What is wrong in one is named by its line, and never quoted, since it may be
//! a secret.

use super::layers::line_of;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Why a file of entries cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EntriesError {
    /// It cannot be read.
    #[error("{}: cannot be read ({why}); check its name and permissions", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        why: std::io::Error,
    },
    /// An entry is wrong.
    #[error("{}: line {line}: {why}", file.display())]
    Entry {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what to do.
        why: String,
    },
}

/// What is wrong with a text, and where: the offset in bytes.
pub(crate) type Wrong = (usize, String);

/// Reads a file of entries.
///
/// # Errors
/// See [`EntriesError`].
pub(crate) fn read<T>(file: &Path, parse: impl FnOnce(&str) -> Result<T, Wrong>) -> Result<T, EntriesError> {
    let text = std::fs::read_to_string(file).map_err(|why| EntriesError::Read { file: file.to_owned(), why })?;
    parse(&text).map_err(|(offset, why)| EntriesError::Entry {
        file: file.to_owned(),
        line: line_of(&text, offset),
        why,
    })
}

/// The document of such a file; `what` are its entries.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn document<T: DeserializeOwned>(text: &str, what: &str) -> Result<T, Wrong> {
    toml::from_str(text).map_err(|error: toml::de::Error| {
        // Some messages quote the value at fault, which may be a secret.
        let message = error.message().split(['`', '"']).step_by(2).collect::<Vec<_>>().join("…");
        (error.span().map_or(0, |span| span.start), format!("{message}; see the documentation of {what} files"))
    })
}
