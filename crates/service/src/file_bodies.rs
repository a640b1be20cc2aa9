//! Files posted where numbers are expected: refused by their first bytes, before anything of them is kept.

use crate::problem::{self, ApiError};
use cager_formats::Signature;
use cager_proto::record::{self, Kind, RecordError};

/// Bytes of a body that are looked at.
pub(crate) const TELLING_BYTES: usize = 256;
/// Bytes of text that are no numbers: of so many numbers some byte is no letter.
const TEXT_BYTES: usize = 64;

/// What a body is instead of numbers, and what to send, if it begins with the bytes of a file: `TELLING_BYTES`, or as many as its first
/// frame has.
pub(crate) fn instead_of_numbers(start: &[u8]) -> Option<String> {
    let start = &start[..start.len().min(TELLING_BYTES)];
    Some(match Signature::of(start) {
        Some(Signature::Text | Signature::MeshText(_))
            if !start.iter().take(TEXT_BYTES).all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace()) =>
        {
            return None;
        }
        Some(found) => found.stand_in().unwrap_or_else(|| {
            let values = "x y z of every point as little-endian f32, with nothing before them";
            format!("is {}, not raw numbers; send the values alone, {values}", found.noun())
        }),
        None if begins_a_record(start) => format!("has frame records; send it as {}", record::MEDIA_TYPE),
        None => return None,
    })
}

/// Refuses a body that begins as a file.
///
/// # Errors
/// `INVALID_FRAME`.
pub(crate) fn refuse_file(start: &[u8]) -> Result<(), ApiError> {
    let refuse = |what| Err(ApiError::new(problem::INVALID_FRAME, format!("the body {what}")));
    instead_of_numbers(start).map_or(Ok(()), refuse)
}

fn begins_a_record(start: &[u8]) -> bool {
    let header = record::decode_header(start, Kind::Cage, 0);
    matches!(header, Ok(_) | Err(RecordError::Kind { .. } | RecordError::Rows { .. }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_taken_even_if_they_begin_with_the_letters_of_a_file() {
        let like_text: Vec<u8> = b"v 0.5 0.5".iter().copied().chain([b'?'; 3]).chain([0x80, 0x3f].repeat(40)).collect();
        assert!(refuse_file(&like_text).is_ok());
        let ones = 1.0_f32.to_le_bytes().repeat(30);
        assert!(refuse_file(&ones).is_ok());
        assert!(refuse_file(b"v 0.5 0.25 0.125\nv 1 2 3\n").is_err());
    }
}
