//! Normals of the base and of targets: those of all frames, as near as their weights come to them.

use rayon::prelude::*;

use crate::normals::unit;

/// Normals of the base and each target: `of_frame` gives so many of the positions of one of the
/// `frames`, and `weights` are those of targets.
///
/// Weights of principal components are about orthogonal but for their means, so a least-squares fit
/// is one product for each target. Programs make the sum of a length of 1, so what is fitted is
/// normals divided by the length of their mean.
pub(super) fn normals<'a>(
    frames: impl ExactSizeIterator<Item = &'a [f32]>,
    points: usize,
    of_frame: impl Fn(&[f32]) -> Vec<[f32; 3]>,
    weights: &[f32],
    targets: usize,
) -> Vec<[f32; 3]> {
    let count = frames.len();
    let mut sums = vec![[0.0_f64; 3]; points];
    let mut fitted = vec![[0.0_f32; 3]; targets * points];
    let weights_of = |frame: usize| &weights[frame * targets..(frame + 1) * targets];
    let mean_weight = |k: usize| (0..count).map(|frame| f64::from(weights_of(frame)[k])).sum::<f64>() / count as f64;
    let means: Vec<f32> = (0..targets).map(|k| mean_weight(k) as f32).collect();
    for (frame, positions) in frames.enumerate() {
        let normals = of_frame(positions);
        for (sum, normal) in sums.iter_mut().zip(&normals) {
            sum.iter_mut().zip(normal).for_each(|(sum, &x)| *sum += f64::from(x));
        }
        fitted.par_chunks_mut(points).enumerate().for_each(|(k, fitted)| {
            let weight = weights_of(frame)[k] - means[k];
            for (fitted, normal) in fitted.iter_mut().zip(&normals) {
                fitted.iter_mut().zip(normal).for_each(|(fitted, x)| *fitted += weight * x);
            }
        });
    }
    let length = |sum: &[f64; 3]| sum.iter().map(|x| x * x).sum::<f64>().sqrt() / count as f64;
    fitted.par_chunks_mut(points).enumerate().for_each(|(k, fitted)| {
        let squares: f32 = (0..count).map(|frame| (weights_of(frame)[k] - means[k]).powi(2)).sum();
        for (fitted, sum) in fitted.iter_mut().zip(&sums) {
            // Where normals turn all around, their mean says nothing.
            let scale = (squares * (length(sum) as f32).max(SHORTEST)).recip();
            fitted.iter_mut().for_each(|x| *x = if scale.is_finite() { *x * scale } else { 0.0 });
        }
    });
    let mut all: Vec<[f32; 3]> = sums.into_iter().map(unit).collect();
    // Where all weights are 0, and of length 1 again, as the sum may have any.
    for (point, base) in all.iter_mut().enumerate() {
        for (fitted, mean) in fitted.iter().skip(point).step_by(points).zip(&means) {
            base.iter_mut().zip(fitted).for_each(|(base, x)| *base -= mean * x);
        }
        let scale = base.iter().map(|x| x * x).sum::<f32>().sqrt().max(SHORTEST).recip();
        fitted.iter_mut().skip(point).step_by(points).flatten().for_each(|x| *x *= scale);
        *base = unit(base.map(f64::from));
    }
    all.extend(fitted);
    all
}

/// Of a mean of normals: shorter ones are taken as this long.
const SHORTEST: f32 = 0.1;
