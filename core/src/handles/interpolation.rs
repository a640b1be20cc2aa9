//! Prediction of a whole frame from K of its points by universal kriging, with the cage's own deformations as drift (Matheron 1969).
//!
//! A frame is `P = Φ C + e`, and the residual e varies smoothly over the model: its covariance is taken to be a function of distance at rest, with
//! compact support (Wendland 1995, C²). The best linear unbiased prediction, exact for frames without residual,
//!
//! `N = B Ĝ + k Ω⁻¹ (I − B_S Ĝ)`, `Ĝ = (B_Sᵀ Ω⁻¹ B_S)⁻¹ B_Sᵀ Ω⁻¹`, `N B_S = B`,
//!
//! takes the place of the frame in least squares over all points. B is any basis of the columns of `Φ`, S are the samples, Ω is their covariance and
//! k that of all points with them. Only `Bᵀ N`, r × K, is computed.

use super::farthest::morton_order;
use crate::dense;
use crate::mesh::{Point, bounds, diagonal};
use crate::simd::{LANES, Lanes, multiversion};
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Support of the covariance, as a multiple of the fill distance.
const SUPPORT: f64 = 6.0;
/// Nugget: variance of the uncorrelated part of the residual relative to the smooth part. Keeps the system regular for coincident samples.
const NUGGET: f64 = 1e-2;
const BLOCK_ROWS: usize = 256;
/// Typical number of samples within the support of a block.
const NEAR_SAMPLES: usize = 512;
/// Memory for partial sums, unless two of them already exceed it.
const PARTS_BYTES: usize = 64 << 20;

/// Covariance of residuals as a function of distance.
#[derive(Clone, Copy)]
struct Covariance {
    /// Reciprocal of the distance beyond which the covariance is zero.
    inverse_support: f64,
}

/// All points, and the samples, which are some of them.
pub(crate) struct Samples<'a> {
    /// All points, n.
    pub(crate) points: &'a [Point],
    /// The rows read, K.
    pub(crate) rows: &'a [u32],
    /// Fill distance: that of the farthest point from its nearest sample.
    pub(crate) reach: f64,
}

/// A basis `L = wide · to_basis` of the columns of `Φ`, n × r, and its relation to the basis B that is the identity at the first r samples.
pub(crate) struct Drift<'a> {
    /// n × m; L itself where `to_basis` is `None`.
    pub(crate) wide: MatRef<'a, f64>,
    /// m × r.
    pub(crate) to_basis: Option<MatRef<'a, f64>>,
    /// B at the samples after the first r, (K − r) × r.
    pub(crate) others: MatRef<'a, f64>,
    /// `LᵀB`, r × r.
    pub(crate) gram: MatRef<'a, f64>,
}

/// `Lᵀ N`, r × K.
///
/// With `B_S = [I; D]` the contrasts `W = [−D, I]` annihilate every cage deformation, and `N = [B, 0] + (k − B Ω₁) Wᵀ (W Ω Wᵀ)⁻¹ W` is the same
/// prediction, from K − r equations; Ω₁ are the first r rows of Ω.
///
/// `None` where the factorisation fails.
pub(crate) fn interpolated(samples: &Samples<'_>, drift: &Drift<'_>) -> Option<Mat<f64>> {
    let (p, r) = drift.others.shape();
    let k = p + r;
    if p == 0 {
        return Some(drift.gram.to_owned());
    }
    // The fill distance is zero where every point coincides with a sample.
    let reach = samples.reach.max(1e-9 * diagonal(samples.points));
    let covariance = Covariance { inverse_support: 1.0 / (SUPPORT * reach) };
    let places: Vec<Point> = samples.rows.iter().map(|&i| samples.points[i as usize]).collect();
    let mut rest = covariances(covariance, &places[r..], &places);
    for i in 0..p {
        rest[(i, r + i)] += NUGGET;
    }
    // A Ω₁; few pairs of samples lie within each other's support.
    let with_first = |a: MatRef<'_, f64>| {
        let mut product = with_all_points(covariance, &places[..r], &places, a.transpose());
        for j in 0..r {
            for i in 0..a.nrows() {
                product[(i, j)] += NUGGET * a[(i, j)];
            }
        }
        product
    };
    let cross = with_all_points(covariance, samples.points, &places, drift.wide);
    let cross = drift.to_basis.map_or_else(|| cross.clone(), |t| dense::product(t.transpose(), cross.as_ref()));

    let contrasts = |rows: Mat<f64>| {
        let (left, right) = (rows.as_ref().subcols(0, r), rows.as_ref().subcols(r, p));
        right - dense::product(left, drift.others.transpose())
    };
    let cross_contrasts = contrasts(cross - with_first(drift.gram));
    let contrast_covariance = contrasts(rest - with_first(drift.others));
    let weights = dense::solve_definite(contrast_covariance, cross_contrasts.transpose().to_owned())?;
    let mut map = Mat::zeros(r, k);
    map.as_mut().subcols_mut(0, r).copy_from(drift.gram - dense::product(weights.transpose(), drift.others));
    map.as_mut().subcols_mut(r, p).copy_from(weights.transpose());
    Some(map)
}

