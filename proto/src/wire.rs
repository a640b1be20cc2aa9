//! Small structured values to and from bytes. The only module that knows bincode.
//!
//! The layout is bincode's "legacy" one: little-endian, integers at their full width, `bool` one
//! byte, enums a `u32` variant number, `Option` one byte before the value, strings and sequences a
//! `u64` length before their elements, structs and tuples their fields back to back. Matrices and
//! positions travel as raw little-endian numbers instead.
//!
//! # Why the version is pinned, and how to leave
//!
//! bincode is unmaintained (RUSTSEC-2025-0141) and its 3.0.0 does not compile, so the workspace
//! pins `=2.0.1`. The advisory reports no vulnerability; against hostile bytes every call has a
//! limit, which keeps a forged length from being allocated, and bytes left over are an error.
//!
//! To leave, rewrite [`encode`] and [`decode`] on another library of this layout, such as
//! `serde-wincode`, with which the tests compare.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Why a value could not be encoded or decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WireError {
    /// The bytes, or what they declare, are larger than the limit of the call.
    #[error("the message takes more than the {limit} bytes allowed; send less at once")]
    TooLarge {
        /// The limit in bytes.
        limit: usize,
    },
    /// The bytes go on after the value: they are of another type, or damaged.
    #[error(
        "the message is followed by {bytes} bytes that do not belong to it; check that both sides agree on its type"
    )]
    Trailing {
        /// Number of bytes left over.
        bytes: usize,
    },
    /// The bytes are not a value of this type.
    #[error("the message cannot be read ({0}); check that both sides agree on its type")]
    Malformed(String),
    /// The value cannot be expressed in this layout, for example a sequence of unknown length.
    #[error("the message cannot be written ({0})")]
    Unsupported(String),
}

/// Encodes `value` in at most `LIMIT` bytes.
///
/// # Errors
/// [`WireError::TooLarge`] past the limit; [`WireError::Unsupported`] values.
pub fn encode<T: Serialize + ?Sized, const LIMIT: usize>(value: &T) -> Result<Vec<u8>, WireError> {
    let bytes = bincode::serde::encode_to_vec(value, bincode::config::legacy())
        .map_err(|error| WireError::Unsupported(error.to_string()))?;
    if bytes.len() > LIMIT {
        return Err(WireError::TooLarge { limit: LIMIT });
    }
    Ok(bytes)
}

/// Decodes a value from exactly `bytes`, allocating a small multiple of `LIMIT`.
///
/// # Errors
/// [`WireError::TooLarge`] if `bytes` or a length inside them passes the limit,
/// [`WireError::Trailing`] if bytes are left over, [`WireError::Malformed`] otherwise.
pub fn decode<T: DeserializeOwned, const LIMIT: usize>(bytes: &[u8]) -> Result<T, WireError> {
    if bytes.len() > LIMIT {
        return Err(WireError::TooLarge { limit: LIMIT });
    }
    let config = bincode::config::legacy().with_limit::<LIMIT>();
    let (value, consumed) = bincode::serde::decode_from_slice(bytes, config).map_err(|error| match error {
        bincode::error::DecodeError::LimitExceeded => WireError::TooLarge { limit: LIMIT },
        error => WireError::Malformed(error.to_string()),
    })?;
    match bytes.len() - consumed {
        0 => Ok(value),
        bytes => Err(WireError::Trailing { bytes }),
    }
}
