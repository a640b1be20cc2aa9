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

/// The number of bytes at the front, which is taken from them.
pub(crate) fn take<const N: usize>(bytes: &mut &[u8], cut: &'static str) -> Result<[u8; N]> {
    let (head, rest) = bytes.split_first_chunk().ok_or(Error::Damaged(cut))?;
    *bytes = rest;
    Ok(*head)
}
