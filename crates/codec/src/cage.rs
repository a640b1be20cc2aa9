//! Cages of a group of frames: `Y = E A` in the coordinates of [`CageBasis`], A in whole steps.

use crate::basis::{BasisRecord, CageBasis};
use crate::entropy::{Coder, Decoder, Encoder, Integers, MAX_CONTEXT_SIZE, MAX_SIZE, Models, SIZES, size_class};
use crate::error::{Error, Result, take};
use crate::gram_rounding::GramRounding;
use crate::trajectories::{PULSE_FRAMES, Trajectories, fit};
use crate::{MAX_FRAMES, trajectories};
use cager_geometry::linalg;
use faer::Mat;

const CUT: &str = "a group of cages is cut";

/// Part of a step from which numbers are rounded away from 0: small ones cost more than they gain.
const ROUND_UP: f64 = 0.44;

/// Whether groups come before and after a group: frames beside one are coded more exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AdjacentGroups {
    /// A group ends right before this one.
    pub before: bool,
    /// A group begins right after this one.
    pub after: bool,
}

/// Error of a frame beside another group over what it would be.
const JOINT_ERROR: f64 = 0.1;

/// Encodes cages, each rows × 3, in steps of `step`: the root mean square over the points of what
/// one coefficient moves the model. `None` where numbers are not finite, or too far apart to be
/// counted in these steps.
///
/// # Panics
/// Where a cage has another number of rows, or there are more than [`MAX_FRAMES`].
pub fn encode_cages(basis: &CageBasis, cages: &[&[f32]], step: f64, adjacent: AdjacentGroups) -> Option<Vec<u8>> {
    let (rows, frames) = (basis.rows(), cages.len());
    assert!(frames <= MAX_FRAMES && cages.iter().all(|cage| cage.len() == 3 * rows));
    // m × 3 T, to 3 m × T.
    let y = basis.forward(cages);
    let motion = Mat::from_fn(3 * rows, frames, |value, t| y[(value / 3, 3 * t + value % 3)]);
    let gram = trajectories::gram(motion.as_ref());
    let most = frames.min(3 * rows);
    let mut chosen = Trajectories::choose(gram.as_ref(), 3 * rows, step, most)?;
    let exact = fit(chosen.values().as_ref(), motion.as_ref())?;
    let in_steps = |exact: f64, round_up: f64| {
        let steps = (exact.abs() / step + round_up).floor();
        (steps <= f64::from(MAX_SIZE)).then_some(steps.copysign(exact) as i32)
    };
    let width = 3 * rows;
    let numbers = (0..chosen.count() * width).map(|at| in_steps(exact[(at % width, at / width)], ROUND_UP));
    let mut whole: Vec<i32> = numbers.collect::<Option<_>>()?;
    for (frame, is_joined) in [(0, adjacent.before), (frames.saturating_sub(1), adjacent.after)] {
        // With as many trajectories as there can be every frame is as exact as a step.
        if !is_joined || frames < 4 * PULSE_FRAMES || chosen.count() == most {
            continue;
        }
        // What the trajectories leave of this frame alone.
        let e = chosen.values();
        let of = |k: usize, value: usize| e[(frame, k)] * step * f64::from(whole[k * width + value]);
        let decoded = |value: usize| (0..chosen.count()).map(|k| of(k, value)).sum::<f64>();
        let missing: Vec<f64> = (0..width).map(|value| motion[(value, frame)] - decoded(value)).collect();
        let rms = (missing.iter().map(|x| x * x).sum::<f64>() / width as f64).sqrt();
        let Some(height) = chosen.push_pulse(frame, JOINT_ERROR * 12f64.sqrt() * rms / step) else { continue };
        whole.extend(missing.iter().map(|x| in_steps(x / height, 0.5)).collect::<Option<Vec<_>>>()?);
    }
    let count = chosen.count();
    let mut bytes = write_record(basis.record());
    bytes.extend(step.to_le_bytes());
    bytes.extend((count as u16).to_le_bytes());
    let mut coder = Encoder::default();
    chosen.code(&mut coder, frames, count);
    code_values(&mut coder, rows, count, &whole);
    bytes.extend(coder.into_bytes());
    Some(bytes)
}

