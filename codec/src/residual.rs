//! What the cage cannot say: the difference of a group's positions to those of its cages.
//!
//! `R ≈ E A` as for cages ([`crate::trajectories`]); the numbers A of each component are predicted from coarse to fine on the mesh ([`Hierarchy`]) and coded in whole
//! steps; then single vertices are corrected, so that with a bound none is farther from where it was captured.

use crate::cage::step_and_count;
use crate::corrections::Corrections;
use crate::entropy::{Coder, Decoder, Encoder, Integers, MOST, SIZES, size_class};
use crate::error::{Error, Result};
use crate::hierarchy::Hierarchy;
use crate::trajectories::{Trajectories, fit};
use crate::{MOST_FRAMES, MOST_POSITIONS, linear};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Bytes before the coded numbers: the step as f64, the number of components as u16, the step of corrections as f64, the bytes of the components as u32.
const HEAD: usize = 22;
/// Parts of a step in which predictions are counted.
const PARTS: i64 = 16;
/// What is added before numbers are rounded down: small ones cost more than they are worth, measured at the same error of the whole file.
const ROUND_UP: i64 = 5;
/// Points that one task adds up.
const BLOCK: usize = 2048;
/// Components that are looked at together before they are coded.
const AT_A_TIME: usize = 8;

/// A group to encode: for each frame, where its points are and where its cage takes them, points × 3.
pub struct ResidualGroup<'a> {
    /// Positions as captured.
    pub captured: &'a [&'a [f64]],
    /// Positions of the decoded cages.
    pub of_cages: &'a [Vec<f32>],
    /// Step of the numbers, in the unit of the positions.
    pub step: f64,
    /// Largest distance allowed between captured and decoded positions; corrections keep to it.
    pub bound: Option<f64>,
    /// Most numbers of components, three for each point: what readers allow.
    pub most_numbers: usize,
}

/// Encodes what is left of a group. `None` where numbers are not finite, or too far apart to be counted in these steps.
///
/// # Panics
/// Where frames have another number of points, or there are too many of them.
pub fn encode_residual(hierarchy: &Hierarchy, group: &ResidualGroup<'_>) -> Option<Vec<u8>> {
    let (points, frames) = (hierarchy.points(), group.captured.len());
    assert!(frames == group.of_cages.len() && frames <= MOST_FRAMES && points * frames <= MOST_POSITIONS);
    assert!(group.captured.iter().all(|frame| frame.len() == 3 * points));
    let mut motion = Mat::<f64>::zeros(3 * points, frames);
    motion.par_col_iter_mut().enumerate().for_each(|(t, column)| {
        let pairs = group.captured[t].iter().zip(&group.of_cages[t]);
        column.iter_mut().zip(pairs).for_each(|(x, (&captured, &of_cage))| *x = captured - f64::from(of_cage));
    });
    let gram = linear::gram(motion.as_ref());
    let chosen = Trajectories::choose(
        gram.as_ref(),
        3 * points,
        group.step,
        frames.min(group.most_numbers / (3 * points).max(1)),
    )?;
    let count = chosen.count();
    let values = fit(chosen.values().as_ref(), motion.as_ref())?;
    drop(motion);
    let per_unit = PARTS as f64 / group.step;
    let most = f64::from(MOST) / per_unit;
    let mut coder = Encoder::default();
    chosen.code(&mut coder, frames, count);
    let mut decoded = Residual::new(&chosen, points);
    let mut components = Components::new(hierarchy);
    let target_of = |k: usize| {
        let parts = |x: f64| (x.abs() < most).then_some((per_unit * x + 0.5f64.copysign(x)) as i64);
        let (vertices, _) = values.col_as_slice(k).as_chunks::<3>();
        let target = vertices.iter().map(|&[x, y, z]| Some([parts(x)?, parts(y)?, parts(z)?]));
        let target: Vec<[i64; 3]> = target.collect::<Option<_>>()?;
        let predicts = cost(hierarchy, &target, true) < cost(hierarchy, &target, false);
        Some((target, predicts))
    };
    // While some components are coded, what does not depend on them is found for the next.
    let all: Vec<usize> = (0..count).collect();
    let mut chunks = all.chunks(AT_A_TIME);
    let mut next =
        || chunks.next().map(|some| (some, some.par_iter().map(|&k| target_of(k)).collect::<Option<Vec<_>>>()));
    let mut found = next();
    while let Some((some, targets)) = found {
        let targets = targets?;
        let code = || {
            for (&k, (target, predicts)) in some.iter().zip(&targets) {
                decoded.set(k, components.code(&mut coder, target, *predicts), group.step);
            }
        };
        (found, ()) = rayon::join(&mut next, code);
    }
    let coded = coder.into_bytes();
    let corrections = match group.bound {
        None => Corrections::default(),
        Some(bound) => {
            let mut positions: Vec<Vec<f32>> = group.of_cages.to_vec();
            decoded.add(0, &mut positions);
            Corrections::find(group.captured, &positions, bound - decoded.rounding())?
        }
    };
    let mut bytes = group.step.to_le_bytes().to_vec();
    bytes.extend((count as u16).to_le_bytes());
    bytes.extend(corrections.step().to_le_bytes());
    bytes.extend((coded.len() as u32).to_le_bytes());
    bytes.extend(coded);
    bytes.extend(corrections.encode());
    Some(bytes)
}

