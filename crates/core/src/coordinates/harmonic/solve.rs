//! Densities of all hat functions: low unknowns of all elements together, high ones in a patch
//! around each vertex, in turn.
//!
//! A hat function's density is smooth away from its star, so that its high unknowns count on a few
//! elements only. Solving for all low unknowns, then for the patch with the residual that is left,
//! then for the low ones again is a multiplicative Schwarz iteration.

use super::basis::functions;
use super::elements::Unknowns;
use super::galerkin::{NearPairs, Operator, RightHandSides};
use super::patch::{self, DAMPING, Equations, Patch, RESIDUAL, damp, zeroed};
use cager_geometry::linalg;
use faer::linalg::{matmul::matmul, triangular_solve};
use faer::prelude::IntoConst;
use faer::{Accum, ColRef, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Iterations at most.
pub(super) const MAX_ITERATIONS: u8 = 6;

/// Densities on one element.
pub(super) struct Part {
    /// Vertices whose hat functions have high unknowns here.
    pub(super) vertices: Vec<u32>,
    /// Those unknowns, by vertex.
    pub(super) high: Vec<f64>,
    /// What the highest degree changes of all unknowns, by vertex; empty where nobody asks.
    pub(super) change: Vec<f64>,
}

/// A matrix in single precision, from the row on that belongs to each column; zeros above.
fn lower_in_single(a: MatRef<'_, f64>, first: impl Fn(usize) -> usize + Sync) -> Mat<f32> {
    let mut out = linalg::zeros::<f32>(a.nrows(), a.ncols());
    out.as_mut().par_col_iter_mut().zip(a.par_col_iter()).enumerate().for_each(|(j, (out, a))| {
        let first = first(j);
        faer::zip!(out.subrows_mut(first, a.nrows() - first), a.subrows(first, a.nrows() - first))
            .for_each(|faer::unzip!(out, a)| *out = *a as f32);
    });
    out
}

/// High unknowns of one element, for the vertices whose patches it belongs to.
pub(super) struct High {
    /// Ascending.
    pub(super) vertices: Vec<u32>,
    /// Unknowns × vertices.
    pub(super) values: Mat<f64>,
}

impl High {
    /// Nothing yet.
    fn zero(unknowns: &Unknowns, element: usize, vertices: Vec<u32>) -> Self {
        Self { values: Mat::zeros(unknowns.high(element).len(), vertices.len()), vertices }
    }
}

/// What solving decided: solving again by the same record gives the same bits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SolveRecord {
    /// Which of [`DAMPING`] the matrix of the low unknowns took, and that of each vertex's patch.
    pub(super) damping: u8,
    pub(super) patch_damping: Vec<u8>,
    /// Iterations that it took.
    pub(super) iterations: u8,
    /// Elements of each vertex's patch, ascending.
    pub(super) patches: Vec<Vec<u32>>,
}

/// Densities of all hat functions, and how they were found.
pub(super) struct Solved {
    /// Low unknowns, each times vertices.
    pub(super) low: Mat<f64>,
    pub(super) parts: Vec<Part>,
    pub(super) record: SolveRecord,
    /// The largest residual of all equations, damped ones and unknowns left out included, as a
    /// value on the boundary: about as much as a coordinate can be off. Zero if not measured.
    pub(super) residual: f64,
}

