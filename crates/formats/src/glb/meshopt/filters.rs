//! What is done to elements after they are read.

pub(super) type Filter = fn(&mut [u8]);

/// Numbers of 24 bits with an exponent become floats.
pub(super) fn exponential(element: &mut [u8]) {
    for bytes in element.as_chunks_mut::<4>().0 {
        let value = i32::from_le_bytes(*bytes);
        let (exponent, mantissa) = (value >> 24, value << 8 >> 8);
        // Exact before it is rounded once, as every exponent is within the range of `f64`.
        *bytes = ((f64::from(mantissa) * 2_f64.powi(exponent)) as f32).to_le_bytes();
    }
}

/// All four parts of a unit quaternion, from three and a scale, whose lowest two bits say which
/// part is left out, the largest.
pub(super) fn quaternion(element: &mut [u8]) {
    for bytes in element.as_chunks_mut::<8>().0 {
        let [x, y, z, scale] = [0, 2, 4, 6].map(|k| i16::from_le_bytes([bytes[k], bytes[k + 1]]));
        let largest = usize::from(scale as u16 & 3);
        let scale = std::f64::consts::FRAC_1_SQRT_2 / f64::from(scale | 3);
        let [x, y, z] = [x, y, z].map(|part| f64::from(part) * scale);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        for (k, part) in [w, x, y, z].into_iter().enumerate() {
            let whole = (part * 32767.0).round() as i16;
            bytes.as_chunks_mut::<2>().0[(largest + k) % 4] = whole.to_le_bytes();
        }
    }
}

/// Light, two differences of colours and opacity become red, green, blue and opacity.
pub(super) fn color(element: &mut [u8]) {
    if let Ok(bytes) = <&mut [u8; 4]>::try_from(&mut *element) {
        let [y, co, cg, a] = *bytes;
        let signed = |byte: u8| f64::from(byte as i8);
        *bytes = rgba(y.into(), signed(co), signed(cg), a.into(), 255.0).map(|x| x as u8);
        return;
    }
    for bytes in element.as_chunks_mut::<8>().0 {
        let value = |k: usize| u16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]]);
        let signed = |k| f64::from(value(k) as i16);
        let colors = rgba(value(0).into(), signed(1), signed(2), value(3).into(), 65535.0);
        for (bytes, color) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(colors) {
            *bytes = (color as u16).to_le_bytes();
        }
    }
}

/// The highest bit of the stored opacity tells how many bits all four have.
fn rgba(y: f64, co: f64, cg: f64, a: u32, most: f64) -> [f64; 4] {
    let full = if a == 0 { 1 } else { u32::MAX >> a.leading_zeros() };
    let a = a & (full >> 1);
    let opacity = a << 1 | a & 1;
    [y + co - cg, y + cg, y - co - cg, opacity.into()].map(|x| (x * most / f64::from(full)).round().clamp(0.0, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_scale_their_numbers() {
        let mut bytes = [(-2_i32 << 24 | 3).to_le_bytes(), (1_i32 << 24 | 0xff_ffff).to_le_bytes()].concat();
        exponential(&mut bytes);
        assert_eq!(bytes, [0.75_f32.to_le_bytes(), (-2.0_f32).to_le_bytes()].concat());
    }

    #[test]
    fn the_largest_part_of_a_quaternion_follows_from_the_others() {
        // A half turn about an axis between y and z, where z is left out.
        let mut bytes = [0_i16, 0, 0x7ff, 0x7ff & !3 | 2].map(i16::to_le_bytes).concat();
        quaternion(&mut bytes);
        assert_eq!(bytes, [0_i16, 23170, 23170, 0].map(i16::to_le_bytes).concat());
    }

    #[test]
    fn grey_stays_grey() {
        let mut bytes = [100, 0, 0, 255];
        color(&mut bytes);
        assert_eq!(bytes, [100, 100, 100, 255]);
    }
}