/// What is added to the positions of a group's cages.
#[derive(Clone, Debug)]
pub struct Residual {
    trajectories: Mat<f32>,
    /// Values × components.
    values: Mat<f32>,
    corrections: Corrections,
}

impl Residual {
    fn new(trajectories: &Trajectories, points: usize) -> Self {
        let e = trajectories.values();
        Self {
            trajectories: Mat::from_fn(e.nrows(), e.ncols(), |t, k| e[(t, k)] as f32),
            values: Mat::zeros(3 * points, e.ncols()),
            corrections: Corrections::default(),
        }
    }

    fn set(&mut self, component: usize, parts: &[[i64; 3]], step: f64) {
        let unit = step / PARTS as f64;
        let column = self.values.col_mut(component).iter_mut();
        column.zip(parts.as_flattened()).for_each(|(value, &parts)| *value = (parts as f64 * unit) as f32);
    }

    /// What [`encode_residual`] wrote, for a group of as many frames, where that are at most so many numbers of components.
    ///
    /// # Errors
    /// Bytes that the encoder did not write.
    pub fn decode(hierarchy: &Hierarchy, frames: usize, bytes: &[u8], most: usize) -> Result<Self> {
        let points = hierarchy.points();
        if frames > MOST_FRAMES || points.saturating_mul(frames) > MOST_POSITIONS {
            return Err(Error::Damaged("a group has too many positions"));
        }
        let (head, rest) = bytes.split_first_chunk::<HEAD>().ok_or(Error::Damaged("a residual is cut"))?;
        let (step, count) = step_and_count(&std::array::from_fn(|k| head[k]));
        let correction = f64::from_le_bytes(std::array::from_fn(|k| head[10 + k]));
        let length = u32::from_le_bytes(std::array::from_fn(|k| head[18 + k])) as usize;
        let too_many = count > frames.min(3 * points) || (3 * points).saturating_mul(count) > most;
        let impossible = too_many || [step, correction].iter().any(|x| !x.is_finite());
        let Some((coded, corrected)) = rest.split_at_checked(length).filter(|_| !impossible) else {
            return Err(Error::Damaged("a residual has impossible counts"));
        };
        let mut coder = Decoder::new(coded)?;
        let trajectories = Trajectories::default().code(&mut coder, frames, count);
        let mut residual = Self::new(&trajectories, points);
        let mut components = Components::new(hierarchy);
        for k in 0..count {
            residual.set(k, components.code(&mut coder, &[], false), step);
            coder.check()?;
        }
        residual.corrections = Corrections::decode(corrected, frames, points, correction)?;
        Ok(residual)
    }

