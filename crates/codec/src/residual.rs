//! What the cage cannot say: the difference of a group's positions to those of its cages.
//!
//! `R ≈ E A` as for cages ([`crate::trajectories`]), A in whole steps ([`Components`]); then single
//! vertices are corrected, so that with a bound none is farther from where it was captured.

use crate::components::{Component, Components, PARTS, pieces};
use crate::corrections::Corrections;
use crate::entropy::{Coder, Decoder, Encoder, Integers, MAX_SIZE, Models};
use crate::error::{Error, Result, take};
use crate::hierarchy::Hierarchy;
use crate::histograms::Histograms;
use crate::trajectories::{Trajectories, fit};
use crate::{MAX_FRAMES, MAX_POSITIONS, trajectories};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rayon::prelude::*;

/// Bytes of the step, the number of components, the step of corrections and bytes of components.
const HEAD: usize = 22;
/// Added to the number of components of vertices in two parts; the bytes of the second follow.
const PARTED: u16 = 1 << 15;
/// Fewest numbers in two parts: of fewer, models of their own take more than is gained.
const PARTED_NUMBERS: usize = 1 << 18;
/// Sums and corrections beyond this have no positions in single precision.
const LARGEST: f64 = 1e38;
/// Largest step of corrections, which are up to 2³¹ of them.
const LARGEST_CORRECTION: f64 = LARGEST / (1u64 << 31) as f64;
/// Points that one task adds up.
const BLOCK: usize = 2048;

/// A group to encode: of each frame the captured points and those of its cage, points × 3.
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

/// Encodes the residual of a group; returns the bytes and the decoded residual. `None` where
/// numbers are not finite, or too far apart to be counted in these steps.
///
/// # Panics
/// Where frames have another number of points, or there are too many of them.
pub fn encode_residual(hierarchy: &Hierarchy, group: &ResidualGroup<'_>) -> Option<(Vec<u8>, Residual)> {
    let Contents { is_parted, coders, decoded, .. } = Contents::<Integers>::new(hierarchy, group)?;
    let count = decoded.values.ncols();
    let [coarse, fine] = coders.map(Encoder::into_bytes);
    let mut bytes = group.step.to_le_bytes().to_vec();
    bytes.extend((count as u16 | if is_parted { PARTED } else { 0 }).to_le_bytes());
    bytes.extend(decoded.corrections.step().to_le_bytes());
    bytes.extend((coarse.len() as u32).to_le_bytes());
    if is_parted {
        bytes.extend((fine.len() as u32).to_le_bytes());
    }
    bytes.extend(coarse);
    bytes.extend(fine);
    bytes.extend(decoded.corrections.encode());
    Some((bytes, decoded))
}

/// As [`encode_residual`], but only about how many bytes, in less time.
///
/// # Panics
/// As there.
pub fn estimate_residual(hierarchy: &Hierarchy, group: &ResidualGroup<'_>) -> Option<(f64, Residual)> {
    let Contents { coders: [coder, _], components, decoded, .. } = Contents::<Histograms>::new(hierarchy, group)?;
    let bits: f64 = components.models().map(Histograms::bits).sum();
    Some(((HEAD + coder.into_bytes().len() + decoded.corrections.encode().len()) as f64 + bits / 8.0, decoded))
}

/// A residual, coded or estimated.
struct Contents<'a, M> {
    /// Whether the vertices are in two parts.
    is_parted: bool,
    /// Trajectories, and what models of type M write.
    coders: [Encoder; 2],
    components: Components<'a, M>,
    decoded: Residual,
}

