//! Small structured values to and from bytes. The only module that knows bincode.
//!
//! The layout is bincode's "legacy" one, the same as bincode 1 wrote by default: little-endian, integers at their full
//! width, `bool` one byte, enums a `u32` variant number, `Option` one byte 0 or 1 before the value, strings and
//! sequences a `u64` length before their elements, structs and tuples their fields back to back, no padding. Matrices and
//! positions do not go through here: they travel as raw little-endian numbers.
//!
//! # Why the version is pinned, and how to leave
//!
//! bincode is unmaintained (RUSTSEC-2025-0141) and its 3.0.0 is an empty release that does not compile, so the workspace
//! pins `=2.0.1`. The advisory reports no vulnerability; what bincode is known to do badly with hostile bytes is avoided
//! here: every call has a limit, which keeps a forged length from being allocated, and bytes left over are an error.
//!
//! To leave, rewrite the bodies of [`encode`] and [`decode`] on another library of the same layout. `serde-wincode` is
//! one: the tests of this crate read these bytes with it and compare them with a golden copy.

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
/// [`WireError::TooLarge`] past the limit, so that nothing is written that [`decode`] would refuse;
/// [`WireError::Unsupported`] for a value that serde cannot put in this layout.
pub fn encode<T: Serialize + ?Sized, const LIMIT: usize>(value: &T) -> Result<Vec<u8>, WireError> {
    let bytes = bincode::serde::encode_to_vec(value, bincode::config::legacy())
        .map_err(|error| WireError::Unsupported(error.to_string()))?;
    if bytes.len() > LIMIT {
        return Err(WireError::TooLarge { limit: LIMIT });
    }
    Ok(bytes)
}

/// Decodes a value from exactly `bytes`, allocating no more than a small multiple of `LIMIT`, and for a sequence up to the
/// 1 MiB that serde reserves ahead.
///
/// # Errors
/// [`WireError::TooLarge`] if `bytes` or a length inside them passes the limit, [`WireError::Trailing`] if bytes are left
/// over, [`WireError::Malformed`] otherwise.
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
