//! Coordinates of any width and byte order to `f64`.

/// How a coordinate is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    F32Little,
    F32Big,
    F64Little,
    F64Big,
}

impl Scalar {
    /// Bytes of a coordinate.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::F32Little | Self::F32Big => 4,
            Self::F64Little | Self::F64Big => 8,
        }
    }
}

/// Converts `bytes` into `out`, which has as many values; false if any is NaN or infinite.
pub(crate) fn widen(scalar: Scalar, bytes: &[u8], out: &mut [f64]) -> bool {
    match scalar {
        Scalar::F32Little => single(bytes, out, u32::from_le_bytes),
        Scalar::F32Big => single(bytes, out, u32::from_be_bytes),
        Scalar::F64Little => double(bytes, out, u64::from_le_bytes),
        Scalar::F64Big => double(bytes, out, u64::from_be_bytes),
    }
}

// The loops have no branch, so that they are vectorised: adding one to an exponent of all ones carries into the sign bit.

fn single(bytes: &[u8], out: &mut [f64], decode: impl Fn([u8; 4]) -> u32) -> bool {
    let mut carried = 0;
    for (&bytes, out) in bytes.as_chunks().0.iter().zip(out) {
        let bits = decode(bytes);
        carried |= (bits & 0x7f80_0000) + 0x0080_0000;
        *out = f32::from_bits(bits).into();
    }
    carried >> 31 == 0
}

fn double(bytes: &[u8], out: &mut [f64], decode: impl Fn([u8; 8]) -> u64) -> bool {
    let mut carried = 0;
    for (&bytes, out) in bytes.as_chunks().0.iter().zip(out) {
        let bits = decode(bytes);
        carried |= (bits & 0x7ff0_0000_0000_0000) + 0x0010_0000_0000_0000;
        *out = f64::from_bits(bits);
    }
    carried >> 63 == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_nan_and_infinity_are_not_finite() {
        let values = [
            0.0,
            -0.0,
            1.5,
            f32::MAX,
            f32::MIN,
            f32::MIN_POSITIVE,
            1e-45,
            f32::INFINITY,
            -f32::INFINITY,
            f32::NAN,
            -f32::NAN,
        ];
        for x in values {
            let wide = f64::from(x);
            let stored: [(Scalar, &[u8]); 4] = [
                (Scalar::F32Little, &x.to_le_bytes()),
                (Scalar::F32Big, &x.to_be_bytes()),
                (Scalar::F64Little, &wide.to_le_bytes()),
                (Scalar::F64Big, &wide.to_be_bytes()),
            ];
            for (scalar, bytes) in stored {
                let mut out = [7.0];
                assert_eq!(widen(scalar, bytes, &mut out), x.is_finite(), "{x} as {scalar:?}");
                assert!(out[0].to_bits() == wide.to_bits() || x.is_nan(), "{x} as {scalar:?}");
            }
        }
    }
}
