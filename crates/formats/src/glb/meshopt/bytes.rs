//! Numbers from streams.

/// A number in groups of seven bits, the lowest first, from the front of a stream.
pub(super) fn number(stream: &mut &[u8]) -> Option<u32> {
    let mut value = 0;
    for shift in [0, 7, 14, 21, 28] {
        let byte = *stream.split_off_first()?;
        value |= u32::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

/// A signed number from one whose lowest bit is its sign, in wrapping arithmetic.
pub(super) fn signed(value: u32) -> u32 {
    if value & 1 == 0 { value >> 1 } else { !(value >> 1) }
}
