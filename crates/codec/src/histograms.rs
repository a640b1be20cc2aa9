//! Empirical entropy of whole numbers: about the bits that adaptive models take.

use crate::entropy::{Coder, Models, UNARY};

/// Numbers that a context tells apart: those up to [`UNARY`] of either sign, and all beyond.
const PLACES: usize = 2 * UNARY as usize + 3;

/// What an adaptive model spends beyond the entropy of a binary digit, measured on normal numbers.
const ADAPTATION: f64 = 0.008;

/// Counts of numbers in some contexts.
pub(crate) struct Histograms {
    contexts: Vec<[u32; PLACES]>,
    /// Numbers beyond: by the number of their binary digits, and the first after the leading 1.
    beyond: [u32; 2 * 32],
    /// Binary digits that follow.
    digits: f64,
    /// Digits that would be coded by adaptive models.
    modelled: f64,
}

impl Histograms {
    /// Binary digits of the numbers, with half of log₂ of the count for each one to be learned.
    pub(crate) fn bits(&self) -> f64 {
        self.digits
            + ADAPTATION * self.modelled
            + entropy(&self.beyond)
            + self.contexts.iter().map(|counts| entropy(counts)).sum::<f64>()
    }
}

fn entropy(counts: &[u32]) -> f64 {
    let all = f64::from(counts.iter().sum::<u32>());
    let of_number = |&count: &u32| f64::from(count) * (all / f64::from(count)).log2() + 0.5 * all.log2();
    counts.iter().filter(|&&count| count > 0).map(of_number).sum()
}

impl Models for Histograms {
    fn new(contexts: usize) -> Self {
        Self { contexts: vec![[0; PLACES]; contexts], beyond: [0; 2 * 32], digits: 0.0, modelled: 0.0 }
    }

    fn code(&mut self, _: &mut impl Coder, context: usize, value: i32) -> i32 {
        const MAX: i32 = UNARY as i32 + 1;
        self.contexts[context][(MAX + value.clamp(-MAX, MAX)) as usize] += 1;
        let size = value.unsigned_abs();
        self.modelled += f64::from(1 + (size + 1).min(UNARY));
        if size > UNARY {
            let beyond = size - UNARY;
            let digits = beyond.ilog2();
            let first = digits > 0 && beyond >> (digits - 1) & 1 == 1;
            self.beyond[2 * digits as usize + usize::from(first)] += 1;
            self.digits += f64::from(digits.saturating_sub(1));
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::entropy::{Encoder, Integers};

    #[test]
    fn estimates_are_near_what_coding_takes() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut over = Vec::new();
        for spread in [0.2, 2.0, 20.0, 60.0, 220.0, 900.0] {
            let (mut coder, mut models, mut estimate) = (Encoder::default(), Integers::new(2), Histograms::new(2));
            for k in 0..40_000 {
                // About normal, wider in the second context.
                let normal = (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
                let value = (normal * spread * (1.0 + f64::from(k % 2))).round() as i32;
                models.code(&mut coder, k as usize % 2, value);
                assert_eq!(estimate.code(&mut Encoder::default(), k as usize % 2, value), value);
            }
            over.push((estimate.bits() - 8.0 * coder.into_bytes().len() as f64) / 40_000.0);
        }
        // In bits a number: what differs from one spread to another misleads who compares them.
        assert!(over.iter().all(|bits| bits.abs() < 0.05), "{over:.3?}");
    }
}
