//! Rounding of a Gram matrix to whole steps, the same on every machine.
//!
//! Eigenvectors of nearly equal eigenvalues turn with the rounding of coordinates, so the basis of
//! cages is computed from whole numbers of steps. Where an entry lies so close to the middle that
//! another machine might round it the other way, the bytes say whether the number is odd.

use crate::error::{Error, Result, take};
use faer::{Mat, MatRef};

/// Steps in the mean of the diagonal, at least: rounding is small beside the floor of eigenvalues.
const STEPS: f64 = 16_384.0;
/// Steps are from two to the power of less this to two to the power of this.
const MAX_EXPONENT: f64 = 1000.0;
/// Entries are counted in so many steps at the most, so that they are exact in double precision.
const MAX_STEPS: f64 = 9.0e15;

const DAMAGED: &str = "the rounding of a basis is damaged";

/// How a Gram matrix is rounded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GramRounding {
    /// A step is two to the power of this.
    exponent: i16,
    /// Entries of the lower triangle between two whole numbers, and whether the one to take is odd.
    between: Vec<(u32, bool)>,
}

impl GramRounding {
    /// For a matrix that other machines compute to `tolerance` of its mean diagonal, if finite.
    pub(crate) fn of(products: MatRef<'_, f64>, tolerance: f64) -> Option<Self> {
        let m = products.nrows();
        let mean = (0..m).map(|k| products[(k, k)]).sum::<f64>() / m.max(1) as f64;
        if !mean.is_finite() {
            return None;
        }
        let exponent = (mean.max(f64::MIN_POSITIVE) / STEPS).log2().floor().max(-MAX_EXPONENT);
        if exponent > MAX_EXPONENT {
            return None;
        }
        let step = exponent.exp2();
        let margin = tolerance * mean / step;
        let mut between = Vec::new();
        for (at, (i, j)) in lower(m).enumerate() {
            let steps = products[(i, j)] / step;
            if steps.is_nan() || steps.abs() >= MAX_STEPS {
                return None;
            }
            if ((steps - steps.floor()) - 0.5).abs() <= margin {
                between.push((at as u32, steps.round() % 2.0 != 0.0));
            }
        }
        Some(Self { exponent: exponent as i16, between })
    }

    /// The matrix in whole steps; `None` where numbers are not finite.
    pub(crate) fn apply(&self, mut products: Mat<f64>) -> Option<Mat<f64>> {
        let step = f64::from(self.exponent).exp2();
        let mut between = self.between.iter().peekable();
        for (at, (i, j)) in lower(products.nrows()).enumerate() {
            let steps = products[(i, j)] / step;
            if steps.is_nan() || steps.abs() >= MAX_STEPS {
                return None;
            }
            let whole = match between.next_if(|(place, _)| *place as usize == at) {
                Some((_, true)) => 2.0 * ((steps - 1.0) / 2.0).round() + 1.0,
                Some((_, false)) => 2.0 * (steps / 2.0).round(),
                None => steps.round(),
            };
            products[(i, j)] = whole * step;
            products[(j, i)] = whole * step;
        }
        between.peek().is_none().then_some(products)
    }

    /// The exponent, the count, and of each entry twice those passed over, plus one if odd.
    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        out.extend(self.exponent.to_le_bytes());
        write_number(out, self.between.len() as u64);
        let mut next = 0;
        for &(place, is_odd) in &self.between {
            write_number(out, 2 * u64::from(place - next) + u64::from(is_odd));
            next = place + 1;
        }
    }

    /// Reads what [`Self::write`] wrote from the front of bytes.
    pub(crate) fn read(bytes: &mut &[u8]) -> Result<Self> {
        let damaged = || Error::Damaged(DAMAGED);
        let exponent = i16::from_le_bytes(take(bytes, DAMAGED)?);
        if f64::from(exponent).abs() > MAX_EXPONENT {
            return Err(damaged());
        }
        let count = read_number(bytes)?;
        // Each takes a byte at least.
        if count > bytes.len() as u64 {
            return Err(damaged());
        }
        let (mut between, mut next) = (Vec::with_capacity(count as usize), 0u64);
        for _ in 0..count {
            let number = read_number(bytes)?;
            let place = u32::try_from(next.saturating_add(number / 2)).map_err(|_| damaged())?;
            between.push((place, number % 2 == 1));
            next = u64::from(place) + 1;
        }
        Ok(Self { exponent, between })
    }
}

/// Rows and columns of the lower triangle, row by row.
fn lower(m: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..m).flat_map(|i| (0..=i).map(move |j| (i, j)))
}

fn write_number(out: &mut Vec<u8>, mut number: u64) {
    while number >= 128 {
        out.push(number as u8 | 128);
        number >>= 7;
    }
    out.push(number as u8);
}

fn read_number(bytes: &mut &[u8]) -> Result<u64> {
    let mut number = 0;
    for shift in (0..63).step_by(7) {
        let [byte] = take(bytes, DAMAGED)?;
        number |= u64::from(byte & 127) << shift;
        if byte < 128 {
            return Ok(number);
        }
    }
    Err(Error::Damaged(DAMAGED))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_beside_the_middle_of_two_numbers_round_as_the_bytes_say() {
        let step = (1.0f64 / STEPS).log2().floor().exp2();
        // Half a step more and less by what machines differ by.
        let entry = |by: f64| Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { step * (7.5 + by) });
        let rounding = GramRounding::of(entry(1e-7).as_ref(), 1e-9).unwrap();
        assert_eq!(rounding.between, [(1, false)]);
        let applied = |by: f64| rounding.apply(entry(by)).unwrap()[(0, 1)] / step;
        assert_eq!([-1e-5, 0.0, 1e-7, 1e-5].map(applied), [8.0; 4]);
        let mut bytes = Vec::new();
        rounding.write(&mut bytes);
        let mut rest = bytes.as_slice();
        assert_eq!((GramRounding::read(&mut rest).unwrap(), rest), (rounding.clone(), [].as_slice()));
        assert!((0..bytes.len()).all(|cut| GramRounding::read(&mut &bytes[..cut]).is_err()));
        // Places beyond the matrix are no entries of it.
        assert!(rounding.apply(Mat::from_fn(1, 1, |_, _| 1.0)).is_none());
    }
}