/// Solves for all densities, by this record if any, and `measures` what that leaves; `None` where
/// the equations are not definite.
pub(super) fn solve(
    operator: Operator,
    b: &RightHandSides,
    unknowns: &Unknowns,
    faces: &[[u32; 3]],
    given: Option<&SolveRecord>,
    measures: bool,
) -> Option<Solved> {
    // The factor replaces the matrix, of which the patches need the lower triangle.
    let far = lower_in_single(operator.low.as_ref(), |j| j - j % unknowns.low);
    let low_system = LowSystem::new(operator.low, &far, given.map(|record| record.damping))?;
    let equations = Equations { near: &operator.near, far: &far, b, unknowns };
    let mut low = low_system.solve(b.low.clone());
    let candidates = if given.is_none() || measures { candidates(&operator.near, unknowns, faces) } else { Vec::new() };
    let (mut patches, mut high) = match given {
        Some(record) => patches(unknowns, &record.patches),
        None => patches(unknowns, &equations.choose_patches(low.as_ref(), &candidates)),
    };
    let vertices: Vec<Vec<u32>> = high.iter().map(|high| high.vertices.clone()).collect();
    for (k, patch) in patches.iter_mut().enumerate() {
        patch.damping = given.map(|record| record.patch_damping[k]);
    }
    let mut changes = Vec::new();
    let mut iterations = 0;
    while iterations < given.map_or(MAX_ITERATIONS, |record| record.iterations) {
        let residuals = equations.residuals(low.as_ref(), &high, &vertices);
        if given.is_none() && iterations > 0 && largest(unknowns, &residuals) < RESIDUAL {
            break;
        }
        let found: Option<Vec<patch::Step>> = patches
            .par_iter()
            .map_init(Vec::new, |memory, patch| patch::solve(&equations, patch, &residuals, memory))
            .collect();
        let found = found?;
        add_steps(&mut high, &patches, &found);
        for (patch, step) in patches.iter_mut().zip(&found) {
            patch.damping = Some(step.damping);
        }
        if iterations == 0 && given.is_none() {
            changes = found.into_iter().map(|step| step.change).collect();
        }
        low = low_system.solve(equations.low_sides(&high));
        iterations += 1;
    }
    let damping = DAMPING[usize::from(low_system.damping)];
    let residual = if measures { equations.largest_residual(low.as_ref(), &high, &candidates, damping) } else { 0.0 };
    let record = SolveRecord {
        damping: low_system.damping,
        patch_damping: patches.iter().map(|patch| patch.damping.unwrap_or_default()).collect(),
        iterations,
        patches: patches.iter().map(|patch| patch.places.iter().map(|place| place.0).collect()).collect(),
    };
    Some(Solved { low, parts: parts(unknowns, high, &patches, &changes), record, residual })
}

/// The equations of the low unknowns, factored.
struct LowSystem {
    /// Lower Cholesky factor.
    factor: Mat<f64>,
    /// Which of [`DAMPING`] it took.
    damping: u8,
}

impl LowSystem {
    /// Factors the lower triangle of a matrix; `far` is the same in single precision.
    fn new(mut matrix: Mat<f64>, far: &Mat<f32>, given: Option<u8>) -> Option<Self> {
        let definite = |fraction: f64| {
            if fraction > 0.0 {
                restore(matrix.as_mut(), far);
                damp(matrix.as_mut(), fraction);
            }
            patch::factor(matrix.as_mut(), Par::rayon(0), given.is_none())
        };
        let damping = patch::least_damping(given, definite)?;
        Some(Self { factor: matrix, damping })
    }

    fn solve(&self, mut b: Mat<f64>) -> Mat<f64> {
        let par = Par::rayon(0);
        triangular_solve::solve_lower_triangular_in_place(self.factor.as_ref(), b.as_mut(), par);
        triangular_solve::solve_upper_triangular_in_place(self.factor.transpose(), b.as_mut(), par);
        b
    }
}

/// Undoes a factorisation in place.
fn restore(mut matrix: MatMut<'_, f64>, from: &Mat<f32>) {
    matrix.as_mut().par_col_iter_mut().zip(from.par_col_iter()).for_each(|(to, from)| {
        faer::zip!(to, from).for_each(|faer::unzip!(to, from)| *to = f64::from(*from));
    });
}

