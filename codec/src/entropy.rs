//! Whole numbers to bytes: adaptive binary models of their digits, and a range coder (Martin 1979) of the `constriction` crate.
//!
//! One piece of code describes a stream for both directions: it hands each number to a [`Coder`], which writes it, or returns the one that was read
//! and ignores the argument, or only adds up what it would cost.

use crate::error::{Error, Result};
use constriction::Queue;
use constriction::backends::ReadWords;
use constriction::stream::model::{DecoderModel, EncoderModel, EntropyModel};
use constriction::stream::queue::{DefaultRangeDecoder, DefaultRangeEncoder};
use constriction::stream::{Decode, Encode};
use std::cell::Cell;
use std::num::NonZeroU16;
use std::rc::Rc;

/// Bits of a probability.
const PRECISION: usize = 16;
/// A model changes at least by 1/2^FAST, or 1/2^SLOW, of the difference to what it met.
const FAST: u32 = 4;
const SLOW: u32 = 7;

/// 2³² over each rate, rounded up.
const RECIPROCALS: [u64; (1 << SLOW) + 1] = {
    let mut reciprocals = [0; (1 << SLOW) + 1];
    let mut rate = 1;
    while rate < reciprocals.len() {
        reciprocals[rate] = (1u64 << 32).div_ceil(rate as u64);
        rate += 1;
    }
    reciprocals
};

/// The probability that a binary digit is 0: the mean of two estimates that follow what they meet fast and slowly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bit {
    fast: u16,
    slow: u16,
    met: u8,
}

impl Default for Bit {
    fn default() -> Self {
        Self { fast: 1 << 15, slow: 1 << 15, met: 0 }
    }
}

impl Bit {
    /// Probability of 0 in units of 2⁻¹⁶, never 0 or 1.
    fn zero(self) -> u16 {
        (((u32::from(self.fast) + u32::from(self.slow)) / 2) as u16).clamp(48, u16::MAX - 47)
    }

    fn meet(&mut self, one: bool) {
        // At first a plain average of what was met.
        let rate = |limit: u32| (u32::from(self.met) + 2).min(1 << limit);
        // 16 digits times a reciprocal of 32, rounded up, is the quotient for divisors this small.
        let part = |p: u16, rate: u32| ((u64::from(p) * RECIPROCALS[rate as usize]) >> 32) as u16;
        let toward = |p: u16, rate: u32| if one { p - part(p, rate) } else { p + part(u16::MAX - p, rate) };
        (self.fast, self.slow) = (toward(self.fast, rate(FAST)), toward(self.slow, rate(SLOW)));
        self.met = (self.met + 1).min(1 << SLOW);
    }
}

/// A direction of coding.
pub(crate) trait Coder {
    /// Codes a binary digit and returns it.
    fn bit(&mut self, model: &mut Bit, value: bool) -> bool;

    /// Codes the low binary digits of a number, all equally likely.
    fn bits(&mut self, count: u32, value: u32) -> u32 {
        (0..count).rev().fold(0, |number, k| number << 1 | u32::from(self.even(value >> k & 1 == 1)))
    }

    /// Codes a binary digit of probability 1/2.
    fn even(&mut self, value: bool) -> bool {
        self.bit(&mut Bit::default(), value)
    }
}

/// The model of one digit as the range coder reads it.
struct Probability(u16);

impl EntropyModel<PRECISION> for Probability {
    type Symbol = bool;
    type Probability = u16;
}

impl EncoderModel<PRECISION> for Probability {
    fn left_cumulative_and_probability(&self, symbol: impl std::borrow::Borrow<bool>) -> Option<(u16, NonZeroU16)> {
        if *symbol.borrow() {
            NonZeroU16::new(self.0.wrapping_neg()).map(|p| (self.0, p))
        } else {
            NonZeroU16::new(self.0).map(|p| (0, p))
        }
    }
}

impl DecoderModel<PRECISION> for Probability {
    fn quantile_function(&self, quantile: u16) -> (bool, u16, NonZeroU16) {
        let one = quantile >= self.0;
        let (from, width) = if one { (self.0, self.0.wrapping_neg()) } else { (0, self.0) };
        (one, from, NonZeroU16::new(width).unwrap_or(NonZeroU16::MIN))
    }
}