/// `wideᵀ k`, columns of `wide` × K, with the covariance k of `points` (all, or some samples) with the samples. They are taken in blocks along a
/// space-filling curve, each with the samples within its support, and summed in that order, so that the result does not depend on the threads.
fn with_all_points(covariance: Covariance, points: &[Point], samples: &[Point], wide: MatRef<'_, f64>) -> Mat<f64> {
    let m = wide.ncols();
    let mut sum = Mat::zeros(m, samples.len());
    let order = morton_order(points);
    let blocks: Vec<&[u32]> = order.chunks(BLOCK_ROWS).collect();
    let together = (PARTS_BYTES / (8 * m * samples.len().min(NEAR_SAMPLES))).clamp(2, 64);
    for blocks in blocks.chunks(together) {
        let parts: Vec<(Vec<usize>, Mat<f64>)> = blocks
            .par_iter()
            .map(|block| {
                let own: Vec<Point> = block.iter().map(|&i| points[i as usize]).collect();
                let near = covariance.within_support(&own, samples);
                let places: Vec<Point> = near.iter().map(|&j| samples[j]).collect();
                let weights = covariances(covariance, &own, &places);
                let rows = dense::rows_of(wide, block);
                let mut part = Mat::zeros(m, near.len());
                dense::multiply(part.as_mut(), rows.transpose(), weights.as_ref());
                (near, part)
            })
            .collect();
        for (near, part) in &parts {
            for (k, &j) in near.iter().enumerate() {
                for (sum, x) in sum.col_mut(j).iter_mut().zip(part.col(k).iter()) {
                    *sum += x;
                }
            }
        }
    }
    sum
}

impl Covariance {
    /// Indices of the samples that may have a nonzero covariance with one of the points.
    fn within_support(self, points: &[Point], samples: &[Point]) -> Vec<usize> {
        let (low, high) = bounds(points);
        // Rounding may make a box seem as far as the points in it.
        let most = (1.0 + 1e-9) / (self.inverse_support * self.inverse_support);
        let squared = |p: &Point| (0..3).map(|k| (low[k] - p[k]).max(p[k] - high[k]).max(0.0).powi(2)).sum::<f64>();
        samples.iter().enumerate().filter(|(_, p)| squared(p) <= most).map(|(j, _)| j).collect()
    }
}

/// Covariances of points with samples, points × samples.
fn covariances(covariance: Covariance, points: &[Point], samples: &[Point]) -> Mat<f64> {
    let mut places = vec![[Lanes::ZERO; 3]; points.len().div_ceil(LANES)];
    for (i, p) in points.iter().enumerate() {
        for k in 0..3 {
            places[i / LANES][k].0[i % LANES] = p[k];
        }
    }
    let mut out = Mat::zeros(points.len(), samples.len());
    let mut column = vec![Lanes::ZERO; places.len()];
    for (j, sample) in samples.iter().enumerate() {
        fill(&places, sample, covariance.inverse_support, &mut column);
        for (out, value) in out.col_as_slice_mut(j).iter_mut().zip(column.iter().flat_map(|group| &group.0)) {
            *out = *value;
        }
    }
    out
}

multiversion! {
    fn fill(places: &[[Lanes; 3]], sample: &Point, inverse_support: f64, out: &mut [Lanes]) = fill_generic;
}

#[inline(always)]
fn fill_generic(places: &[[Lanes; 3]], sample: &Point, inverse_support: f64, out: &mut [Lanes]) {
    let s = [Lanes::splat(sample[0]), Lanes::splat(sample[1]), Lanes::splat(sample[2])];
    for (place, out) in places.iter().zip(out) {
        let d = [place[0] - s[0], place[1] - s[1], place[2] - s[2]];
        let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() * inverse_support;
        let rest = r.map(|r| if r < 1.0 { 1.0 - r } else { 0.0 });
        let square = rest * rest;
        *out = square * square * (r * 4.0 + 1.0);
    }
}
