//! The logarithm of eight ratios at once.

use super::lanes::polynomial;
use super::{LANES, Lanes};

/// Coefficients of `atanh(x)/x` in `x²`: on `|x| ≤ 1/5` the first term left out is below 1e-18.
const ATANH: [f64; 12] = [
    1.0,
    1.0 / 3.0,
    1.0 / 5.0,
    1.0 / 7.0,
    1.0 / 9.0,
    1.0 / 11.0,
    1.0 / 13.0,
    1.0 / 15.0,
    1.0 / 17.0,
    1.0 / 19.0,
    1.0 / 21.0,
    1.0 / 23.0,
];

/// `ln(a/b)` for `a ≥ b > 0`, less than a factor of 2⁵⁰⁰ apart. `near` is `(a − b)/(a + b)` as
/// known without cancellation; it counts where the ratio is near one.
#[inline(always)]
pub(crate) fn ln_ratio(a: Lanes, b: Lanes, near: Lanes) -> Lanes {
    // The difference of two patterns is the logarithm of the ratio to within 0.09, in units of 2⁵².
    const SHIFT: u64 = 512;
    const ROUND: u64 = SHIFT << 52 | 1 << 51;
    const WHOLE: u64 = 0x4330_0000_0000_0000;
    let power =
        a.zip(b, |a, b| f64::from_bits(a.to_bits().wrapping_sub(b.to_bits()).wrapping_add(ROUND) >> 52 | WHOLE));
    let whole = power.map(|p| p - (4_503_599_627_370_496.0 + SHIFT as f64));
    let scale = power.map(|p| f64::from_bits((p.to_bits() + (1023 - SHIFT)) << 52));
    let scaled = b * scale;
    let far = (a - scaled) / (a + scaled);
    let mut x = far;
    for l in 0..LANES {
        x.0[l] = if whole.0[l] == 0.0 { near.0[l] } else { far.0[l] };
    }
    let z = x * x;
    x * polynomial(&ATANH, z) * 2.0 + whole * std::f64::consts::LN_2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_accurate_over_their_range() {
        for k in 0..=20_000 {
            let q = f64::from(k) / 20_000.0 * 0.999_999;
            // Exact logarithm of (1 + q)/(1 − q), from the library's own functions.
            let (a, b) = (1.0 + q, 1.0 - q);
            let exact = q.ln_1p() - (-q).ln_1p();
            let got = ln_ratio(Lanes::splat(a), Lanes::splat(b), Lanes::splat(q)).0[0];
            assert!((got - exact).abs() <= 4e-16 * (1.0 + exact), "{q} {got} {exact}");
        }
        for k in 0..400 {
            let ratio = 1.3f64.powi(k);
            let got =
                ln_ratio(Lanes::splat(7.0 * ratio), Lanes::splat(7.0), Lanes::splat((ratio - 1.0) / (ratio + 1.0)));
            assert!((got.0[0] - ratio.ln()).abs() <= 4e-16 * (1.0 + ratio.ln()), "{ratio} {}", got.0[0]);
        }
        let tiny = ln_ratio(Lanes::splat(1.0), Lanes::splat(1.0), Lanes::splat(1e-30)).0[0];
        assert_eq!(tiny, 2e-30);
    }
}