impl<'a, M: Models> Contents<'a, M> {
    fn new(hierarchy: &'a Hierarchy, group: &ResidualGroup<'_>) -> Option<Self> {
        let (points, frames) = (hierarchy.points(), group.captured.len());
        assert!(frames == group.of_cages.len() && frames <= MAX_FRAMES && points * frames <= MAX_POSITIONS);
        assert!(group.captured.iter().all(|frame| frame.len() == 3 * points));
        let mut motion = Mat::<f64>::zeros(3 * points, frames);
        motion.par_col_iter_mut().enumerate().for_each(|(t, column)| {
            let pairs = group.captured[t].iter().zip(&group.of_cages[t]);
            column.iter_mut().zip(pairs).for_each(|(x, (&captured, &of_cage))| *x = captured - f64::from(of_cage));
        });
        let gram = trajectories::gram(motion.as_ref());
        // More than three for each point say nothing, and are refused when they are read.
        let most = frames.min(3 * points).min(group.most_numbers / (3 * points).max(1));
        let chosen = Trajectories::choose(gram.as_ref(), 3 * points, group.step, most)?;
        let count = chosen.count();
        let values = fit(chosen.values().as_ref(), motion.as_ref())?;
        drop(motion);
        let per_unit = PARTS as f64 / group.step;
        let most = f64::from(MAX_SIZE) / per_unit;
        let component_of = |k: usize| {
            let parts = |x: f64| (x.abs() < most).then_some((per_unit * x + 0.5f64.copysign(x)) as i64);
            let (vertices, _) = values.col_as_slice(k).as_chunks::<3>();
            let target = hierarchy.order().iter().map(|&v| vertices[v as usize]);
            let target = target.map(|[x, y, z]| Some([parts(x)?, parts(y)?, parts(z)?]));
            let target: Vec<[i64; 3]> = target.collect::<Option<_>>()?;
            Some(Component::near(hierarchy, target))
        };
        let is_parted = 3 * points * count >= PARTED_NUMBERS;
        let mut coders: [Encoder; 2] = Default::default();
        let (components, mut decoded) =
            Residual::code(&mut coders, hierarchy, (&chosen, frames, count), is_parted, group.step, component_of)?;
        decoded.corrections = match group.bound {
            None => Corrections::none(frames, 0.0),
            Some(bound) => {
                let mut positions: Vec<Vec<f32>> = group.of_cages.to_vec();
                decoded.add(0, &mut positions);
                Corrections::find(group.captured, &positions, bound - decoded.rounding())?
            }
        };
        Some(Self { is_parted, coders, components, decoded })
    }
}

/// What is added to the positions of a group's cages.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    trajectories: Mat<f32>,
    /// Values × components.
    values: Mat<f32>,
    corrections: Corrections,
}

