//! Singular values and vectors of `M = [z; diag(0, d₂, …, d_K)]`, to which divide and conquer reduces each of its merges.
//!
//! The squared singular values are the roots of `f(x) = 1 + Σ z_i² / (d_i² − x)`, one between each two poles `d_i²`. Roots are
//! kept as distances from the nearest pole, so that the differences `d_i² − x` are accurate; from these a z is computed whose
//! singular values the roots are exactly, which makes the vectors orthogonal however close they lie (Gu and Eisenstat 1995).

use crate::simd::{LANES, Lanes, multiversion};
use faer::{Mat, MatMut};
use rayon::prelude::*;

/// Below this many poles another thread costs more than it saves.
const WORTH_A_TASK: usize = 64;
/// Interpolation takes three or four steps; bisection, which it falls back on, no more than this.
const MAX_STEPS: usize = 100;

/// Poles and weights in any order, padded to whole lane groups by poles without weight.
pub(super) struct Poles {
    count: usize,
    d: Vec<Lanes>,
    z: Vec<Lanes>,
    z2: Vec<Lanes>,
    /// Places of the poles, ascending; the first is zero.
    ascending: Vec<usize>,
}

/// Where f vanishes, relative to `origin`, and the sums there.
struct Value {
    f: f64,
    /// Derivatives of the terms of the poles below and above.
    below: f64,
    above: f64,
    /// Sum of the terms' sizes.
    size: f64,
}

#[inline(always)]
fn lane(x: &[Lanes], i: usize) -> f64 {
    x[i / LANES].0[i % LANES]
}

#[inline(always)]
fn total(x: Lanes) -> f64 {
    let [a, b, c, d, e, f, g, h] = x.0;
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

impl Poles {
    /// Poles d, weights z, K ≥ 2 of each; d ≥ 0 and distinct, z not zero.
    pub(super) fn new(d: &[f64], z: &[f64], ascending: Vec<usize>) -> Self {
        let groups = d.len().div_ceil(LANES);
        let far = 2.0 * d.iter().copied().fold(1.0, f64::max);
        let lanes = |x: &[f64], pad: f64| -> Vec<Lanes> {
            let at = |i: usize| x.get(i).copied().unwrap_or(pad);
            (0..groups).map(|c| Lanes(std::array::from_fn(|l| at(c * LANES + l)))).collect()
        };
        let z = lanes(z, 0.0);
        Self { count: d.len(), d: lanes(d, far), z2: z.iter().map(|&z| z * z).collect(), z, ascending }
    }

    /// Singular values ascending, and the vectors of M in their order: right ones, and left ones where they are asked for;
    /// K × K, rows in the order of the poles.
    pub(super) fn decompose(&self, want_left: bool) -> (Vec<f64>, Mat<f64>, Option<Mat<f64>>) {
        let (count, groups) = (self.count, self.d.len());
        let tasks = if count < WORTH_A_TASK { count } else { 8 };
        let mut differences = vec![Lanes::ZERO; count * groups];
        let mut sigma = vec![0.0; count];
        sigma
            .par_iter_mut()
            .zip(differences.par_chunks_exact_mut(groups))
            .enumerate()
            .with_min_len(tasks)
            .for_each(|(j, (sigma, differences))| *sigma = root(self, j, differences));
        let weights = fitting_weights(self, &differences);
        let mut right = Mat::zeros(count, count);
        let write = |mut to: MatMut<'_, f64>, from: &[Lanes], norm: f64| {
            for (to, from) in to.as_mut().col_mut(0).iter_mut().zip(from.iter().flat_map(|x| &x.0)) {
                *to = from * norm;
            }
        };
        differences
            .par_chunks_exact_mut(groups)
            .zip(right.as_mut().par_col_chunks_mut(1))
            .with_min_len(tasks)
            .for_each(|(column, to)| {
                let norm = right_vector(column, &weights);
                write(to, column, norm);
            });
        let left = want_left.then(|| {
            let mut left = Mat::zeros(count, count);
            differences
                .par_chunks_exact_mut(groups)
                .zip(left.as_mut().par_col_chunks_mut(1))
                .with_min_len(tasks)
                .for_each(|(column, to)| {
                    let norm = left_vector(column, &self.d, self.ascending[0]);
                    write(to, column, norm);
                });
            left
        });
        (sigma, right, left)
    }
}