    /// Adds to positions of the group's frames from `first` on, each points × 3.
    ///
    /// # Panics
    /// Where there are more frames than the group has, or other points.
    pub fn add(&self, first: usize, positions: &mut [Vec<f32>]) {
        let count = positions.len();
        let e = self.trajectories.subrows(first, count);
        let mut blocks: Vec<Vec<&mut [f32]>> = Vec::new();
        for frame in positions.iter_mut() {
            assert_eq!(frame.len(), self.values.nrows(), "a frame of this model");
            for (k, block) in frame.chunks_mut(3 * BLOCK).enumerate() {
                if blocks.len() == k {
                    blocks.push(Vec::with_capacity(count));
                }
                blocks[k].push(block);
            }
        }
        blocks.into_par_iter().enumerate().for_each(|(k, mut block)| {
            let rows = block.first().map_or(0, |part| part.len());
            let mut sums = Mat::<f32>::zeros(rows, count);
            let values = self.values.subrows(3 * BLOCK * k, rows);
            matmul(sums.as_mut(), Accum::Replace, values, e.transpose(), 1.0, Par::Seq);
            for (t, part) in block.iter_mut().enumerate() {
                let sums = sums.col(t);
                part.iter_mut().zip(sums.iter()).for_each(|(x, &sum)| *x += sum);
            }
        });
        for (k, frame) in positions.iter_mut().enumerate() {
            self.corrections.apply(first + k, frame);
        }
    }

    /// How far two machines that add in single precision can be apart, about: two units in the last place of the largest sum of sizes.
    fn rounding(&self) -> f64 {
        let sizes = Mat::from_fn(self.trajectories.ncols(), 2, |k, which| {
            let largest = |column: faer::ColRef<'_, f32>| column.iter().fold(0.0f32, |most, x| most.max(x.abs()));
            if which == 0 { largest(self.trajectories.col(k)) } else { largest(self.values.col(k)) }
        });
        let sum: f64 = (0..sizes.nrows()).map(|k| f64::from(sizes[(k, 0)]) * f64::from(sizes[(k, 1)])).sum();
        2.0 * f64::from(f32::EPSILON) * sum
    }

    /// Number of positions that are corrected one by one.
    pub fn corrected(&self) -> usize {
        self.corrections.count()
    }

    /// Whether it changes anything.
    pub fn is_needed(&self) -> bool {
        self.values.ncols() > 0 || self.corrected() > 0
    }
}

/// Codes component after component, in parts of a step.
struct Components<'a> {
    hierarchy: &'a Hierarchy,
    models: [Integers; 2],
    flag: crate::entropy::Bit,
    /// Sizes of the numbers of the component before.
    before: Vec<[u32; 3]>,
    sizes: Vec<[u32; 3]>,
    /// The numbers of this component.
    found: Vec<[i64; 3]>,
}

impl<'a> Components<'a> {
    fn new(hierarchy: &'a Hierarchy) -> Self {
        let points = hierarchy.points();
        let models = [Integers::new(3 * SIZES), Integers::new(3 * SIZES)];
        Self {
            hierarchy,
            models,
            flag: Default::default(),
            before: vec![[0; 3]; points],
            sizes: vec![[0; 3]; points],
            found: vec![[0; 3]; points],
        }
    }

