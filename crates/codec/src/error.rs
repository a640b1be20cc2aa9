/// Why bytes could not be decoded.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum Error {
    /// The bytes are cut, damaged or of another model.
    #[error("{0}")]
    Damaged(&'static str),
    /// What is given cannot be coded so.
    #[error("{0}")]
    Unsuitable(&'static str),
}

pub(crate) type Result<T> = std::result::Result<T, Error>;