multiversion! {
    /// The j-th singular value; leaves `d_i² − σ²`.
    fn root(poles: &Poles, j: usize, differences: &mut [Lanes]) -> f64 = root_generic;
}
multiversion! {
    /// The z for which the roots are exact, with the signs of the given one.
    fn fitting_weights(poles: &Poles, differences: &[Lanes]) -> Vec<Lanes> = fitting_weights_generic;
}
multiversion! {
    /// Turns differences into an unnormalised right singular vector; returns the reciprocal of its length.
    fn right_vector(column: &mut [Lanes], weights: &[Lanes]) -> f64 = right_vector_generic;
}
multiversion! {
    /// Turns a right singular vector into the left one, not normalised; returns the reciprocal of its length.
    fn left_vector(column: &mut [Lanes], d: &[Lanes], zero: usize) -> f64 = left_vector_generic;
}

/// `d_i² − d_origin²`, to full relative accuracy.
#[inline(always)]
fn shift(d: &[Lanes], origin: f64, differences: &mut [Lanes]) {
    for (difference, &d) in differences.iter_mut().zip(d) {
        *difference = (d - origin) * (d + origin);
    }
}

#[inline(always)]
fn evaluate(differences: &[Lanes], z2: &[Lanes], x: f64) -> Value {
    let (mut f, mut slope, mut above, mut size) = (Lanes::ZERO, Lanes::ZERO, Lanes::ZERO, Lanes::ZERO);
    for (&difference, &z2) in differences.iter().zip(z2) {
        let inverse = (difference - x).map(|d| 1.0 / d);
        let term = z2 * inverse;
        let rise = term * inverse;
        f = f + term;
        slope = slope + rise;
        above = above + rise.zip(inverse, |rise, i| if i > 0.0 { rise } else { 0.0 });
        size = size + term.map(f64::abs);
    }
    let above = total(above);
    Value { f: 1.0 + total(f), below: total(slope) - above, above, size: total(size) }
}

/// The root of `c x² − a x + b` that continues to `b / a` where c is zero.
#[inline(always)]
fn small_root(a: f64, b: f64, c: f64) -> f64 {
    let root = (a * a - 4.0 * b * c).abs().sqrt();
    if a > 0.0 {
        2.0 * b / (a + root)
    } else if c != 0.0 {
        (a - root) / (2.0 * c)
    } else {
        b / a
    }
}

