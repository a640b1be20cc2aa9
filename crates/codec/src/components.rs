//! A residual's components in whole steps, predicted from coarse to fine on the mesh
//! ([`Hierarchy`]), each in the context of the sizes around it. Vertices may be in two parts,
//! coarse and fine, with a range coder each, so that two threads code them.

use crate::entropy::{BinaryModel, Coder, MAX_CONTEXT_SIZE, MAX_RESIDUAL_SIZE, MAX_SIZE, Models, SIZES, size_class};
use crate::hierarchy::Hierarchy;
use std::ops::Range;
use std::sync::LazyLock;

/// Parts of a step in which predictions are counted.
pub(crate) const PARTS: i64 = 16;
/// Added before rounding down: small numbers cost more than they are worth.
const ROUND_UP: i64 = 5;
/// Components that one part of the vertices is ahead of the other, at most.
const AT_A_TIME: usize = 4;
/// Points that these have together, unless one component has more.
const POINTS_AT_A_TIME: usize = 1 << 17;

/// The numbers of one component, in the order of the hierarchy's vertices.
#[derive(Default)]
pub(crate) struct Component {
    /// What its numbers are to be near, in parts of a step; empty where they are read.
    target: Vec<[i64; 3]>,
    /// Whether they are coded as differences to their predictions.
    is_predicted: bool,
    /// Its numbers, in parts of a step, as far as they are coded.
    pub(crate) found: Vec<[i64; 3]>,
    /// Sizes of what was coded for them.
    sizes: Vec<[u32; 3]>,
}

impl Component {
    /// Of numbers near these, in parts of a step.
    pub(crate) fn near(hierarchy: &Hierarchy, target: Vec<[i64; 3]>) -> Self {
        Self { is_predicted: is_predictable(hierarchy, &target), target, ..Self::default() }
    }
}

/// Some of the vertices, with models of their own.
struct Part<M> {
    places: Range<usize>,
    /// Of numbers as they are, and of differences to predictions.
    models: [M; 2],
    /// Sizes of the numbers of the component before.
    before: Vec<[u32; 3]>,
}

impl<M: Models> Part<M> {
    fn new(places: Range<usize>) -> Self {
        let models = [M::new(3 * SIZES), M::new(3 * SIZES)];
        Self { models, before: vec![[0; 3]; places.len()], places }
    }

    fn code(&mut self, hierarchy: &Hierarchy, coder: &mut impl Coder, component: &mut Component) {
        let Component { target, is_predicted, found, sizes } = component;
        let models = &mut self.models[usize::from(*is_predicted)];
        for (place, before) in self.places.clone().zip(&self.before) {
            let parents = hierarchy.parents(place);
            let mut around = [0i64; 3];
            for &parent in parents {
                let sizes = &sizes[parent as usize];
                (0..3).for_each(|k| around[k] += 16 * i64::from(sizes[k]));
            }
            let around = divided(around, parents.len());
            let expected = if *is_predicted { mean(found, parents) } else { [0; 3] };
            let target = target.get(place);
            let mut beside = 0;
            for k in 0..3 {
                let around = around[k].min(MAX_CONTEXT_SIZE.into()) as u32;
                let context = size_class(around + 6 * before[k] + beside);
                let value = target.map_or(0, |target| rounded(target[k] - expected[k]));
                let value = models.code(coder, SIZES * k + context, value);
                found[place][k] = expected[k] + PARTS * i64::from(value);
                let size = value.unsigned_abs().min(MAX_RESIDUAL_SIZE);
                sizes[place][k] = size;
                beside = beside / 2 + 5 * size;
            }
        }
        self.before.copy_from_slice(&sizes[self.places.clone()]);
    }
}

/// Codes component after component.
pub(crate) struct Components<'a, M> {
    hierarchy: &'a Hierarchy,
    flag: BinaryModel,
    parts: [Part<M>; 2],
}

impl<'a, M: Models> Components<'a, M> {
    /// In two parts or in one.
    pub(crate) fn new(hierarchy: &'a Hierarchy, is_parted: bool) -> Self {
        let points = hierarchy.points();
        let middle = if is_parted { points / 2 } else { points };
        Self { hierarchy, flag: BinaryModel::default(), parts: [Part::new(0..middle), Part::new(middle..points)] }
    }

