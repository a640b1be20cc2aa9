//! Slices of numbers to and from little-endian bytes.

/// Appends `values` to `out`, four bytes each.
pub(crate) fn extend_f32(out: &mut Vec<u8>, values: &[f32]) {
    let start = out.len();
    out.resize(start + 4 * values.len(), 0);
    for (bytes, value) in out[start..].chunks_exact_mut(4).zip(values) {
        bytes.copy_from_slice(&value.to_le_bytes());
    }
}

/// The bytes of `values`, four each.
pub fn f32_bytes(values: &[f32]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(4 * values.len());
    extend_f32(&mut bytes, values);
    bytes
}

/// Replaces `out` by the `f32` values in `bytes`; a remainder of fewer than four bytes is left out.
pub fn read_f32(bytes: &[u8], out: &mut Vec<f32>) {
    out.clear();
    out.extend(f32_values(bytes));
}

/// The `f32` values in `bytes`; a remainder of fewer than four bytes is left out.
pub fn f32s(bytes: &[u8]) -> Vec<f32> {
    f32_values(bytes).collect()
}

/// The first of the `f32` values in `bytes` that is not finite.
pub fn first_not_finite(bytes: &[u8]) -> Option<usize> {
    // NaN and infinity have an exponent of all ones; a branch-free fold finds them at memory bandwidth.
    let suspicious = |b: &[u8]| u8::from(b[3] & 0x7f == 0x7f && b[2] & 0x80 == 0x80);
    if bytes.chunks_exact(4).fold(0, |any, b| any | suspicious(b)) == 0 {
        return None;
    }
    bytes.chunks_exact(4).position(|b| suspicious(b) == 1)
}

/// The `f32` values in `bytes`; a remainder of fewer than four bytes is left out.
pub(crate) fn f32_values(bytes: &[u8]) -> impl ExactSizeIterator<Item = f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

/// The `u32` values in `bytes`; a remainder of fewer than four bytes is left out.
pub(crate) fn u32_values(bytes: &[u8]) -> impl ExactSizeIterator<Item = u32> {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}

/// The `u16` at `at`. The caller knows that `bytes` is long enough.
pub(crate) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

/// The `u32` at `at`. The caller knows that `bytes` is long enough.
pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// The `f32` at `at`. The caller knows that `bytes` is long enough.
pub(crate) fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}

/// The `u64` at `at`. The caller knows that `bytes` is long enough.
pub(crate) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_not_finite_are_found() {
        let first = |values: &[f32]| first_not_finite(&f32_bytes(values));
        assert_eq!(first(&[0.0, -1.5, f32::MAX, f32::MIN_POSITIVE, 1e-45, f32::MIN]), None);
        assert_eq!(first(&[0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0]), Some(4));
        assert_eq!(first(&[f32::NEG_INFINITY, 0.0, 0.0]), Some(0));
    }
}
