//! Eight-wide arithmetic, over points or over entries of a column, compiled once per instruction set and chosen at run time.
//!
//! Nothing here uses fused multiply-add: the same source then gives the same bits on every machine, with or without AVX.

use faer::Mat;
use rayon::prelude::*;
use std::mem::MaybeUninit;

/// Points or entries that one lane group holds.
pub(crate) const LANES: usize = 8;

/// One value for each point or entry of a lane group.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Lanes(pub(crate) [f64; LANES]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(crate) fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub(crate) fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = [0.0; LANES];
        for l in 0..LANES {
            out[l] = f(self.0[l]);
        }
        Self(out)
    }

    #[inline(always)]
    pub(crate) fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = [0.0; LANES];
        for l in 0..LANES {
            out[l] = f(self.0[l], other.0[l]);
        }
        Self(out)
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }

    /// Whether `f` holds for any pair of lanes.
    #[inline(always)]
    pub(crate) fn any(self, other: Self, f: impl Fn(f64, f64) -> bool) -> bool {
        let mut found = false;
        for l in 0..LANES {
            found |= f(self.0[l], other.0[l]);
        }
        found
    }
}

/// Zeros, n × m, whose memory the threads of the current rayon pool touch first, each a share: the system hands out new memory
/// page by page, which takes one thread longer than most steps of a preparation.
pub(crate) fn zeros<T: Copy + Default + Send>(n: usize, m: usize) -> Mat<T> {
    const TASK_BYTES: usize = 1 << 18;
    let mut matrix = Mat::<T>::with_capacity(n, m);
    let stride = matrix.col_stride().unsigned_abs();
    let length = if n == 0 { 0 } else { stride * m };
    // SAFETY: a matrix of this capacity owns m columns of `stride` ≥ n entries each, one after the other.
    #[allow(unsafe_code)]
    let entries = unsafe { std::slice::from_raw_parts_mut(matrix.as_ptr_mut().cast::<MaybeUninit<T>>(), length) };
    entries.par_chunks_mut(TASK_BYTES / size_of::<T>()).for_each(|part| part.fill(MaybeUninit::new(T::default())));
    // SAFETY: within the capacity, and every entry was written just now.
    #[allow(unsafe_code)]
    unsafe {
        matrix.set_dims(n, m);
    }
    matrix
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl std::ops::$trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
        impl std::ops::$trait<f64> for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.map(|a| a $op other)
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

#[inline(always)]
pub(crate) fn dot(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: &[Lanes; 3], b: &[Lanes; 3]) -> [Lanes; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Coefficients of `atan(x)/x` in `x²` on `|x| ≤ tan(π/8)`: a Chebyshev fit with an error below 2e-18.
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
    // Estrin's scheme: four short chains instead of one of eleven dependent steps.
    let pair = |k: usize| z * ATAN[k + 1] + ATAN[k];
    let z2 = z * z;
    let z4 = z2 * z2;
    let low = pair(0) + pair(2) * z2;
    let mid = pair(4) + pair(6) * z2;
    let high = pair(8) + pair(10) * z2;
    let series = low + (mid + high * z4) * z4;
    let octant = x * series + folded * std::f64::consts::FRAC_PI_4;
    let swapped = s.zip(size, |a, b| if a > b { 1.0 } else { 0.0 });
    let quadrant = octant * (swapped * -2.0 + 1.0) + swapped * std::f64::consts::FRAC_PI_2;
    quadrant.zip(c, |q, c| if c < 0.0 { std::f64::consts::PI - q } else { q })
}

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

/// `ln(a/b)` for `a ≥ b > 0`, normal numbers less than a factor of 2⁵⁰⁰ apart. `near` is `(a − b)/(a + b)` as it is known
/// without cancellation; it counts where the ratio is near one.
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
    let pair = |k: usize| z * ATANH[k + 1] + ATANH[k];
    let z2 = z * z;
    let z4 = z2 * z2;
    let low = pair(0) + pair(2) * z2;
    let mid = pair(4) + pair(6) * z2;
    let high = pair(8) + pair(10) * z2;
    let series = low + (mid + high * z4) * z4;
    x * series * 2.0 + whole * std::f64::consts::LN_2
}

/// Defines a function that runs `$generic` compiled for the widest instruction set of this machine.
///
/// `$generic` must be `#[inline(always)]`, as must be everything it spends time in.
macro_rules! multiversion {
    ($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? = $generic:path;) => {
        $(#[$meta])*
        #[allow(clippy::too_many_arguments)]
        $vis fn $name($($arg: $ty),*) $(-> $ret)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
                fn avx512($($arg: $ty),*) $(-> $ret)? {
                    $generic($($arg),*)
                }
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $ty),*) $(-> $ret)? {
                    $generic($($arg),*)
                }
                if is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                {
                    // SAFETY: the features the function is compiled for were detected just now.
                    #[allow(unsafe_code)]
                    return unsafe { avx512($($arg),*) };
                }
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: as above.
                    #[allow(unsafe_code)]
                    return unsafe { avx2($($arg),*) };
                }
            }
            $generic($($arg),*)
        }
    };
}
pub(crate) use multiversion;

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