    /// Codes the numbers nearest to `target`, as differences to their prediction or not; gives what a decoder makes of them.
    fn code(&mut self, coder: &mut impl Coder, target: &[[i64; 3]], predicts: bool) -> &[[i64; 3]] {
        let predicts = coder.bit(&mut self.flag, predicts);
        let models = &mut self.models[usize::from(predicts)];
        let found = &mut self.found;
        for (vertex, parents) in self.hierarchy.iter() {
            let near = parents.len().max(1) as u64;
            let mut around = [0u64; 3];
            for &parent in parents {
                let sizes = &self.sizes[parent as usize];
                (0..3).for_each(|k| around[k] += u64::from(sizes[k]));
            }
            let expected = if predicts { mean(found, parents) } else { [0; 3] };
            let mut beside = 0;
            for k in 0..3 {
                let around = (16 * around[k] / near).min(1 << 20) as u32;
                let context = size_class(around + 6 * self.before[vertex][k] + beside);
                let value = target.get(vertex).map_or(0, |target| rounded(target[k] - expected[k]));
                let value = models.code(coder, SIZES * k + context, value);
                found[vertex][k] = expected[k] + PARTS * i64::from(value);
                let size = value.unsigned_abs().min(1 << 16);
                self.sizes[vertex][k] = size;
                beside = beside / 2 + 5 * size;
            }
        }
        std::mem::swap(&mut self.before, &mut self.sizes);
        found
    }
}

/// About how many binary digits the numbers of a component take.
fn cost(hierarchy: &Hierarchy, target: &[[i64; 3]], predicts: bool) -> f64 {
    static DIGITS: LazyLock<[f64; 256]> =
        LazyLock::new(|| std::array::from_fn(|size| (1.0 + 2.0 * size as f64).log2()));
    let mut found = vec![[0i64; 3]; target.len()];
    let mut cost = 0.0;
    for (vertex, parents) in hierarchy.iter() {
        let expected = if predicts { mean(&found, parents) } else { [0; 3] };
        for k in 0..3 {
            let value = rounded(target[vertex][k] - expected[k]);
            found[vertex][k] = expected[k] + PARTS * i64::from(value);
            let size = value.unsigned_abs();
            cost += DIGITS.get(size as usize).copied().unwrap_or_else(|| (1.0 + 2.0 * f64::from(size)).log2());
        }
    }
    cost
}

/// Rounded to whole steps; less than 11/16 of a step is dropped.
fn rounded(parts: i64) -> i32 {
    let steps = (parts.abs() + ROUND_UP) / PARTS * parts.signum();
    steps.clamp(-i64::from(MOST), i64::from(MOST)) as i32
}

