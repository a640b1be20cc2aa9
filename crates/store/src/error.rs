//! Errors of the catalogue, one variant per reaction of the caller.

/// Why something could not be stored or read back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CatalogError {
    /// There is a record of that kind and id.
    #[error("there is one with this id already")]
    Taken,
    /// There is no such session.
    #[error("it is not there, or was deleted")]
    Gone,
    /// No space left. Nothing was changed; the call can succeed later.
    #[error("there is no space left")]
    Full,
    /// What is stored of a record or of frames is not what was written.
    #[error("{0}")]
    Damaged(String),
    /// The database itself is damaged, or is none; whose data that concerns is not known.
    #[error("{0}")]
    Corrupt(String),
    /// A newer version of the program wrote it.
    #[error(
        "a newer program wrote it: it has version {found}, and this program knows versions up to {known}; start the newer one, or go back to a backup from before the upgrade"
    )]
    Newer {
        /// Its version.
        found: i64,
        /// The newest that this program knows.
        known: i64,
    },
    /// Another process has the database for itself.
    #[error("{0}")]
    InUse(String),
    /// Another process has taken the database for itself since.
    #[error("another process has taken over the database, and this one changes nothing any more")]
    TakenOver,
    /// The database does not answer, or takes nothing for now: the same call can succeed later. What was to be stored
    /// may be there or not.
    #[error("{0}")]
    Away(String),
    /// Anything else.
    #[error("{0}")]
    Failed(String),
}
