//! Angles from sine and cosine, by reduction to arguments below 1/512 and the power series of the arc tangent.

use super::Wide;
use std::sync::LazyLock;

/// First reduction: to multiples of 1/16.
const COARSE: f64 = 16.0;
/// Second reduction: to multiples of 1/256.
const FINE: f64 = 256.0;
/// Terms that arguments up to 1/16 need, and those up to 1/512.
const LONG: usize = 25;
const SHORT: usize = 11;

struct Tables {
    /// `1, 1/3, 1/5, …`
    odd: [Wide; LONG],
    /// `atan(j/16)` for j from 0 to 16.
    coarse: [Wide; COARSE as usize + 1],
    /// `atan(k/256)` for k from 0 to 8.
    fine: [Wide; 9],
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let odd = std::array::from_fn(|k| Wide::new((2 * k + 1) as f64).reciprocal());
    let quotient = |a: f64, b: f64| Wide::new(a) * Wide::new(b).reciprocal();
    let mut coarse = [Wide::ZERO; COARSE as usize + 1];
    for j in 1..coarse.len() {
        // The difference of two neighbours is atan((j/16 − (j−1)/16) / (1 + j(j−1)/256)).
        let step = quotient(COARSE, COARSE * COARSE + (j * (j - 1)) as f64);
        coarse[j] = coarse[j - 1] + series(step, &odd);
    }
    let fine = std::array::from_fn(|k| series(quotient(k as f64, FINE), &odd));
    Tables { odd, coarse, fine }
});

/// `z − z³/3 + z⁵/5 − …`
fn series(z: Wide, odd: &[Wide]) -> Wide {
    let square = z * z;
    let tail = odd.iter().rev().fold(Wide::ZERO, |sum, &c| c - square * sum);
    z * tail
}

/// The angle in `[0, π]` whose sine is `s ≥ 0` and whose cosine is `c`, up to a common factor; to 2⁻¹⁸² of itself.
pub(crate) fn angle(s: Wide, c: Wide) -> Wide {
    let tables = &*TABLES;
    let size = c.abs();
    let swapped = (size - s).is_negative();
    let (small, big) = if swapped { (size, s) } else { (s, size) };
    if big.is_zero() {
        return Wide::ZERO;
    }
    // Each reduction turns the vector (big, small) by an angle of the table; it grows, which only the ratio forgets.
    let turned = |(s, c): (Wide, Wide), tangent: f64| {
        let t = Wide::new(tangent);
        (s - t * c, c + t * s)
    };
    let j = (ratio(small, big) * COARSE).round();
    let first = turned((small, big), j / COARSE);
    let k = (ratio(first.0, first.1) * FINE).round();
    let (s, c2) = turned(first, k / FINE);
    let rest = series(s * c2.reciprocal(), &tables.odd[..SHORT]);
    let fine = tables.fine[(k.abs() as usize).min(8)];
    let octant = tables.coarse[j as usize] + (if k < 0.0 { -fine } else { fine }) + rest;
    let right = tables.coarse[COARSE as usize].scaled(1);
    let quadrant = if swapped { right - octant } else { octant };
    if c.is_negative() { right.scaled(1) - quadrant } else { quadrant }
}

/// `a/b` to double precision, for `|a| ≤ |b|`.
fn ratio(a: Wide, b: Wide) -> f64 {
    a.scaled(-b.exponent).value() / b.scaled(-b.exponent).value()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pi_has_its_digits() {
        let mantissa = [0x2902_4e08_8a67_cc74, 0xc4c6_628b_80dc_1cd1, 0xc90f_daa2_2168_c234];
        let pi = Wide { negative: false, exponent: 2, mantissa };
        let found = angle(Wide::ZERO, -Wide::ONE);
        assert!((found - pi).is_below(-186, pi));
    }

    #[test]
    fn angles_add_up() {
        // Doubling the angle of (c, s) squares c + i s.
        for k in 1..400 {
            let t = std::f64::consts::FRAC_PI_2 * f64::from(k) / 400.0;
            let (s, c) = (Wide::new(t.sin()), Wide::new(t.cos()));
            let doubled = angle((s * c).scaled(1), c * c - s * s);
            let once = angle(s, c);
            assert!((doubled - once.scaled(1)).is_below(-182, once), "{t}");
            assert!((once.value() - t).abs() < 3e-16);
        }
    }

    #[test]
    fn small_angles_keep_their_digits() {
        let found = angle(Wide::new(1e-90), Wide::ONE);
        assert!((found - Wide::new(1e-90)).is_below(-182, found));
        assert!(angle(Wide::ZERO, Wide::ONE).is_zero());
    }
}
