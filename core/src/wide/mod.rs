//! Floating-point numbers of 192 bits, for the few places where differences leave nothing of double precision.
//!
//! Operations truncate: each is off by at most a few units of the last bit (2⁻¹⁹¹ of the larger operand). They are made of
//! integer operations only, so their bits are the same on every machine. Differences of doubles of similar size are exact.

mod angle;

pub(crate) use angle::angle;

use std::cmp::Ordering;
use std::ops::{Add, Mul, Neg, Sub};

/// Limbs of a mantissa, the lowest first.
const LIMBS: usize = 3;
const BITS: i32 = 64 * LIMBS as i32;

/// `± mantissa · 2^(exponent − 192)`: the highest bit of the mantissa is set, so the value lies in `[½, 1) · 2^exponent`;
/// or zero, with nothing set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wide {
    negative: bool,
    exponent: i32,
    mantissa: [u64; LIMBS],
}

/// A vector in space.
pub(crate) type Vector = [Wide; 3];

impl Wide {
    pub(crate) const ZERO: Self = Self { negative: false, exponent: 0, mantissa: [0; LIMBS] };
    pub(crate) const ONE: Self = Self { negative: false, exponent: 1, mantissa: [0, 0, 1 << 63] };

    /// The value of a finite double, exactly.
    pub(crate) fn new(value: f64) -> Self {
        if value == 0.0 {
            return Self::ZERO;
        }
        let bits = value.to_bits();
        let (field, fraction) = ((bits >> 52) as i32 & 0x7FF, bits & ((1 << 52) - 1));
        // Subnormal numbers have no implied bit, and the exponent of the first normal ones.
        let (integer, scale) = if field == 0 { (fraction, -1074) } else { (fraction | 1 << 52, field - 1075) };
        let shift = integer.leading_zeros();
        Self { negative: value < 0.0, exponent: scale + 64 - shift as i32, mantissa: [0, 0, integer << shift] }
    }

    /// The nearest double but for rare ties; beyond the range of doubles, zero or infinity.
    pub(crate) fn value(self) -> f64 {
        // Two factors, as 2^exponent itself may be out of range where the product is not.
        let exponent = (self.exponent - 64).clamp(-1300, 1300);
        let half = exponent / 2;
        let size = self.mantissa[LIMBS - 1] as f64 * 2f64.powi(half) * 2f64.powi(exponent - half);
        if self.negative { -size } else { size }
    }

    pub(crate) fn is_zero(self) -> bool {
        self.mantissa[LIMBS - 1] == 0
    }

    /// Below zero; zero is not.
    pub(crate) fn is_negative(self) -> bool {
        self.negative
    }

    pub(crate) fn abs(self) -> Self {
        Self { negative: false, ..self }
    }

    /// Times a power of two, exactly.
    pub(crate) fn scaled(self, power: i32) -> Self {
        if self.is_zero() { self } else { Self { exponent: self.exponent + power, ..self } }
    }

    /// Whether its size is below 2^power times that of `other`, which is not zero; up to a factor of two.
    pub(crate) fn is_below(self, power: i32, other: Self) -> bool {
        self.is_zero() || self.exponent < other.exponent + power
    }

    fn compare_sizes(self, other: Self) -> Ordering {
        match (self.is_zero(), other.is_zero()) {
            (true, true) => Ordering::Equal,
            (true, false) => Ordering::Less,
            (false, true) => Ordering::Greater,
            (false, false) => {
                self.exponent.cmp(&other.exponent).then(self.mantissa.iter().rev().cmp(other.mantissa.iter().rev()))
            }
        }
    }

    /// `1/x` of a number that is not zero.
    pub(crate) fn reciprocal(self) -> Self {
        let x = Self { exponent: 0, ..self };
        let mut y = Self::new(1.0 / x.value());
        // Newton's iteration doubles the digits: 52, 104, all.
        for _ in 0..2 {
            y = y + y * (Self::ONE - x * y);
        }
        Self { exponent: y.exponent - self.exponent, ..y }
    }

    /// The square root of a number that is not negative.
    pub(crate) fn sqrt(self) -> Self {
        if self.is_zero() {
            return self;
        }
        let half = self.exponent.div_euclid(2);
        let x = Self { exponent: self.exponent - 2 * half, ..self };
        let mut y = Self::new(1.0 / x.value().sqrt());
        for _ in 0..2 {
            y = y + (y * (Self::ONE - x * y * y)).scaled(-1);
        }
        let root = x * y;
        Self { exponent: root.exponent + half, ..root }
    }

    /// Sets the highest bit; `mantissa` is not all zero unless the number is.
    fn normalised(negative: bool, mut exponent: i32, mut mantissa: [u64; LIMBS]) -> Self {
        let Some(top) = mantissa.iter().rposition(|&limb| limb != 0) else { return Self::ZERO };
        let whole = LIMBS - 1 - top;
        mantissa.rotate_right(whole);
        let bits = mantissa[LIMBS - 1].leading_zeros();
        if bits > 0 {
            for k in (1..LIMBS).rev() {
                mantissa[k] = mantissa[k] << bits | mantissa[k - 1] >> (64 - bits);
            }
            mantissa[0] <<= bits;
        }
        exponent -= 64 * whole as i32 + bits as i32;
        Self { negative, exponent, mantissa }
    }
}

