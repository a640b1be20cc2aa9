//! Checksums of what is stored: databases do not keep any of their rows.

use crate::{CatalogError, FrameEntry};

/// CRC-32C of a cage, which belongs to one frame of one session.
pub(crate) fn of_cage(session: &str, frame: u32, cage: &[u8]) -> u32 {
    let seed = crc32c::crc32c_append(crc32c::crc32c(session.as_bytes()), &frame.to_le_bytes());
    crc32c::crc32c_append(seed, cage)
}

/// CRC-32C of everything else that is stored of a frame.
pub(crate) fn of_entry(session: &str, entry: &FrameEntry) -> u32 {
    let FrameEntry { frame, place, l2, linf, squared, spread, handle_digest, full_digest } = entry;
    let mut crc = crc32c::crc32c(session.as_bytes());
    let mut add = |bytes: &[u8]| crc = crc32c::crc32c_append(crc, bytes);
    for number in [*frame, place.offset, place.bytes, place.crc, bits(*l2), bits(*linf)] {
        add(&number.to_le_bytes());
    }
    add(&place.chunk.to_le_bytes());
    for number in [*squared, *spread] {
        add(&if number.is_nan() { u64::MAX } else { (number + 0.0).to_bits() }.to_le_bytes());
    }
    add(handle_digest);
    add(full_digest.as_ref().map_or(&[], |digest| &digest[..]));
    crc
}

/// What is said of a frame of which something else is stored.
pub(crate) fn mismatch(frame: u32) -> CatalogError {
    CatalogError::Damaged(format!("frame {frame} does not match its checksum"))
}

/// One pattern for all that are not numbers, and one for both zeros: a database keeps none of them apart.
fn bits(number: f32) -> u32 {
    if number.is_nan() { u32::MAX } else { (number + 0.0).to_bits() }
}