/// The cages that [`encode_cages`] wrote, of as many frames.
pub fn decode_cages(basis: &CageBasis, frames: usize, bytes: &[u8]) -> Result<Vec<Vec<f32>>> {
    let rows = basis.rows();
    let (record, mut coded) = read_record(bytes)?;
    let step = f64::from_le_bytes(take(&mut coded, CUT)?);
    let count = usize::from(u16::from_le_bytes(take(&mut coded, CUT)?));
    if frames > MAX_FRAMES || count > frames.min(3 * rows) || !(step.is_finite() && step > 0.0) {
        return Err(Error::Damaged("a group of cages has impossible counts"));
    }
    if &record != basis.record() {
        return Err(Error::Damaged("a group of cages is in another basis"));
    }
    let mut coder = Decoder::new(coded)?;
    let trajectories = Trajectories::default().code(&mut coder, frames, count);
    let whole = code_values(&mut coder, rows, count, &[]);
    coder.check()?;
    let values = Mat::from_fn(count, 3 * rows, |k, value| f64::from(whole[k * 3 * rows + value]) * step);
    let motion = linalg::product(trajectories.values().as_ref(), values.as_ref());
    let y = Mat::from_fn(rows, 3 * frames, |j, column| motion[(column / 3, 3 * j + column % 3)]);
    let cages = basis.inverse(y.as_ref());
    if cages.iter().flatten().any(|x| !x.is_finite()) {
        return Err(Error::Damaged("a group of cages is not finite"));
    }
    Ok(cages)
}

/// The basis that bytes of [`encode_cages`] are in.
pub fn basis_record(bytes: &[u8]) -> Result<BasisRecord> {
    read_record(bytes).map(|(record, _)| record)
}

/// A first byte of 2 or 3 says that the Gram matrix is rounded, odd ones that the basis is rotated.
fn read_record(mut bytes: &[u8]) -> Result<(BasisRecord, &[u8])> {
    let [kind] = take(&mut bytes, CUT)?;
    let rounding = match kind {
        0 | 1 => None,
        2 | 3 => Some(GramRounding::read(&mut bytes)?),
        _ => return Err(Error::Damaged("a group of cages has an unknown basis")),
    };
    Ok((BasisRecord { rotated: kind % 2 == 1, rounding }, bytes))
}

fn write_record(record: &BasisRecord) -> Vec<u8> {
    let mut bytes = vec![u8::from(record.rotated) + if record.rounding.is_some() { 2 } else { 0 }];
    if let Some(rounding) = &record.rounding {
        rounding.write(&mut bytes);
    }
    bytes
}

