//! The arc tangent of eight pairs at once.

use super::Lanes;
use super::lanes::polynomial;

/// Coefficients of `atan(x)/x` in `x²` on `|x| ≤ tan(π/8)`: a Chebyshev fit to 2e-18.
const ATAN: [f64; 12] = [
    1.0,
    -0.3333333333333312,
    0.19999999999940837,
    -0.14285714279244968,
    0.11111110744657099,
    -0.09090896801472813,
    0.07692045194561481,
    -0.06662950246036792,
    0.05846866752275139,
    -0.05035049795312439,
    0.03796390316111083,
    -0.017803896394812564,
];

/// The angle in `[0, π]` whose sine is `s ≥ 0` and whose cosine is `c`, up to a common factor.
#[inline(always)]
pub(crate) fn angle(s: Lanes, c: Lanes) -> Lanes {
    const TAN_PI_8: f64 = 0.414_213_562_373_095_03;
    let size = c.map(f64::abs);
    let small = s.zip(size, |a, b| if a < b { a } else { b });
    let big = s.zip(size, |a, b| if a < b { b } else { a });
    let folded = small.zip(big, |a, b| if a > TAN_PI_8 * b { 1.0 } else { 0.0 });
    let x = (small - folded * big) / (big + folded * small);
    let z = x * x;
    let octant = x * polynomial(&ATAN, z) + folded * std::f64::consts::FRAC_PI_4;
    let swapped = s.zip(size, |a, b| if a > b { 1.0 } else { 0.0 });
    let quadrant = octant * (swapped * -2.0 + 1.0) + swapped * std::f64::consts::FRAC_PI_2;
    quadrant.zip(c, |q, c| if c < 0.0 { std::f64::consts::PI - q } else { q })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_accurate_over_the_half_circle() {
        for k in 0..=10_000 {
            let theta = std::f64::consts::PI * f64::from(k) / 10_000.0;
            let (s, c) = theta.sin_cos();
            let got = angle(Lanes::splat(s.max(0.0)), Lanes::splat(c)).0[0];
            assert!((got - s.max(0.0).atan2(c)).abs() < 5e-16, "{theta} {got}");
        }
        let tiny = angle(Lanes::splat(1e-9), Lanes::splat(1.0)).0[0];
        assert!((tiny / 1e-9 - 1.0).abs() < 1e-15);
    }
}
