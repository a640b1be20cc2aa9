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

/// The `f32` values in `bytes`; a remainder of fewer than four bytes is left out.
pub fn f32s(bytes: &[u8]) -> Vec<f32> {
    values(bytes, f32::from_le_bytes).collect()
}

/// The first of the `f32` values in `bytes` that is not finite.
pub fn first_not_finite(bytes: &[u8]) -> Option<usize> {
    // NaN and infinity have an exponent of all ones; a branch-free fold finds them fast.
    let suspicious = |b: &[u8]| u8::from(b[3] & 0x7f == 0x7f && b[2] & 0x80 == 0x80);
    if bytes.chunks_exact(4).fold(0, |any, b| any | suspicious(b)) == 0 {
        return None;
    }
    bytes.chunks_exact(4).position(|b| suspicious(b) == 1)
}

/// The numbers of `N` bytes in `bytes`; a remainder of fewer bytes is left out.
pub fn values<const N: usize, T>(bytes: &[u8], read: fn([u8; N]) -> T) -> impl ExactSizeIterator<Item = T> {
    bytes.as_chunks().0.iter().map(move |&number| read(number))
}

/// The number at `at`. The caller knows that `bytes` is long enough.
pub(crate) fn value_at<const N: usize, T>(bytes: &[u8], at: usize, read: fn([u8; N]) -> T) -> T {
    read(std::array::from_fn(|k| bytes[at + k]))
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