/// `a · 2^−shift`, truncated, for shifts below 192.
fn shifted_right(a: [u64; LIMBS], shift: u32) -> [u64; LIMBS] {
    let (whole, bits) = ((shift / 64) as usize, shift % 64);
    let mut out = [0; LIMBS];
    for k in 0..LIMBS - whole {
        out[k] = a[k + whole] >> bits;
        if bits > 0 && k + whole + 1 < LIMBS {
            out[k] |= a[k + whole + 1] << (64 - bits);
        }
    }
    out
}

impl Add for Wide {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (big, small) = if self.compare_sizes(other) == Ordering::Less { (other, self) } else { (self, other) };
        if small.is_zero() {
            return big;
        }
        let shift = big.exponent - small.exponent;
        if shift >= BITS {
            return big;
        }
        let addend = shifted_right(small.mantissa, shift as u32);
        let mut sum = [0; LIMBS];
        if big.negative == small.negative {
            let mut carry = false;
            for k in 0..LIMBS {
                let (partial, first) = big.mantissa[k].overflowing_add(addend[k]);
                let (total, second) = partial.overflowing_add(u64::from(carry));
                sum[k] = total;
                carry = first | second;
            }
            if carry {
                sum = shifted_right(sum, 1);
                sum[LIMBS - 1] |= 1 << 63;
            }
            return Self { negative: big.negative, exponent: big.exponent + i32::from(carry), mantissa: sum };
        }
        let mut borrow = false;
        for k in 0..LIMBS {
            let (partial, first) = big.mantissa[k].overflowing_sub(addend[k]);
            let (total, second) = partial.overflowing_sub(u64::from(borrow));
            sum[k] = total;
            borrow = first | second;
        }
        Self::normalised(big.negative, big.exponent, sum)
    }
}

impl Neg for Wide {
    type Output = Self;

    fn neg(self) -> Self {
        Self { negative: !self.negative && !self.is_zero(), ..self }
    }
}

impl Sub for Wide {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Wide {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return Self::ZERO;
        }
        let mut product = [0u64; 2 * LIMBS];
        for i in 0..LIMBS {
            let mut carry = 0u128;
            for j in 0..LIMBS {
                let sum =
                    u128::from(product[i + j]) + u128::from(self.mantissa[i]) * u128::from(other.mantissa[j]) + carry;
                product[i + j] = sum as u64;
                carry = sum >> 64;
            }
            product[i + LIMBS] = carry as u64;
        }
        let mut mantissa = [product[3], product[4], product[5]];
        let mut exponent = self.exponent + other.exponent;
        if mantissa[LIMBS - 1] >> 63 == 0 {
            for k in (0..LIMBS).rev() {
                mantissa[k] = product[LIMBS + k] << 1 | product[LIMBS + k - 1] >> 63;
            }
            exponent -= 1;
        }
        Self { negative: self.negative != other.negative, exponent, mantissa }
    }
}

pub(crate) fn dot(a: &Vector, b: &Vector) -> Wide {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: &Vector, b: &Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Wide, b: Wide, bits: i32) -> bool {
        (a - b).is_below(-bits, b)
    }

    #[test]
    fn doubles_come_back_over_their_whole_range() {
        for value in [0.0, 1.0, -1.5, 0.1, -1e-300, 1e300, f64::MIN_POSITIVE, 5e-324, f64::MAX, 3e-310] {
            assert_eq!(Wide::new(value).value(), value);
        }
    }

    #[test]
    fn differences_of_doubles_are_exact() {
        let (a, b) = (Wide::new(0.1), Wide::new(1e-20));
        let back = (a + b) - a;
        assert!((back - b).is_zero());
        assert!((a - a).is_zero() && !(a - a).is_negative());
        assert_eq!((b - a).value(), -0.1);
    }

    #[test]
    fn reciprocals_and_roots_undo_products_and_squares() {
        for value in [0.3, 0.5, 1.0, 1.999, 7e11, 3e-200, 0.999_999_999_999_999_9] {
            let x = Wide::new(value);
            assert!(close(x * x.reciprocal(), Wide::ONE, 186), "1/{value}");
            assert!(close(x.sqrt() * x.sqrt(), x, 186), "√{value}");
            assert!(close((x * x).sqrt(), x, 186), "√{value}²");
        }
        assert!(close(Wide::new(-3.0).reciprocal() * Wide::new(3.0), -Wide::ONE, 186));
    }

    #[test]
    fn products_and_sums_obey_the_binomial_formula() {
        let (a, b) = (Wide::new(0.1).sqrt(), Wide::new(-3.7e-9).abs().sqrt());
        let (sum, difference) = (a + b, a - b);
        assert!(close(sum * difference, a * a - b * b, 184));
        assert!(close(sum * sum - difference * difference, (a * b).scaled(2), 156));
    }
}
