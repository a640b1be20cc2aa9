//! Prediction of a whole frame from K of its points by universal kriging, with the cage's own
//! deformations as drift (Matheron 1969).
//!
//! A frame is `P = Φ C + e`; the covariance of the residual e is taken to be a function of distance
//! at rest, with compact support (Wendland 1995, C²). The best linear unbiased prediction, exact
//! for frames without residual,
//!
//! `N = B Ĝ + k Ω⁻¹ (I − B_S Ĝ)`, `Ĝ = (B_Sᵀ Ω⁻¹ B_S)⁻¹ B_Sᵀ Ω⁻¹`, `N B_S = B`,
//!
//! takes the place of the frame in least squares over all points. B is any basis of the columns of
//! `Φ`, S are the samples, Ω is their covariance and k that of all points with them.

use crate::morton::morton_order;
use crate::simd::{LANES, Lanes, grouped, multiversion};
use cager_geometry::linalg;
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::{Point, diagonal};
use cager_geometry::spatial::Aabb;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::{Mat, MatMut, MatRef};
use rayon::prelude::*;

/// Support of the covariance, as a multiple of the fill distance.
const SUPPORT: f64 = 6.0;
/// Variance of the residual's uncorrelated part. Keeps the system regular for coincident samples.
const NUGGET: f64 = 1e-2;
/// Points of one block, whose covariances are zero except with the samples near it.
const BLOCK_ROWS: usize = 128;
/// Blocks whose covariances are held at the same time.
const BLOCKS_TOGETHER: usize = 64;
/// Columns of one task of a product with the covariances, at the most.
const MAX_COLUMNS: usize = 192;
/// Samples of one task when covariances are computed.
const TASK_SAMPLES: usize = 64;

/// Least squares over all points with a basis B of the columns of `Φ`, the identity at the first r
/// samples, for some coefficients x of its solution.
pub(crate) struct Drift<'a> {
    /// A matrix L with the same columns' span, n × l.
    pub(crate) wide: MatRef<'a, f64>,
    /// D: B at the samples after the first r, (K − r) × r.
    pub(crate) others: MatRef<'a, f64>,
    /// S: the coefficients x of B itself, x × r.
    pub(crate) of_basis: MatRef<'a, f64>,
    /// Takes `Lᵀ F` to the coefficients of the solution for F: l × columns to x × columns.
    pub(crate) least_squares: &'a (dyn Fn(Mat<f64>) -> Mat<f64> + Sync),
}

/// The coefficients that least squares over all points gives for the prediction from the samples,
/// transposed: K × x. `reach` is the largest distance of a point from its nearest sample. `None`
/// where the factorisation fails.
///
/// With `B_S = [I; D]` the contrasts `W = [−D, I]` annihilate every cage deformation, and `N = [B,
/// 0] + (k − B Ω₁) Wᵀ (W Ω Wᵀ)⁻¹ W` is the same prediction, from K − r equations; Ω₁ are the first
/// r rows of Ω. The coefficients are `[S − Z D, Z]` with Z those of `(k − B Ω₁) Wᵀ (W Ω Wᵀ)⁻¹`.
pub(crate) fn interpolated(points: &[Point], rows: &[u32], reach: f64, drift: &Drift<'_>) -> Option<Mat<f64>> {
    let (p, r) = drift.others.shape();
    let mut map = zeros(r + p, drift.of_basis.nrows());
    map.as_mut().subrows_mut(0, r).copy_from(drift.of_basis.transpose());
    if p == 0 {
        return Some(map);
    }
    // The fill distance is zero where every point coincides with a sample.
    let inverse_support = 1.0 / (SUPPORT * reach.max(1e-9 * diagonal(points)));
    let places: Vec<Point> = rows.iter().map(|&i| points[i as usize]).collect();
    // W Ω, (K − r) × K; few pairs of samples lie within each other's support.
    let mut contrasts = covariances(inverse_support, &places[r..], &places);
    contrasts -= with_all_points(inverse_support, &places[..r], &places, drift.others.transpose().to_owned().as_ref());
    for (contrasts, others) in contrasts.col_iter_mut().zip(drift.others.col_iter()) {
        contrasts.iter_mut().zip(others.iter()).for_each(|(contrast, x)| *contrast -= NUGGET * x);
    }
    for i in 0..p {
        contrasts[(i, r + i)] += NUGGET;
    }
    let (first, others) = contrasts.as_ref().split_at_col(r);
    let cross = with_all_points(inverse_support, points, &places, drift.wide);
    let (cross_first, cross_others) = cross.as_ref().split_at_col(r);
    // Lᵀ k Wᵀ, and the coefficients of B Ω₁ Wᵀ.
    let seen = (drift.least_squares)(difference(cross_others, linalg::product(cross_first, drift.others.transpose())));
    let right = difference(seen.transpose(), linalg::product(first, drift.of_basis.transpose()));
    let covariance_of_contrasts = difference(others, linalg::lower_product(first, drift.others.transpose()));
    let weights = linalg::solve_definite(covariance_of_contrasts, right)?;
    map.as_mut().subrows_mut(r, p).copy_from(&weights);
    let (mut of_first, weights) = map.as_mut().split_at_row_mut(r);
    of_first -= linalg::product(drift.others.transpose(), weights.as_ref());
    Some(map)
}

