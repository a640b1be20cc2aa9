//! Coordinates of any width and byte order to `f64`.

/// How a coordinate is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    F16Little,
    F32Little,
    F32Big,
    F64Little,
    F64Big,
}

impl Scalar {
    /// Bytes of a coordinate.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::F16Little => 2,
            Self::F32Little | Self::F32Big => 4,
            Self::F64Little | Self::F64Big => 8,
        }
    }
}

/// Converts `bytes` into `out`, which has as many values; false if any is NaN or infinite.
pub(crate) fn widen(scalar: Scalar, bytes: &[u8], out: &mut [f64]) -> bool {
    match scalar {
        Scalar::F16Little => half(bytes, out),
        Scalar::F32Little => single(bytes, out, u32::from_le_bytes),
        Scalar::F32Big => single(bytes, out, u32::from_be_bytes),
        Scalar::F64Little => double(bytes, out, u64::from_le_bytes),
        Scalar::F64Big => double(bytes, out, u64::from_be_bytes),
    }
}

fn half(bytes: &[u8], out: &mut [f64]) -> bool {
    for (&bytes, out) in bytes.as_chunks().0.iter().zip(&mut *out) {
        *out = half_precision(u16::from_le_bytes(bytes));
    }
    out.iter().all(|x| x.is_finite())
}

/// A number of 16 bits: one for the sign, five for the exponent, ten for what follows the point.
pub(crate) fn half_precision(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff) / 1024.0);
    let size = match exponent {
        0 => fraction / 16384.0,
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * f64::from(exponent - 15).exp2(),
    };
    if bits >> 15 == 0 { size } else { -size }
}

// Without branches, so vectorised: adding one to an exponent of all ones carries into the sign bit.

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
    fn half_precision_is_read() {
        let bits = [0x3c00, 0xc000, 0x3555, 0x0001, 0x7bff, 0x8000, 0x0400_u16];
        let bytes: Vec<u8> = bits.iter().flat_map(|bits| bits.to_le_bytes()).collect();
        let mut out = [7.0; 7];
        assert!(widen(Scalar::F16Little, &bytes, &mut out));
        assert_eq!(out, [1.0, -2.0, 0.333_251_953_125, 2_f64.powi(-24), 65504.0, 0.0, 2_f64.powi(-14)]);
        assert!(
            !widen(Scalar::F16Little, &[0, 0x7c], &mut out[..1])
                && !widen(Scalar::F16Little, &[1, 0xfc], &mut out[..1])
        );
    }

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