/// Codes components × rows × 3 numbers, each in the context of the sizes of those around it.
fn code_values(coder: &mut impl Coder, rows: usize, count: usize, given: &[i32]) -> Vec<i32> {
    let mut models = Integers::new(3 * SIZES);
    let width = 3 * rows;
    let mut found: Vec<i32> = Vec::with_capacity(width * count);
    for at in 0..width * count {
        let (k, value) = (at / width, at % width);
        let size =
            |known: bool, back: usize| if known { found[at - back].unsigned_abs().min(MAX_CONTEXT_SIZE) } else { 0 };
        let around = 8 * size(value >= 3, 3)
            + 4 * size(value >= 6, 6)
            + 8 * size(k >= 1, width)
            + 4 * size(k >= 2, 2 * width)
            + 6 * size(value % 3 >= 1, 1)
            + 3 * size(value % 3 >= 2, 2);
        let context = SIZES * (value % 3) + size_class(around);
        let value = models.code(coder, context, given.get(at).copied().unwrap_or(0));
        found.push(value);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::mesh::Point;

    fn basis(rows: usize) -> CageBasis {
        let mut random = fastrand::Rng::with_seed(3);
        let phi = Mat::from_fn(5 * rows, rows, |_, _| random.f64() / rows as f64);
        let rest: Vec<Point> = (0..rows).map(|k| [k as f64 / rows as f64, 0.5, 0.0]).collect();
        CageBasis::for_encoding(phi.as_ref(), &rest).unwrap()
    }

    fn cages(rows: usize, frames: usize) -> Vec<Vec<f32>> {
        let value = |t: usize, k: usize| (t as f32 * 0.2 + (k % 3) as f32).sin() * (1.0 + k as f32 / rows as f32);
        (0..frames).map(|t| (0..3 * rows).map(|k| value(t, k)).collect()).collect()
    }

    #[test]
    fn cages_come_back_within_what_the_step_allows() {
        for (rows, frames) in [(20, 30), (4, 1), (1, 9), (30, 2)] {
            let (basis, cages) = (basis(rows), cages(rows, frames));
            let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
            let mut sizes = Vec::new();
            for step in [1e-2, 1e-4, 1e-6] {
                let bytes = encode_cages(&basis, &views, step, AdjacentGroups::default()).unwrap();
                let back = decode_cages(&basis, frames, &bytes).unwrap();
                let views: Vec<&[f32]> = back.iter().map(Vec::as_slice).collect();
                let (a, b) =
                    (basis.forward(&views), basis.forward(&cages.iter().map(Vec::as_slice).collect::<Vec<_>>()));
                let rms = (&a - &b).norm_l2() / ((3 * rows * frames) as f64).sqrt();
                assert!(rms < step + 1e-6, "{rows} {frames} {step} {rms}");
                sizes.push(bytes.len());
            }
            assert!(sizes.is_sorted(), "{sizes:?}");
        }
    }

    #[test]
    fn neighbouring_groups_join_smoothly() {
        let (rows, frames, step) = (30, 64, 2e-2);
        let basis = basis(rows);
        let mut random = fastrand::Rng::with_seed(5);
        let waves: Vec<[f32; 3]> = (0..3 * rows).map(|_| std::array::from_fn(|_| random.f32())).collect();
        let value = |t: usize, [a, b, c]: [f32; 3]| {
            a * (0.1 * t as f32 * (0.2 + b)).sin() + 0.3 * c * (0.3 * t as f32 + 6.0 * a).sin()
        };
        let cages: Vec<Vec<f32>> =
            (0..3 * frames).map(|t| waves.iter().map(|&wave| value(t, wave)).collect()).collect();
        // What coding adds to each frame, in what it moves the model.
        let changes = |joins: bool| {
            let coded = cages.chunks(frames).enumerate().flat_map(|(k, group)| {
                let views: Vec<&[f32]> = group.iter().map(Vec::as_slice).collect();
                let adjacent = AdjacentGroups { before: joins && k > 0, after: joins && k < 2 };
                decode_cages(&basis, frames, &encode_cages(&basis, &views, step, adjacent).unwrap()).unwrap()
            });
            let errors: Vec<Mat<f64>> =
                coded.zip(&cages).map(|(a, b)| basis.forward(&[&a]) - basis.forward(&[b])).collect();
            let all: Vec<f64> = errors.windows(2).map(|pair| (&pair[1] - &pair[0]).norm_l2()).collect();
            let mut sorted = all.clone();
            sorted.sort_by(f64::total_cmp);
            [frames, 2 * frames].map(|joint| all[joint - 1] / sorted[all.len() / 2])
        };
        let (without, with) = (changes(false), changes(true));
        assert!(with.iter().all(|&change| change < 1.5), "{with:?}");
        assert!(without.iter().all(|&change| change > 8.0), "{without:?}");
    }

    #[test]
    fn joints_cost_no_exactness_where_every_trajectory_is_needed() {
        let mut random = fastrand::Rng::with_seed(6);
        for (rows, frames) in [(4, 40), (20, 32)] {
            let basis = basis(rows);
            let cages: Vec<Vec<f32>> = (0..frames).map(|_| (0..3 * rows).map(|_| random.f32()).collect()).collect();
            let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
            let both = AdjacentGroups { before: true, after: true };
            let bytes = encode_cages(&basis, &views, 1e-5, both).unwrap();
            for (a, b) in decode_cages(&basis, frames, &bytes).unwrap().iter().zip(&cages) {
                assert!((basis.forward(&[a]) - basis.forward(&[b])).norm_max() < 1e-3);
            }
        }
    }

    #[test]
    fn damage_is_an_error_or_finite_cages() {
        let (basis, cages) = (basis(20), cages(20, 30));
        let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        let bytes = encode_cages(&basis, &views, 1e-4, AdjacentGroups::default()).unwrap();
        let mut refused = 0;
        let mut check = |bytes: &[u8]| match decode_cages(&basis, 30, bytes) {
            Err(_) => refused += 1,
            Ok(cages) => {
                assert!(cages.len() == 30 && cages.iter().all(|cage| cage.len() == 60));
                assert!(cages.iter().flatten().all(|x| x.is_finite()), "a cage is not finite");
            }
        };
        for cut in 0..bytes.len() {
            check(&bytes[..cut]);
        }
        for at in 0..bytes.len() {
            for flip in [0x5a, 0x80, 0x7f] {
                let mut damaged = bytes.clone();
                damaged[at] ^= flip;
                check(&damaged);
            }
        }
        assert!(refused > 20, "{refused}");
        assert!(decode_cages(&basis, 30, &bytes[..5]).is_err());
        assert!(decode_cages(&basis, MAX_FRAMES + 1, &bytes).is_err());
        let nan = vec![f32::NAN; 60];
        assert!(encode_cages(&basis, &[&nan], 1e-3, AdjacentGroups::default()).is_none());
    }
}