    /// Codes what `next` gives until it gives nothing, with one coder for each part; `done` takes
    /// each coded component. `None` where `next` says so or what is read cannot have been written.
    pub(crate) fn code<C: Coder + Send>(
        &mut self,
        coders: &mut [C; 2],
        mut next: impl FnMut() -> Option<Vec<Component>> + Send,
        mut done: impl FnMut(Component) + Send,
    ) -> Option<()> {
        let (hierarchy, flag, [coarse, fine]) = (self.hierarchy, &mut self.flag, &mut self.parts);
        let mut ahead = next()?;
        let mut behind = Vec::new();
        while !(ahead.is_empty() && behind.is_empty()) {
            let [coarse_coder, fine_coder] = &mut *coders;
            let code_coarse = || {
                for component in &mut ahead {
                    component.is_predicted = coarse_coder.bit(flag, component.is_predicted);
                    component.found = vec![[0; 3]; hierarchy.points()];
                    component.sizes = vec![[0; 3]; hierarchy.points()];
                    coarse.code(hierarchy, coarse_coder, component);
                }
            };
            let code_fine = || {
                for mut component in behind {
                    fine.code(hierarchy, fine_coder, &mut component);
                    done(component);
                }
            };
            let (following, _) = rayon::join(&mut next, || rayon::join(code_coarse, code_fine));
            behind = std::mem::replace(&mut ahead, following?);
            if coders.iter().any(Coder::is_damaged) {
                return None;
            }
        }
        Some(())
    }

    /// What the numbers were coded by.
    pub(crate) fn models(&self) -> impl Iterator<Item = &M> {
        self.parts.iter().flat_map(|part| &part.models)
    }
}

/// So many components in the pieces that [`Components::code`] takes at a time.
pub(crate) fn pieces(points: usize, count: usize) -> impl Iterator<Item = Range<usize>> {
    let some = (POINTS_AT_A_TIME / points.max(1)).clamp(1, AT_A_TIME);
    (0..count).step_by(some).map(move |first| first..count.min(first + some))
}

/// Whether differences to predictions take fewer binary digits, by every fourth number.
fn is_predictable(hierarchy: &Hierarchy, target: &[[i64; 3]]) -> bool {
    static DIGITS: LazyLock<[f64; 256]> =
        LazyLock::new(|| std::array::from_fn(|size| (1.0 + 2.0 * size as f64).log2()));
    let digits: &[f64; 256] = &DIGITS;
    let cost = |value: i32| {
        let size = value.unsigned_abs();
        digits.get(size as usize).copied().unwrap_or_else(|| (1.0 + 2.0 * f64::from(size)).log2())
    };
    let (mut as_is, mut predicted) = (0.0, 0.0);
    for (place, numbers) in target.iter().enumerate().step_by(4) {
        let expected = mean(target, hierarchy.parents(place));
        for k in 0..3 {
            predicted += cost(rounded(numbers[k] - expected[k]));
            as_is += cost(rounded(numbers[k]));
        }
    }
    predicted < as_is
}

/// Rounded to whole steps; less than 11/16 of a step is dropped.
fn rounded(parts: i64) -> i32 {
    let steps = (parts.abs() + ROUND_UP) / PARTS * parts.signum();
    steps.clamp(-i64::from(MAX_SIZE), i64::from(MAX_SIZE)) as i32
}

/// What a vertex is predicted from its parents: their means, rounded down; without parents 0.
fn mean(found: &[[i64; 3]], parents: &[u32]) -> [i64; 3] {
    let mut sums = [0; 3];
    for &parent in parents {
        (0..3).for_each(|k| sums[k] += found[parent as usize][k]);
    }
    divided(sums, parents.len())
}

/// Numbers over a count, rounded down. In floating point, which is faster, and exact below 2²⁸
/// times the count, as encoders have them.
#[inline(always)]
fn divided(numbers: [i64; 3], count: usize) -> [i64; 3] {
    let count = count.max(1) as f64;
    std::array::from_fn(|k| {
        let quotient = numbers[k] as f64 / count;
        let toward_zero = quotient as i64;
        toward_zero - i64::from(toward_zero as f64 > quotient)
    })
}