/// What a vertex is predicted from its parents: their means, rounded down; without parents 0.
fn mean(found: &[[i64; 3]], parents: &[u32]) -> [i64; 3] {
    let mut sums = [0; 3];
    for &parent in parents {
        (0..3).for_each(|k| sums[k] += found[parent as usize][k]);
    }
    let count = parents.len().max(1) as i64;
    sums.map(|sum| sum.div_euclid(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::mesh::Polygons;

    fn mesh(side: u32) -> Polygons {
        let mut faces = Polygons::new();
        for (i, j) in (0..side - 1).flat_map(|i| (0..side - 1).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| i * side + j;
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        faces
    }

    fn largest(captured: &[&[f64]], decoded: &[Vec<f32>]) -> f64 {
        let distance = |a: &[f64], b: &[f32]| (0..3).map(|k| (a[k] - f64::from(b[k])).powi(2)).sum::<f64>().sqrt();
        let pairs = captured.iter().zip(decoded).flat_map(|(a, b)| a.chunks_exact(3).zip(b.chunks_exact(3)));
        pairs.map(|(a, b)| distance(a, b)).fold(0.0, f64::max)
    }

    #[test]
    fn the_bound_holds_for_smooth_motion_noise_jumps_and_nothing_at_all() {
        let side = 20;
        let hierarchy = Hierarchy::new(&mesh(side), (side * side) as usize);
        let points = hierarchy.points();
        let mut random = fastrand::Rng::with_seed(4);
        let smooth = |t: usize, k: usize| (0.3 * t as f64 + 0.01 * k as f64).sin() * 0.05;
        let mut kinds: Vec<(&str, Vec<Vec<f64>>)> = vec![("constant", vec![vec![0.25; 3 * points]; 9])];
        kinds.push(("smooth", (0..24).map(|t| (0..3 * points).map(|k| smooth(t, k)).collect()).collect()));
        kinds.push(("one frame", vec![(0..3 * points).map(|k| smooth(3, k)).collect()]));
        kinds.push(("noise", (0..12).map(|_| (0..3 * points).map(|_| random.f64()).collect()).collect()));
        let jump = |t: usize, k: usize| if t == 5 && k / 3 == 17 { 300.0 } else { smooth(t, k) };
        kinds.push(("jump", (0..12).map(|t| (0..3 * points).map(|k| jump(t, k)).collect()).collect()));
        for (name, frames) in &kinds {
            let captured: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
            let of_cages = vec![vec![0.0f32; 3 * points]; frames.len()];
            for bound in [1e-1, 1e-2, 1e-3] {
                for ratio in [0.3, 1.0, 4.0] {
                    let group = ResidualGroup {
                        captured: &captured,
                        of_cages: &of_cages,
                        step: bound * ratio,
                        bound: Some(bound),
                        most_numbers: usize::MAX,
                    };
                    let bytes = encode_residual(&hierarchy, &group).unwrap();
                    let residual = Residual::decode(&hierarchy, frames.len(), &bytes, usize::MAX).unwrap();
                    let mut decoded = of_cages.clone();
                    residual.add(0, &mut decoded);
                    let found = largest(&captured, &decoded);
                    assert!(found <= bound, "{name} {bound} {ratio}: {found}");
                    // Any frame decodes without the others.
                    let mut one = vec![vec![0.0f32; 3 * points]];
                    residual.add(frames.len() - 1, &mut one);
                    let near = one[0].iter().zip(&decoded[frames.len() - 1]).all(|(a, b)| (a - b).abs() < 1e-4);
                    assert!(near, "{name}");
                }
            }
        }
    }

    #[test]
    fn the_bound_holds_far_from_the_origin() {
        let hierarchy = Hierarchy::new(&mesh(8), 64);
        let mut random = fastrand::Rng::with_seed(5);
        let frames: Vec<Vec<f64>> =
            (0..6).map(|_| (0..192).map(|_| f64::from((1_000.0 + random.f64()) as f32)).collect()).collect();
        let captured: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let of_cages = vec![vec![1_000.5f32; 192]; 6];
        // Three units in the last place.
        let bound = 3.0 * 1_000.0 * f64::from(f32::EPSILON);
        let most_numbers = usize::MAX;
        let group =
            ResidualGroup { captured: &captured, of_cages: &of_cages, step: 0.3, bound: Some(bound), most_numbers };
        let bytes = encode_residual(&hierarchy, &group).unwrap();
        let mut decoded = of_cages.clone();
        Residual::decode(&hierarchy, 6, &bytes, usize::MAX).unwrap().add(0, &mut decoded);
        assert!(largest(&captured, &decoded) <= bound);
        // Below one, none can be met.
        assert!(encode_residual(&hierarchy, &ResidualGroup { bound: Some(0.2 * bound), ..group }).is_none());
    }

    #[test]
    fn damage_is_an_error_or_a_residual_of_this_model() {
        let hierarchy = Hierarchy::new(&mesh(8), 64);
        let frames: Vec<Vec<f64>> =
            (0..6).map(|t| (0..192).map(|k| (t as f64 + 0.1 * f64::from(k)).sin()).collect()).collect();
        let captured: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let of_cages = vec![vec![0.0f32; 192]; 6];
        let group = ResidualGroup {
            captured: &captured,
            of_cages: &of_cages,
            step: 0.05,
            bound: Some(0.02),
            most_numbers: usize::MAX,
        };
        let bytes = encode_residual(&hierarchy, &group).unwrap();
        for cut in 0..bytes.len() {
            let _ = Residual::decode(&hierarchy, 6, &bytes[..cut], usize::MAX);
        }
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0xa5;
            let _ = Residual::decode(&hierarchy, 6, &damaged, usize::MAX);
        }
        assert!(Residual::decode(&hierarchy, MOST_FRAMES + 1, &bytes, usize::MAX).is_err());
    }
}
