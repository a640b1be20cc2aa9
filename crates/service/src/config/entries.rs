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
        let message = without_values(error.message());
        (error.span().map_or(0, |span| span.start), format!("{message}; see the documentation of {what} files"))
    })
}

/// Longest name of a key that is shown.
const NAME: usize = 24;

/// A message without the values that it quotes, any of which may be a secret; names of keys stay.
fn without_values(message: &str) -> String {
    let (said, expected) = match message.rfind(", expected ") {
        Some(at) => message.split_at(at),
        None => (message, ""),
    };
    let unknown = said.strip_prefix("unknown field `").and_then(|rest| rest.strip_suffix('`'));
    let is_name = |name: &str| name.len() <= NAME && name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
    if said.starts_with("missing field") || unknown.is_some_and(is_name) {
        return message.to_owned();
    }
    // Whatever is between the first and the last of them: a value may have some in it.
    let quotes = ['`', '"'];
    match (said.find(quotes), said.rfind(quotes)) {
        (Some(first), Some(last)) => format!("{}…{}{expected}", &said[..first], &said[last + 1..]),
        _ => message.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::without_values;

    #[test]
    fn names_of_keys_are_shown_and_values_are_not() {
        for (message, shown) in [
            (
                "unknown field `tenants`, expected one of `url`, `secret`",
                "unknown field `tenants`, expected one of `url`, `secret`",
            ),
            ("unknown field `whsec_c2Vjc`, expected `url`", "unknown field …, expected `url`"),
            ("missing field `url`", "missing field `url`"),
            ("string is not closed", "string is not closed"),
            ("unknown variant `c2Vj`, expected `low` or `high`", "unknown variant …, expected `low` or `high`"),
            ("invalid type: string \"a, expected `c2Vj\", expected u64", "invalid type: string …, expected u64"),
        ] {
            assert!(without_values(message).starts_with(shown), "{}", without_values(message));
            assert!(!without_values(message).contains("c2Vj"));
        }
    }
}
