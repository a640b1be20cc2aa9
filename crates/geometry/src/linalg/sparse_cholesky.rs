//! Sparse symmetric systems: faer's Cholesky factors with approximate minimum degree ordering.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{CholeskySymbolicParams, LltRef, SymbolicCholesky};
use faer::sparse::linalg::cholesky::{SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, Mat, Par, Side};

/// Where the entries of symmetric matrices are: what the factors of all of them share.
pub struct SparsePattern {
    pattern: SymbolicSparseColMat<u32>,
    /// For each entry that is given, where its value is added up.
    slots: Vec<u32>,
    symbolic: Arc<SymbolicCholesky<u32>>,
}

/// The Cholesky factor of a sparse symmetric positive definite matrix.
pub struct SparseCholesky {
    symbolic: Arc<SymbolicCholesky<u32>>,
    values: Vec<f64>,
}

impl SparsePattern {
    /// Places (row, column) of an n × n matrix in either triangle; a place may come more than once.
    /// `None` where one lies outside, or there is not enough memory.
    pub fn new(n: usize, places: &[(u32, u32)]) -> Option<Self> {
        let lower = |&(i, j): &(u32, u32)| (i.min(j), i.max(j));
        if !places.iter().all(|&(i, j)| (i as usize) < n && (j as usize) < n) {
            return None;
        }
        let mut order: Vec<u32> = (0..places.len() as u32).collect();
        order.sort_by_key(|&k| lower(&places[k as usize]));
        let (mut starts, mut rows) = (vec![0_u32; n + 1], Vec::new());
        let mut slots = vec![0; places.len()];
        let mut last = None;
        for k in order {
            let place = lower(&places[k as usize]);
            if last != Some(place) {
                rows.push(place.1);
                starts[place.0 as usize + 1] += 1;
                last = Some(place);
            }
            slots[k as usize] = rows.len() as u32 - 1;
        }
        (0..n).for_each(|j| starts[j + 1] += starts[j]);
        let pattern = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        let params = CholeskySymbolicParams::default();
        let symbolic =
            factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, SymmetricOrdering::Amd, params).ok()?;
        Some(Self { pattern, slots, symbolic: Arc::new(symbolic) })
    }

    /// The factor of the matrix with these values at the given places, added up where one comes
    /// twice. `None` where the matrix is not definite.
    ///
    /// # Panics
    /// With another number of values than of places.
    pub fn factor(&self, values: &[f64]) -> Option<SparseCholesky> {
        assert_eq!(values.len(), self.slots.len(), "a value for each place");
        let mut summed = vec![0.0; self.pattern.row_idx().len()];
        values.iter().zip(&self.slots).for_each(|(value, &slot)| summed[slot as usize] += value);
        if !summed.iter().all(|x| x.is_finite()) {
            return None;
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &summed);
        let mut factor = vec![0.0; self.symbolic.len_val()];
        let scratch = self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        let none = LltRegularization::default();
        self.symbolic
            .factorize_numeric_llt(&mut factor, matrix, Side::Lower, none, Par::Seq, stack, Default::default())
            .ok()?;
        factor
            .iter()
            .all(|x: &f64| x.is_finite())
            .then(|| SparseCholesky { symbolic: self.symbolic.clone(), values: factor })
    }
}

impl SparseCholesky {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Solves `A X = B` in place.
    ///
    /// # Panics
    /// Where `B` has another number of rows than the matrix.
    pub fn solve(&self, x: &mut Mat<f64>) {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(x.ncols(), Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        let factor = LltRef::new(&self.symbolic, &self.values);
        factor.solve_in_place_with_conj(Conj::No, x.as_mut(), Par::Seq, MemStack::new(&mut memory));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_with_places_in_any_order_is_solved() {
        let n = 40_u32;
        let at = |i: u32, j: u32| i * n + j;
        let mut entries: Vec<(u32, u32, f64)> = (0..n * n).map(|k| (k, k, 1e-3)).collect();
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            for (a, b) in [(at(i, j), at((i + 1) % n, j)), (at(i, j), at(i, (j + 1) % n))] {
                entries.extend([(a, a, 1.0), (b, b, 1.0), (a, b, -1.0)]);
            }
        }
        fastrand::Rng::with_seed(1).shuffle(&mut entries);
        let places: Vec<(u32, u32)> = entries.iter().map(|e| (e.0, e.1)).collect();
        let values: Vec<f64> = entries.iter().map(|e| e.2).collect();
        let factor = SparsePattern::new((n * n) as usize, &places).unwrap().factor(&values).unwrap();
        let wanted = Mat::from_fn((n * n) as usize, 2, |i, k| (i as f64).sin() + k as f64);
        let mut x = Mat::zeros((n * n) as usize, 2);
        for &(i, j, value) in &entries {
            let (i, j) = (i as usize, j as usize);
            for k in 0..2 {
                x[(i, k)] += value * wanted[(j, k)];
                if i != j {
                    x[(j, k)] += value * wanted[(i, k)];
                }
            }
        }
        factor.solve(&mut x);
        assert!((&x - &wanted).norm_max() < 1e-9, "{}", (&x - &wanted).norm_max());
    }

    #[test]
    fn places_outside_and_matrices_that_are_not_definite_have_no_factor() {
        assert!(SparsePattern::new(2, &[(0, 2)]).is_none());
        let pattern = SparsePattern::new(2, &[(0, 0), (1, 0), (1, 1)]).unwrap();
        assert!(pattern.factor(&[1.0, 2.0, 1.0]).is_none() && pattern.factor(&[1.0, f64::NAN, 1.0]).is_none());
        assert!(pattern.factor(&[1.0, 0.5, 1.0]).is_some());
    }
}
