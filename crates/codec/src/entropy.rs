//! Whole numbers to bytes: adaptive binary models and a range coder (Martin 1979).
//!
//! One piece of code describes a stream for both directions: a [`Coder`] writes each number that it
//! is given, or returns the one that it reads and ignores the argument.

use crate::error::{Error, Result};
use constriction::stream::Encode;
use constriction::stream::model::{EncoderModel, EntropyModel};
use constriction::stream::queue::DefaultRangeEncoder;
use std::num::NonZeroU16;

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

/// The probability that a digit is 0: the mean of two estimates that follow fast and slowly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryModel {
    fast: u16,
    slow: u16,
    met: u8,
}

impl Default for BinaryModel {
    fn default() -> Self {
        Self { fast: 1 << 15, slow: 1 << 15, met: 0 }
    }
}

impl BinaryModel {
    /// Probability of 0 in units of 2⁻¹⁶, never 0 or 1.
    #[inline(always)]
    fn zero(self) -> u16 {
        (((u32::from(self.fast) + u32::from(self.slow)) / 2) as u16).clamp(48, u16::MAX - 47)
    }

    #[inline(always)]
    fn update(&mut self, one: bool) {
        let left = |p: u16| if one { p } else { u16::MAX - p };
        let (fast, slow) = if self.met >= (1 << SLOW) - 2 {
            (left(self.fast) >> FAST, left(self.slow) >> SLOW)
        } else {
            // At first a plain average: for these divisors the reciprocal gives the quotient.
            let rate = u32::from(self.met) + 2;
            self.met += 1;
            let part = |p: u16, rate: u32| ((u64::from(p) * RECIPROCALS[rate as usize]) >> 32) as u16;
            (part(left(self.fast), rate.min(1 << FAST)), part(left(self.slow), rate))
        };
        let toward = |p: u16, part: u16| if one { p - part } else { p + part };
        (self.fast, self.slow) = (toward(self.fast, fast), toward(self.slow, slow));
    }
}

/// A direction of coding.
pub(crate) trait Coder {
    /// Codes a binary digit and returns it.
    fn bit(&mut self, model: &mut BinaryModel, value: bool) -> bool;

    /// Codes the low binary digits of a number, all equally likely.
    fn bits(&mut self, count: u32, value: u32) -> u32 {
        (0..count).rev().fold(0, |number, k| number << 1 | u32::from(self.bypass(value >> k & 1 == 1)))
    }

    /// Whether what was read cannot be what an encoder wrote.
    fn is_damaged(&self) -> bool {
        false
    }

    /// Refuses what cannot be what an encoder wrote.
    fn check(&self) -> Result<()> {
        if self.is_damaged() { Err(Error::Damaged("coded numbers are damaged")) } else { Ok(()) }
    }

    /// Codes a binary digit of probability 1/2.
    fn bypass(&mut self, value: bool) -> bool {
        self.bit(&mut BinaryModel::default(), value)
    }
}

/// The model of one digit as the range coder takes it.
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

/// Writes.
#[derive(Clone, Default)]
pub(crate) struct Encoder(DefaultRangeEncoder);

impl Encoder {
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        let words = self.0.into_compressed().unwrap_or_else(|infallible| match infallible {});
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }
}

impl Coder for Encoder {
    fn bit(&mut self, model: &mut BinaryModel, value: bool) -> bool {
        // Both symbols have a probability above 0, and a vector takes every word.
        let coded = self.0.encode_symbol(value, Probability(model.zero()));
        debug_assert!(coded.is_ok());
        model.update(value);
        value
    }
}

/// Words that a decoder reads past the end of what an encoder wrote, at the most.
const PAST: u32 = 2;

/// Reads what the encoder of `constriction` wrote, without the division of that crate's decoder for
/// any alphabet. Past the end it goes on with zeros until it is checked.
pub(crate) struct Decoder<'a> {
    words: std::slice::Iter<'a, [u8; 4]>,
    /// Words read past the end.
    past: u32,
    /// Where the coded number lies in the range that is left, from its beginning.
    offset: u64,
    range: u64,
    damaged: bool,
}

impl<'a> Decoder<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Result<Self> {
        let (words, rest) = bytes.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(Error::Damaged("coded numbers are cut"));
        }
        let mut decoder = Self { words: words.iter(), past: 0, offset: 0, range: u64::MAX, damaged: false };
        decoder.offset = decoder.word() << 32;
        decoder.offset |= decoder.word();
        Ok(decoder)
    }

    fn word(&mut self) -> u64 {
        match self.words.next() {
            Some(&word) => u64::from(u32::from_le_bytes(word)),
            None => {
                self.past = self.past.saturating_add(1);
                0
            }
        }
    }
}

