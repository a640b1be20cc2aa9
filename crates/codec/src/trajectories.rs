//! Motion of a group as few trajectories that all points share: `M ≈ E A`, with frames × components
//! E of nearly orthonormal columns, eigenvectors of `M Mᵀ` (Karhunen–Loève transform in time).

use crate::entropy::{Coder, Integers, MAX_CONTEXT_SIZE, Models, SIZES, size_class};
use cager_geometry::linalg;
use faer::{Mat, MatRef};

/// Least energy per value of a component, over that of rounding to whole steps.
const MIN_ENERGY: f64 = 0.3 / 12.0;
/// Added to a size before rounding down: below 0.5, since small entries cost more than they gain.
const ROUND_UP: f64 = 0.35;
/// Largest number of binary digits of an entry of E.
const MAX_DIGITS: u32 = 26;

/// Fewest rows of one part of a sum over all of them, and most parts.
const MIN_BLOCK_ROWS: usize = 2048;
const MAX_BLOCKS: usize = 16;

/// `Mᵀ M` of motion with many rows.
pub(crate) fn gram(motion: MatRef<'_, f64>) -> Mat<f64> {
    linalg::mirrored(linalg::gram(motion, motion.nrows().div_ceil(MAX_BLOCKS).max(MIN_BLOCK_ROWS)))
}

/// Frames over which a pulse beside another group falls to 0.
pub(crate) const PULSE_FRAMES: usize = 8;
/// Binary digits of the largest entry of a pulse.
const PULSE_DIGITS: f64 = 7.0;

/// The digits of each trajectory, and its cosine transform in time in units of 2^−digits.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Trajectories {
    frames: usize,
    digits: Vec<u32>,
    /// Component by component, frames each.
    waves: Vec<i32>,
}

impl Trajectories {
    /// At most `most` of motion with this `M Mᵀ`, `width` values a frame, in steps of `step`.
    pub(crate) fn choose(gram: MatRef<'_, f64>, width: usize, step: f64, most: usize) -> Option<Self> {
        let frames = gram.nrows();
        let (energies, vectors) = linalg::eigen(gram)?;
        let least = MIN_ENERGY * width as f64 * step * step;
        let count = energies.iter().take_while(|&&energy| energy > least).count().min(most);
        let waves = linalg::product(cosines(frames).as_ref(), vectors.subcols(0, count));
        // An error times the component's length is an error of the values: coded to the same step.
        let digits: Vec<u32> = energies[..count]
            .iter()
            .map(|energy| ((energy.sqrt() / step).log2().ceil().max(2.0) as u32).min(MAX_DIGITS))
            .collect();
        let whole = |k: usize| {
            let unit = (digits[k] as f64).exp2();
            let column = waves.col(k);
            let whole = move |x: f64| (x.abs() + ROUND_UP).floor().copysign(x) as i32;
            (0..frames).map(move |t| whole(column[t] * unit)).collect::<Vec<i32>>()
        };
        Some(Self { frames, waves: (0..count).flat_map(whole).collect(), digits })
    }

    /// Adds a trajectory of about `height` at `frame`, the first or last, that falls to 0; its
    /// value there. `None` where it is too low or too high to be counted.
    pub(crate) fn push_pulse(&mut self, frame: usize, height: f64) -> Option<f64> {
        let digits = PULSE_DIGITS - height.log2().floor();
        if !(2.0..=f64::from(MAX_DIGITS)).contains(&digits) {
            return None;
        }
        let part = |t: usize| t.abs_diff(frame).min(PULSE_FRAMES) as f64 / PULSE_FRAMES as f64;
        let pulse = Mat::from_fn(self.frames, 1, |t, _| height * 0.5 * (1.0 + (std::f64::consts::PI * part(t)).cos()));
        let waves = linalg::product(cosines(self.frames).as_ref(), pulse.as_ref());
        self.waves.extend(waves.col(0).iter().map(|x| (x * digits.exp2()).round() as i32));
        self.digits.push(digits as u32);
        let value = self.values()[(frame, self.count() - 1)];
        Some(value)
    }

    /// Number of components.
    pub(crate) fn count(&self) -> usize {
        self.digits.len()
    }

    /// Codes `count` of them.
    pub(crate) fn code(&self, coder: &mut impl Coder, frames: usize, count: usize) -> Self {
        let mut lengths = Integers::new(1);
        let mut models = Integers::new(SIZES);
        let mut found = Self { frames, digits: Vec::with_capacity(count), waves: Vec::with_capacity(frames * count) };
        let mut before = 0;
        for k in 0..count {
            let digits = self.digits.get(k).copied().unwrap_or(0);
            before += lengths.code(coder, 0, digits as i32 - before);
            before = before.clamp(0, MAX_DIGITS as i32);
            found.digits.push(before as u32);
            let (mut last, mut last_but_one) = (0, 0);
            for t in 0..frames {
                let above = if k > 0 { found.waves[(k - 1) * frames + t].unsigned_abs() } else { 0 };
                let size = 8 * last + 4 * last_but_one + 4 * above.min(MAX_CONTEXT_SIZE);
                let value = self.waves.get(k * frames + t).copied().unwrap_or(0);
                let value = models.code(coder, size_class(size), value);
                found.waves.push(value);
                (last_but_one, last) = (last, value.unsigned_abs().min(MAX_CONTEXT_SIZE));
            }
        }
        found
    }

    /// E, frames × components.
    pub(crate) fn values(&self) -> Mat<f64> {
        let waves = Mat::from_fn(self.frames, self.count(), |t, k| {
            f64::from(self.waves[k * self.frames + t]) / (self.digits[k] as f64).exp2()
        });
        linalg::product(cosines(self.frames).transpose(), waves.as_ref())
    }
}

/// Aᵀ of least squares: values × components, for Mᵀ, values × frames.
pub(crate) fn fit(trajectories: MatRef<'_, f64>, motion: MatRef<'_, f64>) -> Option<Mat<f64>> {
    let count = trajectories.ncols();
    let mut inner = linalg::product(trajectories.transpose(), trajectories);
    for k in 0..count {
        inner[(k, k)] += 1e-9;
    }
    let mut shares = trajectories.transpose().to_owned();
    linalg::solve_cholesky(linalg::cholesky(inner)?.as_ref(), &mut shares);
    Some(linalg::tall_product(motion, shares.transpose()))
}

/// The orthonormal cosine transform (DCT-II) of so many values.
fn cosines(n: usize) -> Mat<f64> {
    let scale = |k: usize| if k == 0 { (1.0 / n as f64).sqrt() } else { (2.0 / n as f64).sqrt() };
    Mat::from_fn(n, n, |k, t| scale(k) * (std::f64::consts::PI * (t as f64 + 0.5) * k as f64 / n as f64).cos())
}