/// For every element the vertices with a star that is near it.
fn candidates(near: &NearPairs, unknowns: &Unknowns, faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let of = |e: usize| {
        let others = near.of(e).map(|(other, _)| unknowns.elements[other].face as usize);
        let mut vertices: Vec<u32> = others.flat_map(|face| faces[face]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices
    };
    (0..unknowns.elements.len()).into_par_iter().map(of).collect()
}

/// Each vertex's patch of these elements, and each element's high unknowns for its vertices, zero.
fn patches(unknowns: &Unknowns, elements: &[Vec<u32>]) -> (Vec<Patch>, Vec<High>) {
    let mut vertices: Vec<Vec<u32>> = vec![Vec::new(); unknowns.elements.len()];
    let mut patches = Vec::with_capacity(elements.len());
    for (v, elements) in elements.iter().enumerate() {
        let place = |&e: &u32| {
            vertices[e as usize].push(v as u32);
            (e, vertices[e as usize].len() as u32 - 1)
        };
        patches.push(Patch { places: elements.iter().map(place).collect(), damping: None });
    }
    let high = vertices.into_iter().enumerate().map(|(e, vertices)| High::zero(unknowns, e, vertices)).collect();
    (patches, high)
}

fn add_steps(high: &mut [High], patches: &[Patch], steps: &[patch::Step]) {
    for (patch, step) in patches.iter().zip(steps) {
        let mut values = step.high.iter();
        for &(e, column) in &patch.places {
            let to = high[e as usize].values.col_mut(column as usize);
            to.iter_mut().zip(&mut values).for_each(|(to, by)| *to += by);
        }
    }
}

/// The high unknowns, and what the highest degree changes in each patch, by element.
fn parts(unknowns: &Unknowns, high: Vec<High>, patches: &[Patch], changes: &[Vec<f64>]) -> Vec<Part> {
    let part = |(e, high): (usize, High)| {
        let values = high.values.col_iter().flat_map(|column| column.iter().copied()).collect();
        let asked = if changes.is_empty() { 0 } else { high.vertices.len() };
        let change = vec![0.0; asked * functions(unknowns.elements[e].degree)];
        Part { high: values, vertices: high.vertices, change }
    };
    let mut parts: Vec<Part> = high.into_iter().enumerate().map(part).collect();
    for (patch, change) in patches.iter().zip(changes) {
        let mut rest = change.as_slice();
        for &(e, column) in &patch.places {
            let all = functions(unknowns.elements[e as usize].degree);
            let (mine, others) = rest.split_at(all);
            parts[e as usize].change[column as usize * all..][..all].copy_from_slice(mine);
            rest = others;
        }
    }
    parts
}

/// The largest residual, as a value on the boundary.
fn largest(unknowns: &Unknowns, residuals: &[Mat<f64>]) -> f64 {
    let of = |(e, r): (usize, &Mat<f64>)| {
        r.col_iter().map(|c| c.norm_l2()).fold(0.0, f64::max) / unknowns.elements[e].triangle.area
    };
    residuals.iter().enumerate().map(of).fold(0.0, f64::max)
}

impl Equations<'_> {
    /// The elements of each vertex's patch, by what the low unknowns alone leave.
    fn choose_patches(&self, low: MatRef<'_, f64>, candidates: &[Vec<u32>]) -> Vec<Vec<u32>> {
        let nothing = |e: usize| High::zero(self.unknowns, e, Vec::new());
        let high: Vec<High> = (0..candidates.len()).map(nothing).collect();
        patch::choose(self.unknowns, candidates, &self.residuals(low, &high, candidates), low.ncols())
    }

    /// See [`Solved::residual`]; the low unknowns' diagonals were larger by the fraction `damping`.
    fn largest_residual(&self, low: MatRef<'_, f64>, high: &[High], candidates: &[Vec<u32>], damping: f64) -> f64 {
        let l = self.unknowns.low;
        let residuals = self.residuals(low, high, candidates);
        let of = |(e, residual): (usize, &Mat<f64>)| {
            let inflated = |c: usize, k: usize| {
                damping * f64::from(self.far[(e * l + k, e * l + k)]) * low[(e * l + k, candidates[e][c] as usize)]
            };
            let squared = |(c, residual): (usize, ColRef<'_, f64>)| {
                residual.squared_norm_l2() + (0..l).map(|k| inflated(c, k).powi(2)).sum::<f64>()
            };
            let largest = residual.col_iter().enumerate().map(squared).fold(0.0, f64::max);
            largest.sqrt() / self.unknowns.elements[e].triangle.area
        };
        residuals.iter().enumerate().map(of).fold(0.0, f64::max)
    }

    /// What the equations of each element's high unknowns leave: those × the vertices asked for.
    fn residuals(&self, low: MatRef<'_, f64>, high: &[High], vertices: &[Vec<u32>]) -> Vec<Mat<f64>> {
        let (unknowns, b) = (self.unknowns, self.b);
        let of = |memory: &mut Vec<f64>, e: usize| {
            let (mine, vertices) = (unknowns.high(e), &vertices[e]);
            let mut r = Mat::from_fn(mine.len(), vertices.len(), |k, c| b.high[(mine.start + k, vertices[c] as usize)]);
            for (other, entries) in self.near.of(e) {
                let x = self.density(memory, low, &high[other], other, vertices);
                matmul(r.as_mut(), Accum::Add, entries.subrows(unknowns.low, mine.len()), x, -1.0, Par::Seq);
            }
            r
        };
        (0..unknowns.elements.len()).into_par_iter().map_init(Vec::new, of).collect()
    }

    /// All unknowns of one element × some vertices.
    fn density<'m>(
        &self,
        memory: &'m mut Vec<f64>,
        low: MatRef<'_, f64>,
        high: &High,
        element: usize,
        vertices: &[u32],
    ) -> MatRef<'m, f64> {
        let l = self.unknowns.low;
        let mut x = zeroed(memory, functions(self.unknowns.elements[element].degree), vertices.len());
        let mut at = 0;
        for (&v, mut x) in vertices.iter().zip(x.as_mut().col_iter_mut()) {
            for k in 0..l {
                x[k] = low[(element * l + k, v as usize)];
            }
            while high.vertices.get(at).is_some_and(|&other| other < v) {
                at += 1;
            }
            if high.vertices.get(at) == Some(&v) {
                x.subrows_mut(l, high.values.nrows()).copy_from(high.values.col(at));
            }
        }
        x.into_const()
    }

    /// Right-hand sides of the low unknowns, less what these high unknowns do there.
    fn low_sides(&self, high: &[High]) -> Mat<f64> {
        let (l, mut sides) = (self.unknowns.low, self.b.low.clone());
        sides.as_mut().par_row_chunks_mut(l).enumerate().for_each(|(e, mut rows)| {
            for (other, entries) in self.near.of(e) {
                let theirs = &high[other];
                let mut product = Mat::<f64>::zeros(l, theirs.vertices.len());
                let entries = entries.subrows(0, l).subcols(l, theirs.values.nrows());
                matmul(product.as_mut(), Accum::Replace, entries, theirs.values.as_ref(), 1.0, Par::Seq);
                for (product, &v) in product.col_iter().zip(&theirs.vertices) {
                    rows.as_mut().col_mut(v as usize).iter_mut().zip(product.iter()).for_each(|(to, by)| *to -= by);
                }
            }
        });
        sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_that_the_recorded_damping_leaves_indefinite_takes_more() {
        // As one that is hardly definite may be where its entries round otherwise.
        let matrix = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 1.0 + 1e-5 });
        let factored = |given| {
            LowSystem::new(matrix.clone(), &linalg::to_single(matrix.as_ref(), 2), given).map(|low| low.damping)
        };
        assert_eq!(factored(None), Some(1));
        // Definite, but by no more than rounding may take away.
        let hardly = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 1.0 - 2e-7 });
        let single = linalg::to_single(hardly.as_ref(), 2);
        let damping = |given| LowSystem::new(hardly.clone(), &single, given).map(|low| low.damping);
        assert_eq!([None, Some(0)].map(damping), [Some(1), Some(0)]);
        assert_eq!([0, 1, 3].map(|given| factored(Some(given))), [Some(1), Some(1), Some(3)]);
        let hopeless = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 2.0 });
        assert!(LowSystem::new(hopeless.clone(), &linalg::to_single(hopeless.as_ref(), 2), Some(2)).is_none());
    }
}