impl Coder for Decoder<'_> {
    #[inline(always)]
    fn bit(&mut self, model: &mut BinaryModel, _: bool) -> bool {
        let unit = self.range >> PRECISION;
        let zeros = unit * u64::from(model.zero());
        let one = self.offset >= zeros;
        if one {
            // No encoder leaves a number in what is lost by rounding the range down to whole units.
            self.damaged |= self.offset >= unit << PRECISION;
            self.offset -= zeros;
            self.range = (unit << PRECISION) - zeros;
        } else {
            self.range = zeros;
        }
        if self.range < 1 << 32 {
            self.range <<= 32;
            self.offset = self.offset << 32 | self.word();
        }
        model.update(one);
        one
    }

    fn is_damaged(&self) -> bool {
        self.damaged || self.past > PAST
    }
}

/// A number by whether it is 0, its sign, and its size, small ones in unary.
pub(crate) struct Integers {
    contexts: Vec<Context>,
    exponent: [BinaryModel; 32],
    leading: [BinaryModel; 32],
}

#[derive(Clone, Default)]
struct Context {
    zero: BinaryModel,
    sign: BinaryModel,
    unary: [BinaryModel; UNARY as usize],
}

/// Sizes from 1 to this are coded in unary.
pub(crate) const UNARY: u32 = 14;
/// Largest size of a number.
pub(crate) const MAX_SIZE: u32 = 1 << 28;
/// Sizes around a number count up to this for its context.
pub(crate) const MAX_CONTEXT_SIZE: u32 = 1 << 20;
/// Sizes of residuals are kept up to this.
pub(crate) const MAX_RESIDUAL_SIZE: u32 = 1 << 16;

/// Models of whole numbers with either sign, in some contexts.
pub(crate) trait Models: Send {
    fn new(contexts: usize) -> Self;

    /// Codes a number between −[`MAX_SIZE`] and [`MAX_SIZE`], and gives it back.
    fn code(&mut self, coder: &mut impl Coder, context: usize, value: i32) -> i32;
}

impl Models for Integers {
    fn new(contexts: usize) -> Self {
        Self { contexts: vec![Context::default(); contexts], exponent: Default::default(), leading: Default::default() }
    }

    fn code(&mut self, coder: &mut impl Coder, context: usize, value: i32) -> i32 {
        let models = &mut self.contexts[context];
        if !coder.bit(&mut models.zero, value != 0) {
            return 0;
        }
        let negative = coder.bit(&mut models.sign, value < 0);
        let with_sign = |size: u32| if negative { -(size as i32) } else { size as i32 };
        let size = value.unsigned_abs();
        let small = unary(coder, &mut models.unary, size.saturating_sub(1));
        if small < UNARY {
            return with_sign(small + 1);
        }
        // Beyond: size − UNARY − 1 plus one, by its digits.
        let rest = size.saturating_sub(UNARY);
        let count = unary(coder, &mut self.exponent[..28], rest.checked_ilog2().unwrap_or(0));
        let mut number = 1;
        if count > 0 {
            number = 2 | u32::from(coder.bit(&mut self.leading[count as usize], rest >> (count - 1) & 1 == 1));
            number = number << (count - 1) | coder.bits(count - 1, rest & ((1 << (count - 1)) - 1));
        }
        with_sign((number + UNARY).min(MAX_SIZE))
    }
}

impl Integers {
    /// Codes a number that is not negative.
    pub(crate) fn natural(&mut self, coder: &mut impl Coder, context: usize, value: u32) -> u32 {
        // Small ones of both signs are used, so that the sign costs nothing.
        let small = unary(coder, &mut self.contexts[context].unary, value);
        if small < UNARY {
            return small;
        }
        let rest = value.saturating_sub(UNARY) + 1;
        let count = unary(coder, &mut self.exponent[..31], rest.ilog2());
        let number = 1u32 << count | coder.bits(count, rest & ((1 << count) - 1));
        (number - 1).saturating_add(UNARY)
    }
}

/// Codes a number that is at most that of the models: as many times 1, then 0.
#[inline(always)]
pub(crate) fn unary(coder: &mut impl Coder, models: &mut [BinaryModel], value: u32) -> u32 {
    let mut found = 0;
    while (found as usize) < models.len() && coder.bit(&mut models[found as usize], value > found) {
        found += 1;
    }
    found
}

/// The context of a number from the sizes around it, in sixteenths: 0 to [`SIZES`] − 1.
pub(crate) fn size_class(sixteenths: u32) -> usize {
    const EDGES: [u32; SIZES - 1] = [1, 3, 5, 8, 12, 17, 24, 34, 48, 70, 100, 150, 230, 400, LAST];
    const LAST: u32 = 900;
    const CLASSES: [u8; LAST as usize + 1] = {
        let mut classes = [0; LAST as usize + 1];
        let mut size = 1;
        while size < classes.len() {
            let class = classes[size - 1];
            classes[size] = class + (size as u32 == EDGES[class as usize]) as u8;
            size += 1;
        }
        classes
    };
    usize::from(CLASSES[sixteenths.min(LAST) as usize])
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
                0 => random.i32(-(MAX_SIZE as i32)..=MAX_SIZE as i32),
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
                assert!(models.code(&mut decoder, 0, 0).unsigned_abs() <= MAX_SIZE);
                models.natural(&mut decoder, 0, 0);
            }
        }
        assert!(Decoder::new(&[1, 2, 3]).is_err());
    }
}
