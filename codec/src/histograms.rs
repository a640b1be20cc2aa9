//! How often each whole number is met, and so about what it costs: what adaptive models spend, without coding.

use crate::components::Models;
use crate::entropy::Coder;

/// Numbers up to this size are told apart, larger ones by how many binary digits they have beyond it.
const LARGEST: usize = 30;
const PLACES: usize = 2 * LARGEST + 1 + 32;

/// Counts of numbers in some contexts.
pub(crate) struct Histograms {
    contexts: Vec<[u32; PLACES]>,
    /// Binary digits of the larger numbers, signs included.
    digits: f64,
}

impl Histograms {
    /// Binary digits that the numbers take: their empirical entropy in each context, and half of log₂ of the count for each number that is to be learned.
    pub(crate) fn bits(&self) -> f64 {
        let of_context = |counts: &[u32; PLACES]| {
            let all = f64::from(counts.iter().sum::<u32>());
            let of_number = |&count: &u32| f64::from(count) * (all / f64::from(count)).log2() + 0.5 * all.log2();
            counts.iter().filter(|&&count| count > 0).map(of_number).sum::<f64>()
        };
        self.digits + self.contexts.iter().map(of_context).sum::<f64>()
    }
}

impl Models for Histograms {
    fn new(contexts: usize) -> Self {
        Self { contexts: vec![[0; PLACES]; contexts], digits: 0.0 }
    }

    fn code(&mut self, _: &mut impl Coder, context: usize, value: i32) -> i32 {
        let size = value.unsigned_abs() as usize;
        let place = if size <= LARGEST {
            (LARGEST as i32 + value) as usize
        } else {
            let digits = (size - LARGEST).ilog2();
            self.digits += f64::from(digits + 1);
            2 * LARGEST + 1 + digits as usize
        };
        self.contexts[context][place] += 1;
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
        for spread in [0.2, 2.0, 20.0, 300.0] {
            let (mut coder, mut models, mut estimate) =
                (Encoder::default(), <Integers as Models>::new(2), Histograms::new(2));
            for k in 0..40_000 {
                // About normal, wider in the second context.
                let normal = (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
                let value = (normal * spread * (1.0 + f64::from(k % 2))).round() as i32;
                Models::code(&mut models, &mut coder, k as usize % 2, value);
                assert_eq!(estimate.code(&mut Encoder::default(), k as usize % 2, value), value);
            }
            let (bytes, about) = (coder.into_bytes().len() as f64, estimate.bits() / 8.0);
            assert!((about / bytes - 1.0).abs() < 0.05, "{spread}: {about} for {bytes}");
        }
    }
}