/// Writes.
#[derive(Default)]
pub(crate) struct Encoder(DefaultRangeEncoder);

impl Encoder {
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        let words = self.0.into_compressed().unwrap_or_else(|infallible| match infallible {});
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }
}

impl Coder for Encoder {
    fn bit(&mut self, model: &mut Bit, value: bool) -> bool {
        // Both symbols have a probability above 0, and a vector takes every word.
        let coded = self.0.encode_symbol(value, Probability(model.zero()));
        debug_assert!(coded.is_ok());
        model.meet(value);
        value
    }
}

/// The words of a stream, and zeros after its end.
struct Words {
    words: std::vec::IntoIter<u32>,
    /// Words read past the end.
    past: Rc<Cell<u32>>,
}

impl ReadWords<u32, Queue> for Words {
    type ReadError = std::convert::Infallible;

    fn read(&mut self) -> std::result::Result<Option<u32>, Self::ReadError> {
        let word = self.words.next();
        self.past.set(self.past.get().saturating_add(u32::from(word.is_none())));
        Ok(Some(word.unwrap_or_default()))
    }

    fn maybe_exhausted(&self) -> bool {
        self.words.len() == 0
    }
}

/// Words that a decoder reads past the end of what an encoder wrote, at the most.
const PAST: u32 = 2;

/// Reads. Past the end it goes on with zeros until it is checked; what reads checks that numbers are possible.
pub(crate) struct Decoder {
    coder: DefaultRangeDecoder<Words>,
    past: Rc<Cell<u32>>,
    damaged: bool,
}

impl Decoder {
    pub(crate) fn new(bytes: &[u8]) -> Result<Self> {
        let (words, rest) = bytes.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(Error::Damaged("coded numbers are cut"));
        }
        let words: Vec<u32> = words.iter().map(|&word| u32::from_le_bytes(word)).collect();
        let past = Rc::default();
        let words = Words { words: words.into_iter(), past: Rc::clone(&past) };
        let coder = DefaultRangeDecoder::with_backend(words).unwrap_or_else(|infallible| match infallible {});
        Ok(Self { coder, past, damaged: false })
    }

    /// Whether all that was read can be what an encoder wrote.
    pub(crate) fn check(&self) -> Result<()> {
        if self.damaged || self.past.get() > PAST { Err(Error::Damaged("coded numbers are damaged")) } else { Ok(()) }
    }
}

impl Coder for Decoder {
    fn bit(&mut self, model: &mut Bit, _: bool) -> bool {
        let value = self.coder.decode_symbol(Probability(model.zero())).unwrap_or_else(|_| {
            self.damaged = true;
            false
        });
        model.meet(value);
        value
    }
}

/// Models of whole numbers with either sign, in some contexts: whether it is 0, its sign, then the size, small ones in unary, large ones by their
/// number of binary digits.
pub(crate) struct Integers {
    contexts: Vec<Context>,
    exponent: [Bit; 32],
    leading: [Bit; 32],
}

#[derive(Clone, Default)]
struct Context {
    zero: Bit,
    sign: Bit,
    unary: [Bit; UNARY as usize],
}

/// Sizes from 1 to this are coded in unary.
const UNARY: u32 = 14;
/// Largest size of a number.
pub(crate) const MOST: u32 = 1 << 28;

impl Integers {
    pub(crate) fn new(contexts: usize) -> Self {
        Self { contexts: vec![Context::default(); contexts], exponent: Default::default(), leading: Default::default() }
    }

    /// Codes a number between −[`MOST`] and [`MOST`].
    pub(crate) fn code(&mut self, coder: &mut impl Coder, context: usize, value: i32) -> i32 {
        let models = &mut self.contexts[context];
        if !coder.bit(&mut models.zero, value != 0) {
            return 0;
        }
        let negative = coder.bit(&mut models.sign, value < 0);
        let size = value.unsigned_abs();
        let mut found = 1;
        while found <= UNARY {
            if !coder.bit(&mut models.unary[found as usize - 1], size > found) {
                return if negative { -(found as i32) } else { found as i32 };
            }
            found += 1;
        }
        // Beyond: size − UNARY − 1 plus one, by its digits.
        let rest = size.saturating_sub(UNARY);
        let digits = rest.checked_ilog2().unwrap_or(0);
        let mut count = 0;
        while count < 28 && coder.bit(&mut self.exponent[count as usize], digits > count) {
            count += 1;
        }
        let mut number = 1;
        if count > 0 {
            number = 2 | u32::from(coder.bit(&mut self.leading[count as usize], rest >> (count - 1) & 1 == 1));
            number = number << (count - 1) | coder.bits(count - 1, rest & ((1 << (count - 1)) - 1));
        }
        let size = (number + UNARY).min(MOST) as i32;
        if negative { -size } else { size }
    }

