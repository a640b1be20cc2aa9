//! The errors of frames, each to twelve binary digits, as differences to those of the frame before.

use crate::entropy::{Coder, Decoder, Encoder, Integers, MAX_CONTEXT_SIZE, Models, SIZES, size_class};
use crate::error::{Error, Result};

/// Digits of a single-precision number that are left out.
const LEFT_OUT: u32 = 12;

/// An error as [`encode_errors`] keeps it: not smaller.
pub fn rounded_error(error: f32) -> f32 {
    if error.is_nan() {
        return f32::NAN;
    }
    f32::from_bits(error.to_bits().next_multiple_of(1 << LEFT_OUT)).min(f32::MAX)
}

/// Codes the errors of frames, rounded up to twelve binary digits; NaN stays.
pub fn encode_errors(errors: &[[f32; 2]]) -> Vec<u8> {
    let mut coder = Encoder::default();
    code(&mut coder, errors.len(), errors);
    coder.into_bytes()
}

/// What [`encode_errors`] wrote for so many frames.
pub fn decode_errors(bytes: &[u8], frames: usize) -> Result<Vec<[f32; 2]>> {
    let mut coder = Decoder::new(bytes)?;
    let errors = code(&mut coder, frames, &[]);
    coder.check()?;
    let is_error = |&error: &f32| error.is_nan() || error >= 0.0;
    errors
        .filter(|errors| errors.iter().flatten().all(is_error))
        .ok_or(Error::Damaged("an error of a frame is negative or out of range"))
}

fn code(coder: &mut impl Coder, frames: usize, given: &[[f32; 2]]) -> Option<Vec<[f32; 2]>> {
    let mut models = [Integers::new(SIZES), Integers::new(SIZES)];
    let (mut before, mut around) = ([0i32; 2], [0u32; 2]);
    let mut found = Vec::with_capacity(frames);
    for frame in 0..frames {
        for k in 0..2 {
            let number = given.get(frame).map_or(0, |errors| (rounded_error(errors[k]).to_bits() >> LEFT_OUT) as i32);
            let difference = models[k].code(coder, size_class(around[k]), number - before[k]);
            before[k] = before[k].saturating_add(difference);
            around[k] = (around[k] + difference.unsigned_abs().min(MAX_CONTEXT_SIZE)) / 2;
        }
        if coder.is_damaged() || before.iter().any(|number| !(0..1 << (u32::BITS - LEFT_OUT)).contains(number)) {
            return None;
        }
        found.push(before.map(|number| f32::from_bits((number as u32) << LEFT_OUT)));
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_come_back_to_twelve_digits_and_missing_ones_stay_missing() {
        let mut random = fastrand::Rng::with_seed(1);
        let smooth = |t: usize, r: f32| 1e-3 * (2.0 + (0.1 * t as f32).sin()) * (1.0 + 0.01 * r);
        let mut errors: Vec<[f32; 2]> =
            (0..300).map(|t| [smooth(t, random.f32()), 4.0 * smooth(t, random.f32())]).collect();
        assert!(encode_errors(&errors).len() < 3 * errors.len());
        errors.extend([[0.0, 0.0], [f32::NAN, f32::NAN], [1e-30, 1e30]]);
        let bytes = encode_errors(&errors);
        for (a, b) in decode_errors(&bytes, errors.len()).unwrap().iter().flatten().zip(errors.iter().flatten()) {
            assert!(a.is_nan() && b.is_nan() || a >= b && a - b <= b / 2048.0, "{a} {b}");
        }
        assert!(decode_errors(&bytes, 100_000).is_err());
        let mut refused = 0;
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x5a;
            match decode_errors(&damaged, errors.len()) {
                Ok(found) => {
                    assert_eq!(found.len(), errors.len());
                    assert!(found.iter().flatten().all(|x| x.is_nan() || *x >= 0.0), "an error below 0");
                }
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 0);
    }
}
