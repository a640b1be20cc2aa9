//! Whole frames from a few of their points: universal kriging, with the cage's own deformations as drift (Matheron 1969).
//!
//! A frame is `P = Φ C + e`. Least squares over all points projects the residual e away; with K rows only part of it is seen,
//! and the rest ends up in the cage. But e varies smoothly over the model, so it can be interpolated: its covariance is taken
//! to be a function of distance at rest, with compact support (Wendland 1995, C²). The best linear prediction of the frame
//! that is exact wherever a cage explains it,
//!
//! `N = B Ĝ + k Ω⁻¹ (I − B_S Ĝ)`, `Ĝ = (B_Sᵀ Ω⁻¹ B_S)⁻¹ B_Sᵀ Ω⁻¹`, `N B_S = B`,
//!
//! then takes the frame's place in least squares over all points. B is any basis of the columns of `Φ`, S are the samples,
//! Ω their covariance and k that of all points with them. Only `Bᵀ N` is ever needed, r × K.
//!
//! Mean L2 above least squares over all points, K = 2m, `horse-gallop`, `supercages-arm`, `samba`, `makehuman-cmu-walk`:
//! this 7, 2, 1, 3 %; samples weighted by the number of points nearest to them 9, 4, 4, 7 %; weights fitted to `ΦᵀΦ` (nonnegative
//! least squares) 11, 5, 5, 10 %; this with samples spread in the row space of `Φ` 11, 3, 7, 6 %, at random 11, 12, 6, 13 %, by greatest
//! variance of the prediction 4, 1, 1, 5 % (for n·K² work), after Lloyd relaxation 6, 2, 1, 3 %; without the rows of maximum volume it
//! is unstable. Kernels with or without compact support and any width beyond four times the spacing differ by less than a percent.

use super::farthest::along_curve;
use crate::dense;
use crate::mesh::{Point, bounds, diagonal};
use crate::simd::{LANES, Lanes, multiversion};
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Support of the covariance, in distances of the farthest point from its nearest sample.
const SUPPORT: f64 = 6.0;
/// Variance of what does not vary smoothly, relative to what does. Keeps coincident samples apart.
const NUGGET: f64 = 1e-2;
const BLOCK_ROWS: usize = 256;
/// Samples in the reach of a block, about, where there are many.
const NEAR_SAMPLES: usize = 512;
/// Partial sums take about this much memory together, unless two already take more.
const PARTS_BYTES: usize = 64 << 20;

/// Covariance of residuals as a function of distance.
#[derive(Clone, Copy)]
struct Covariance {
    /// One over the distance from which on there is none.
    inverse_support: f64,
}

/// What is interpolated from.
pub(crate) struct Samples<'a> {
    /// All points, n.
    pub(crate) points: &'a [Point],
    /// The rows read, K.
    pub(crate) rows: &'a [u32],
    /// Distance of the farthest point from its nearest sample.
    pub(crate) reach: f64,
}

/// A basis L of the columns of `Φ`, n × r, `wide · to_basis`, and how it stands to B, which is the identity at the first r samples.
pub(crate) struct Drift<'a> {
    /// n × m; L itself where `to_basis` is left out.
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
/// With `B_S = [I; D]` no cage is seen by `W = [−D, I]`, and `N = [B, 0] + (k − B Ω₁) Wᵀ (W Ω Wᵀ)⁻¹ W` is the same prediction, from
/// K − r equations; Ω₁ are the first r rows of Ω.
///
/// `None` where the factorisation fails.
pub(crate) fn interpolated(samples: &Samples<'_>, drift: &Drift<'_>) -> Option<Mat<f64>> {
    let (p, r) = drift.others.shape();
    let k = p + r;
    if p == 0 {
        return Some(drift.gram.to_owned());
    }
    // No distance is left where every point lies at a sample.
    let reach = samples.reach.max(1e-9 * diagonal(samples.points));
    let covariance = Covariance { inverse_support: 1.0 / (SUPPORT * reach) };
    let places: Vec<Point> = samples.rows.iter().map(|&i| samples.points[i as usize]).collect();
    let mut rest = covariances(covariance, &places[r..], &places);
    for i in 0..p {
        rest[(i, r + i)] += NUGGET;
    }
    // A Ω₁: few samples are in each other's reach.
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

    let unseen = |rows: Mat<f64>| {
        let (left, right) = (rows.as_ref().subcols(0, r), rows.as_ref().subcols(r, p));
        right - dense::product(left, drift.others.transpose())
    };
    let seen = unseen(cross - with_first(drift.gram));
    let among = unseen(rest - with_first(drift.others));
    let weights = dense::solve_definite(among, seen.transpose().to_owned())?;
    let mut map = Mat::zeros(r, k);
    map.as_mut().subcols_mut(0, r).copy_from(drift.gram - dense::product(weights.transpose(), drift.others));
    map.as_mut().subcols_mut(r, p).copy_from(weights.transpose());
    Some(map)
}

/// `wideᵀ k`, columns of `wide` × K, with the covariance k of all points with the samples. Points are taken in blocks along a
/// space-filling curve, each with the samples in its reach, and added up in that order, so that the threads do not matter.
fn with_all_points(covariance: Covariance, points: &[Point], samples: &[Point], wide: MatRef<'_, f64>) -> Mat<f64> {
    let m = wide.ncols();
    let mut sum = Mat::zeros(m, samples.len());
    let order = along_curve(points);
    let blocks: Vec<&[u32]> = order.chunks(BLOCK_ROWS).collect();
    let together = (PARTS_BYTES / (8 * m * samples.len().min(NEAR_SAMPLES))).clamp(2, 64);
    for blocks in blocks.chunks(together) {
        let parts: Vec<(Vec<usize>, Mat<f64>)> = blocks
            .par_iter()
            .map(|block| {
                let own: Vec<Point> = block.iter().map(|&i| points[i as usize]).collect();
                let near = covariance.in_reach(&own, samples);
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
    /// The samples that may have a covariance with one of the points.
    fn in_reach(self, points: &[Point], samples: &[Point]) -> Vec<usize> {
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