    /// Codes a number that is not negative.
    pub(crate) fn natural(&mut self, coder: &mut impl Coder, context: usize, value: u32) -> u32 {
        // Small ones of both signs are used, so that the sign costs nothing.
        let models = &mut self.contexts[context];
        let mut found = 0;
        while found < UNARY {
            if !coder.bit(&mut models.unary[found as usize], value > found) {
                return found;
            }
            found += 1;
        }
        let rest = value.saturating_sub(UNARY) + 1;
        let digits = rest.ilog2();
        let mut count = 0;
        while count < 31 && coder.bit(&mut self.exponent[count as usize], digits > count) {
            count += 1;
        }
        let number = 1u32 << count | coder.bits(count, rest & ((1 << count) - 1));
        (number - 1).saturating_add(UNARY)
    }
}

/// The context of a number from the sizes around it, in sixteenths: 0 to [`SIZES`] − 1.
pub(crate) fn size_class(sixteenths: u32) -> usize {
    const EDGES: [u32; SIZES - 1] = [1, 3, 5, 8, 12, 17, 24, 34, 48, 70, 100, 150, 230, 400, 900];
    EDGES.partition_point(|&edge| edge <= sixteenths)
}

/// Classes of [`size_class`].
pub(crate) const SIZES: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_and_likely_ones_are_short() {
        let mut random = fastrand::Rng::with_seed(1);
        let numbers: Vec<i32> = (0..20_000)
            .map(|k| match k % 50 {
                0 => random.i32(-(MOST as i32)..=MOST as i32),
                1..5 => random.i32(-40..40),
                _ => i32::from(random.u8(..) < 20),
            })
            .collect();
        let mut encoder = Encoder::default();
        let mut models = Integers::new(2);
        for (k, &x) in numbers.iter().enumerate() {
            assert_eq!(models.code(&mut encoder, usize::from(k % 50 < 5), x), x);
            let x = x.unsigned_abs();
            assert_eq!(models.natural(&mut encoder, usize::from(k % 50 < 5), x), x);
        }
        let bytes = encoder.into_bytes();
        let mut decoder = Decoder::new(&bytes).unwrap();
        let mut models = Integers::new(2);
        for (k, &x) in numbers.iter().enumerate() {
            assert_eq!(models.code(&mut decoder, usize::from(k % 50 < 5), 0), x);
            assert_eq!(models.natural(&mut decoder, usize::from(k % 50 < 5), 0), x.unsigned_abs());
        }
        decoder.check().unwrap();
        // More than was written is noticed.
        (0..1_000).for_each(|_| _ = decoder.bits(20, 0));
        assert!(decoder.check().is_err());
        assert!(bytes.len() < 12_000, "{}", bytes.len());
    }

    #[test]
    fn reciprocals_divide_as_division_does() {
        for rate in 1..=1u64 << SLOW {
            assert!((0..=u64::from(u16::MAX)).all(|p| (p * RECIPROCALS[rate as usize]) >> 32 == p / rate), "{rate}");
        }
    }

    #[test]
    fn damaged_bytes_give_numbers_within_their_range() {
        let mut random = fastrand::Rng::with_seed(2);
        for _ in 0..200 {
            let bytes: Vec<u8> = (0..40).map(|_| random.u8(..)).collect();
            let mut decoder = Decoder::new(&bytes).unwrap();
            let mut models = Integers::new(1);
            for _ in 0..1_000 {
                assert!(models.code(&mut decoder, 0, 0).unsigned_abs() <= MOST);
                models.natural(&mut decoder, 0, 0);
            }
        }
        assert!(Decoder::new(&[1, 2, 3]).is_err());
    }
}
