//! The ratio of an angle to its sine, and its derivative, as functions of the cosine.

use super::Singles;
use std::f32::consts::FRAC_PI_2;

/// Chebyshev fits in `1 − cos θ` on `[0, 1]` of `θ/(2 sin θ)` to 1e-8, of its derivative to 7e-8.
const RATIO: [f32; 10] = [
    0.5,
    0.166_667_86,
    0.066_628_695,
    0.029_037_02,
    0.009_829_865,
    0.015_768_412,
    -0.018_047_003,
    0.026_759_147,
    -0.016_980_88,
    0.005_735_048,
];
const SLOPE: [f32; 10] = [
    -0.166_666_62,
    -0.133_342_08,
    -0.085_436_38,
    -0.054_189_73,
    -0.008_021_949,
    -0.088_233_133,
    0.140_010_47,
    -0.186_272_28,
    0.120_869_84,
    -0.038_718_08,
];

/// `θ/(2 sin θ)` from cosine and reciprocal sine; beyond a right angle `(π/sin θ − θ'/sin θ')/2`.
#[inline(always)]
pub(crate) fn half_angle_over_sine(cosine: Singles, inverse_sine: Singles) -> Singles {
    let near = polynomial(&RATIO, cosine.map(|c| 1.0 - c.abs()));
    near + beyond(cosine) * (inverse_sine * FRAC_PI_2 - near * 2.0)
}

/// Derivative of [`half_angle_over_sine`] by the cosine.
#[inline(always)]
pub(crate) fn half_angle_over_sine_slope(cosine: Singles, inverse_sine: Singles) -> Singles {
    let near = polynomial(&SLOPE, cosine.map(|c| 1.0 - c.abs()));
    near + beyond(cosine) * (cosine * FRAC_PI_2) * (inverse_sine * inverse_sine * inverse_sine)
}

/// One beyond a right angle, zero before it.
#[inline(always)]
fn beyond(cosine: Singles) -> Singles {
    cosine.map(|c| if c < 0.0 { 1.0 } else { 0.0 })
}

/// `Σ cₖ zᵏ` by Estrin's scheme.
#[inline(always)]
fn polynomial(c: &[f32; 10], z: Singles) -> Singles {
    let pair = |k: usize| z * c[k + 1] + c[k];
    let z2 = z * z;
    let z4 = z2 * z2;
    (pair(0) + pair(2) * z2) + (pair(4) + pair(6) * z2 + pair(8) * z4) * z4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_and_their_derivatives_are_accurate_over_the_half_circle() {
        for k in 1..10_000 {
            let theta = 3.1 * f64::from(k) / 10_000.0;
            let (s, c) = theta.sin_cos();
            let (cosine, inverse) = (Singles::splat(c as f32), Singles::splat(1.0 / s as f32));
            let ratio = f64::from(half_angle_over_sine(cosine, inverse).0[0]);
            assert!((ratio / (0.5 * theta / s) - 1.0).abs() < 4e-7, "{theta} {ratio}");
            let slope = f64::from(half_angle_over_sine_slope(cosine, inverse).0[0]);
            // The closed form cancels where the angle is small.
            let exact = if theta < 1e-3 { -1.0 / 6.0 } else { 0.5 * (c * theta / s - 1.0) / (s * s) };
            assert!((slope / exact - 1.0).abs() < 2e-6, "{theta} {slope} {exact}");
        }
    }
}