/// `A − B`, in the place of B.
fn difference(a: MatRef<'_, f64>, mut b: Mat<f64>) -> Mat<f64> {
    faer::zip!(&mut b, a).for_each(|faer::unzip!(b, a)| *b = a - *b);
    b
}

/// `wideᵀ k`, columns of `wide` × K, with the covariance k of `points` with the samples, summed in
/// blocks along a space-filling curve, each with the samples within its support.
fn with_all_points(inverse_support: f64, points: &[Point], samples: &[Point], wide: MatRef<'_, f64>) -> Mat<f64> {
    let m = wide.ncols();
    let columns = (m / 16).next_multiple_of(LANES).clamp(LANES, MAX_COLUMNS);
    let mut sum = zeros(m, samples.len());
    let order = morton_order(points);
    let blocks: Vec<&[u32]> = order.chunks(BLOCK_ROWS).collect();
    for blocks in blocks.chunks(BLOCKS_TOGETHER) {
        let weights: Vec<(Vec<usize>, Mat<f64>)> = blocks
            .par_iter()
            .map(|block| {
                let own: Vec<Point> = block.iter().map(|&i| points[i as usize]).collect();
                let near = within_support(inverse_support, &own, samples);
                let places: Vec<Point> = near.iter().map(|&j| samples[j]).collect();
                let weights = covariances(inverse_support, &own, &places);
                (near, weights)
            })
            .collect();
        sum.as_mut().par_row_chunks_mut(columns).enumerate().for_each_init(Vec::new, |part, (chunk, mut sum)| {
            let wide = wide.subcols(chunk * columns, sum.nrows());
            for (block, (near, weights)) in blocks.iter().zip(&weights) {
                let rows = linalg::rows_of(wide, block);
                part.resize(sum.nrows() * near.len(), 0.0);
                let mut part = MatMut::from_column_major_slice_mut(part, sum.nrows(), near.len());
                linalg::multiply(part.rb_mut(), rows.transpose(), weights.as_ref());
                for (part, &j) in part.rb().col_iter().zip(near) {
                    sum.rb_mut().col_mut(j).iter_mut().zip(part.iter()).for_each(|(sum, x)| *sum += x);
                }
            }
        });
    }
    sum
}

/// Indices of the samples that may have a nonzero covariance with one of the points.
fn within_support(inverse_support: f64, points: &[Point], samples: &[Point]) -> Vec<usize> {
    let around = Aabb::around_all(points);
    // Rounding may make a box seem as far as the points in it.
    let most = (1.0 + 1e-9) / (inverse_support * inverse_support);
    (0..samples.len()).filter(|&j| around.distance2(samples[j].into()) <= most).collect()
}

/// Covariances of points with samples, points × samples.
fn covariances(inverse_support: f64, points: &[Point], samples: &[Point]) -> Mat<f64> {
    let places = grouped(points, [0.0; 3]);
    let mut out = zeros(points.len(), samples.len());
    out.as_mut().par_col_chunks_mut(TASK_SAMPLES).zip(samples.par_chunks(TASK_SAMPLES)).for_each(
        |(columns, samples)| {
            let mut column = vec![Lanes::ZERO; places.len()];
            for (out, sample) in columns.col_iter_mut().zip(samples) {
                fill(&places, sample, inverse_support, &mut column);
                for (out, value) in out.iter_mut().zip(column.iter().flat_map(|group| &group.0)) {
                    *out = *value;
                }
            }
        },
    );
    out
}

multiversion! {
    fn fill(places: &[[Lanes; 3]], sample: &Point, inverse_support: f64, out: &mut [Lanes]) {
        let s = [Lanes::splat(sample[0]), Lanes::splat(sample[1]), Lanes::splat(sample[2])];
        for (place, out) in places.iter().zip(out) {
            let d = [place[0] - s[0], place[1] - s[1], place[2] - s[2]];
            let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() * inverse_support;
            let rest = r.map(|r| if r < 1.0 { 1.0 - r } else { 0.0 });
            let square = rest * rest;
            *out = square * square * (r * 4.0 + 1.0);
        }
    }
}