impl Residual {
    /// Codes so many trajectories of so many frames, and one component after another.
    fn code<'a, M: Models, C: Coder + Send>(
        coders: &mut [C; 2],
        hierarchy: &'a Hierarchy,
        (trajectories, frames, count): (&Trajectories, usize, usize),
        is_parted: bool,
        step: f64,
        component: impl Fn(usize) -> Option<Component> + Send + Sync,
    ) -> Option<(Components<'a, M>, Self)> {
        let e = trajectories.code(&mut coders[0], frames, count).values();
        let mut residual = Self {
            trajectories: Mat::from_fn(frames, count, |t, k| e[(t, k)] as f32),
            values: Mat::zeros(3 * hierarchy.points(), count),
            corrections: Corrections::default(),
        };
        // While some components are coded, what does not depend on them is found for the next.
        let mut pieces = pieces(hierarchy.points(), count);
        let next = || pieces.next().unwrap_or(0..0).into_par_iter().map(&component).collect();
        let mut components = Components::<M>::new(hierarchy, is_parted);
        let mut done = 0..;
        components.code(coders, next, |component| {
            done.next().into_iter().for_each(|k| residual.set(k, hierarchy, &component.found, step));
        })?;
        Some((components, residual))
    }

    /// Takes the numbers of a component, in parts of a step, in the order of the hierarchy.
    fn set(&mut self, component: usize, hierarchy: &Hierarchy, parts: &[[i64; 3]], step: f64) {
        let unit = step / PARTS as f64;
        let (vertices, _) = self.values.col_as_slice_mut(component).as_chunks_mut::<3>();
        for (&vertex, parts) in hierarchy.order().iter().zip(parts) {
            vertices[vertex as usize] = parts.map(|parts| (parts as f64 * unit) as f32);
        }
    }

    /// What [`encode_residual`] wrote for so many frames, of at most so many numbers.
    pub fn decode(hierarchy: &Hierarchy, frames: usize, bytes: &[u8], most: usize) -> Result<Self> {
        let points = hierarchy.points();
        if frames > MAX_FRAMES || points.saturating_mul(frames) > MAX_POSITIONS {
            return Err(Error::Damaged("a group has too many positions"));
        }
        const CUT: &str = "a residual is cut";
        let mut rest = bytes;
        let step = f64::from_le_bytes(take(&mut rest, CUT)?);
        let count = u16::from_le_bytes(take(&mut rest, CUT)?);
        let (count, is_parted) = (usize::from(count & !PARTED), count & PARTED != 0);
        let correction = f64::from_le_bytes(take(&mut rest, CUT)?);
        let coarse = u32::from_le_bytes(take(&mut rest, CUT)?) as usize;
        let fine = if is_parted { u32::from_le_bytes(take(&mut rest, CUT)?) as usize } else { 0 };
        let too_many = count > frames.min(3 * points) || (3 * points).saturating_mul(count) > most;
        let impossible = too_many || !step.is_finite() || correction.is_nan() || correction.abs() > LARGEST_CORRECTION;
        let parts =
            rest.split_at_checked(coarse).and_then(|(coarse, rest)| Some((coarse, rest.split_at_checked(fine)?)));
        let Some((coarse, (fine, corrected))) = parts.filter(|_| !impossible) else {
            return Err(Error::Damaged("a residual has impossible counts"));
        };
        let mut coders = [Decoder::new(coarse)?, Decoder::new(fine)?];
        let trajectories = (&Trajectories::default(), frames, count);
        let component = |_| Some(Component::default());
        let coded = Self::code::<Integers, _>(&mut coders, hierarchy, trajectories, is_parted, step, component);
        coders.iter().try_for_each(Decoder::check)?;
        let (_, mut residual) = coded.ok_or(Error::Damaged("a residual is damaged"))?;
        // Written so that NaN is an error.
        if residual.largest_sum().is_nan() || residual.largest_sum() > LARGEST {
            return Err(Error::Damaged("a residual is too large for numbers of single precision"));
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

    /// How far single precision may differ: two units in the last place of the largest sum.
    fn rounding(&self) -> f64 {
        2.0 * f64::from(f32::EPSILON) * self.largest_sum()
    }

    /// The largest sum of sizes, or more.
    fn largest_sum(&self) -> f64 {
        let largest = |of: &Mat<f32>, k: usize| f64::from(of.col(k).iter().fold(0.0f32, |most, x| most.max(x.abs())));
        (0..self.values.ncols()).map(|k| largest(&self.trajectories, k) * largest(&self.values, k)).sum()
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

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::mesh::Polygons;

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
                    let (bytes, coded) = encode_residual(&hierarchy, &group).unwrap();
                    let residual = Residual::decode(&hierarchy, frames.len(), &bytes, usize::MAX).unwrap();
                    assert_eq!(residual, coded, "{name}");
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
    fn coarse_and_fine_vertices_come_back_from_two_streams() {
        let hierarchy = Hierarchy::new(&mesh(90), 8_100);
        let mut random = fastrand::Rng::with_seed(8);
        let frames: Vec<Vec<f64>> = (0..12).map(|_| (0..24_300).map(|_| random.f64()).collect()).collect();
        let captured: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let of_cages = vec![vec![0.0f32; 24_300]; frames.len()];
        let (step, bound, most_numbers) = (0.006, Some(0.01), usize::MAX);
        let group = ResidualGroup { captured: &captured, of_cages: &of_cages, step, bound, most_numbers };
        let (bytes, coded) = encode_residual(&hierarchy, &group).unwrap();
        assert_eq!(bytes[9] >> 7, 1, "in two parts");
        let mut decoded = of_cages.clone();
        let residual = Residual::decode(&hierarchy, 12, &bytes, usize::MAX).unwrap();
        assert!(residual == coded);
        residual.add(0, &mut decoded);
        assert!(largest(&captured, &decoded) <= 0.01);
        // Components alone are as near as their steps: few vertices are left to correct.
        assert!(residual.corrected() < 12 * 8_100 / 20, "{}", residual.corrected());
        let about = estimate_residual(&hierarchy, &group).unwrap().0 / bytes.len() as f64;
        assert!((about - 1.0).abs() < 0.05, "{about}");
        for cut in [20, 24, 25, 30, 1_000, bytes.len() / 2, bytes.len() - 8] {
            assert!(Residual::decode(&hierarchy, 12, &bytes[..cut], usize::MAX).is_err(), "{cut}");
        }
        // Nothing but a head without the length of the second part.
        let mut head = bytes[..HEAD].to_vec();
        head[8..10].copy_from_slice(&PARTED.to_le_bytes());
        head[18..22].fill(0);
        assert!(Residual::decode(&hierarchy, 12, &head, usize::MAX).is_err());
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
        let (bytes, _) = encode_residual(&hierarchy, &group).unwrap();
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
        let (bytes, _) = encode_residual(&hierarchy, &group).unwrap();
        let mut refused = 0;
        let mut check = |bytes: &[u8]| match Residual::decode(&hierarchy, 6, bytes, usize::MAX) {
            Err(_) => refused += 1,
            Ok(residual) => {
                let mut positions = of_cages.clone();
                residual.add(0, &mut positions);
                assert!(residual.corrected() <= 6 * 64);
                assert!(positions.iter().flatten().all(|x| x.is_finite()), "a position is not finite");
            }
        };
        for cut in 0..bytes.len() {
            check(&bytes[..cut]);
        }
        for at in 0..bytes.len() {
            for flip in [0xa5, 0x80, 0x7f] {
                let mut damaged = bytes.clone();
                damaged[at] ^= flip;
                check(&damaged);
            }
        }
        assert!(refused > 20, "{refused}");
        assert!(Residual::decode(&hierarchy, MAX_FRAMES + 1, &bytes, usize::MAX).is_err());
    }
}