#[inline(always)]
fn root_generic(poles: &Poles, j: usize, differences: &mut [Lanes]) -> f64 {
    let Poles { d, z2, ascending, count, .. } = poles;
    let last = j + 1 == *count;
    // The two poles next to the root; the last root lies above both.
    let (a, b) = if last { (ascending[j - 1], ascending[j]) } else { (ascending[j], ascending[j + 1]) };
    let (da, db, za, zb) = (lane(d, a), lane(d, b), lane(z2, a), lane(z2, b));
    let gap = (db - da) * (db + da);
    let mut origin = if last { db } else { da };
    shift(d, origin, differences);
    let width = if last { z2.iter().map(|&z| total(z)).sum() } else { gap };
    let middle = evaluate(differences, z2, 0.5 * width);
    // First guess: both poles exactly, all others as they are in the middle.
    let (mut low, mut high, mut x);
    if last {
        (low, high) = if middle.f > 0.0 { (0.0, 0.5 * width) } else { (0.5 * width, width) };
        let rest = middle.f + za / (gap + 0.5 * width) + zb / (0.5 * width);
        let (p, q) = (za + zb - rest * gap, -zb * gap);
        let size = (p * p - 4.0 * q * rest).abs().sqrt();
        x = if p < 0.0 { 2.0 * q / (p - size) } else { (p + size) / (2.0 * rest) };
    } else {
        let rest = middle.f + za / (0.5 * gap) - zb / (0.5 * gap);
        if middle.f >= 0.0 {
            (low, high) = (0.0, 0.5 * gap);
            x = small_root(rest * gap + za + zb, za * gap, rest);
        } else {
            origin = db;
            shift(d, origin, differences);
            (low, high) = (-0.5 * gap, 0.0);
            x = small_root(za + zb - rest * gap, -zb * gap, rest);
        }
    }
    let (near_a, near_b) = (lane(differences, a), lane(differences, b));
    for _ in 0..MAX_STEPS {
        if !(low < x && x < high) {
            x = 0.5 * (low + high);
        }
        let value = evaluate(differences, z2, x);
        let slope = value.below + value.above;
        if value.f.abs() <= f64::EPSILON * (4.0 * (1.0 + value.size) + x.abs() * slope) {
            break;
        }
        if value.f < 0.0 {
            low = x;
        } else {
            high = x;
        }
        // Two poles that agree with f and with the slopes of its parts on either side (Li 1994).
        let (to_a, to_b) = (near_a - x, near_b - x);
        let (slope_a, slope_b) =
            if last { (slope - zb / (to_b * to_b), zb / (to_b * to_b)) } else { (value.below, value.above) };
        let c = value.f - to_a * slope_a - to_b * slope_b;
        let (p, q) = ((to_a + to_b) * value.f - to_a * to_b * slope, to_a * to_b * value.f);
        let mut step = if last {
            let size = (p * p - 4.0 * q * c).abs().sqrt();
            if p >= 0.0 { (p + size) / (2.0 * c.abs()) } else { 2.0 * q / (p - size) }
        } else {
            small_root(p, q, c)
        };
        if step * value.f >= 0.0 {
            step = -value.f / slope;
        }
        let next = x + step;
        if (next - x).abs() <= f64::EPSILON * x.abs() || high - low <= f64::EPSILON * x.abs() {
            break;
        }
        x = next;
    }
    for difference in differences.iter_mut() {
        *difference = *difference - x;
    }
    origin + x / (origin + (origin * origin + x).max(0.0).sqrt())
}

#[inline(always)]
fn fitting_weights_generic(poles: &Poles, differences: &[Lanes]) -> Vec<Lanes> {
    let Poles { d, z, ascending, .. } = poles;
    let mut squares = vec![Lanes::splat(1.0); d.len()];
    for (&p, differences) in ascending.iter().zip(differences.chunks_exact(d.len())) {
        let pole = lane(d, p);
        for ((square, &d), &difference) in squares.iter_mut().zip(d).zip(differences) {
            // Over the differences of the poles; at the pole itself over nothing.
            let gap = ((d - pole) * (d + pole)).map(|gap| if gap == 0.0 { -1.0 } else { gap });
            *square = *square * (difference / gap);
        }
    }
    squares
        .iter()
        .zip(z)
        .map(|(s, &z)| s.map(|s| s.abs().sqrt()).zip(z, |s, z| if z == 0.0 { 0.0 } else { s.copysign(z) }))
        .collect()
}

#[inline(always)]
fn right_vector_generic(column: &mut [Lanes], weights: &[Lanes]) -> f64 {
    let mut square = Lanes::ZERO;
    for (x, &weight) in column.iter_mut().zip(weights) {
        *x = weight / *x;
        square = square + *x * *x;
    }
    1.0 / total(square).sqrt()
}

#[inline(always)]
fn left_vector_generic(column: &mut [Lanes], d: &[Lanes], zero: usize) -> f64 {
    for (x, &d) in column.iter_mut().zip(d) {
        *x = d * *x;
    }
    column[zero / LANES].0[zero % LANES] = -1.0;
    let mut square = Lanes::ZERO;
    for x in &*column {
        square = square + *x * *x;
    }
    1.0 / total(square).sqrt()
}
