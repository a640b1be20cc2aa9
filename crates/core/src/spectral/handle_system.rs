//! From a choice of handles to solvers.

use super::analysis::Analysis;
use super::decomposition::Decomposition;
use super::maxvol::Volume;
use super::terms::{Term, spectral_map};
use crate::batch::padded_to_tiles;
use crate::inversion::{
    Consistent, Handles, Nearness, PrepareError, RegularizationTarget, Solver, SolverOptions, about_first,
    check_options, failed, with_unit_row_sums, with_zero_row_sums,
};
use crate::regularize::{Reference, Regularizer, WEAK_SINGULAR_VALUE};
use cager_geometry::linalg::{self, SparseMatrix};
use faer::Mat;
use std::sync::{Arc, OnceLock};

/// Directions below this fraction of the largest singular value are hardly determined by the points.
const ILL_CONDITIONED: f64 = 1e-2;

/// The linear system of a choice of handles, from which solvers with any regularisation follow.
pub struct HandleSystem<'a> {
    pub(super) analysis: &'a Analysis,
    decomposition: Decomposition,
    /// Scaled Gram matrix of the rows read, for dependent normals, computed on first use.
    gram: OnceLock<Mat<f64>>,
}

impl Analysis {
    /// The linear system of a choice of handles with its decomposition.
    pub fn handle_system(&self, handles: Handles) -> Result<HandleSystem<'_>, PrepareError> {
        let options = SolverOptions { handles, spectrum: 0, ..SolverOptions::PAPER };
        check_options(self.found.phi.nrows(), self.found.phi.ncols(), options, self.memory)?;
        let decomposition = Decomposition::new(self, handles)?;
        Ok(HandleSystem { analysis: self, decomposition, gram: OnceLock::new() })
    }

    /// As [`Self::handle_system`], of the given rows, at least as many as unknowns.
    pub fn handle_system_of(&self, rows: &[u32]) -> Result<HandleSystem<'_>, PrepareError> {
        let phi = self.found.phi.as_ref();
        let decomposition = Decomposition::of_given_rows(phi, rows.to_vec(), phi.ncols())?;
        Ok(HandleSystem { analysis: self, decomposition, gram: OnceLock::new() })
    }

    /// The solver with these options.
    pub fn solver(&self, options: SolverOptions) -> Result<Solver, PrepareError> {
        self.handle_system(options.handles)?.solver(options, None)
    }
}

impl HandleSystem<'_> {
    /// The solver with these options; their handles are checked, but this system's are used. λ is
    /// relative to the mean square error of the points, so that it means the same whichever points
    /// are read: λ · K/m multiplies the regularisation of a sum over K points.
    pub fn solver(&self, options: SolverOptions, matrix: Option<&SparseMatrix>) -> Result<Solver, PrepareError> {
        let Analysis { found, cage, decoder, factor, memory, .. } = self.analysis;
        let read = &self.decomposition;
        let phi = found.phi.as_ref();
        let (n, m) = phi.shape();
        check_options(n, m, options, *memory)?;
        let options = options.without_idle_term();
        let singular_values = read.directions.values();
        // An unregularised start is regularised nevertheless: from an ill-conditioned one,
        // Gauss–Newton steps, which only `start_weight` holds then, end in a worse minimum.
        let (regularizer, spectrum, lambda) = if decoder.dependent_normals().is_some() && is_unregularized(options) {
            let is_ill_conditioned = |x: &&f64| **x < ILL_CONDITIONED * singular_values[0];
            let ill_conditioned = singular_values.iter().filter(is_ill_conditioned).count();
            (Regularizer::Laplacian, ill_conditioned.min(m / 4), 1.0)
        } else {
            (options.regularizer, options.spectrum, options.lambda)
        };
        let delta = regularizer.delta(matrix, cage, m)?;
        let squared = if regularizer == Regularizer::Tikhonov { lambda * lambda } else { lambda };
        let weight = squared * read.rows as f64 / m as f64;
        let term = Term { regularizer, delta, spectrum, weight };
        let map = spectral_map(&read.directions, read.rank, &term).ok_or(failed("regularised solve"))?;

        let positions = decoder.positions();
        let target = match (map.target, regularizer.reference()) {
            (None, _) => RegularizationTarget::None,
            (Some(target), Reference::RestCage) => {
                let rest = about_first(&found.rest, positions);
                let target = with_zero_row_sums(target, positions);
                RegularizationTarget::Constant(linalg::product(target.as_ref(), rest.as_ref()))
            }
            (Some(target), _) => RegularizationTarget::towards_previous(target, &found.rest, positions),
        };
        // Even if all points of a sample are read, they are only part of the model.
        let (handles, reads_all) = match &found.sample {
            Some(sample) if read.reads_all => (sample.clone(), false),
            Some(sample) => (read.handles.iter().map(|&row| sample[row as usize]).collect(), false),
            None => (read.handles.clone(), read.reads_all),
        };
        let mut consistent = None;
        if decoder.dependent_normals().is_some() {
            let rows = (!reads_all).then_some(handles.as_slice());
            let gram = self.gram.get_or_init(|| Consistent::gram_of(decoder, rows)).clone();
            let prepared = Consistent::from_gram(decoder, rows, start_weight(options), gram);
            consistent = Some(Arc::new(prepared.ok_or(failed("preparation of the consistent inversion"))?));
        }
        // The baselines and inversions without a term go where the data take them.
        let mut nearness = None;
        if options.regularizer.is_sub_spectral() && !is_unregularized(options) {
            // F with `FᵀF = AᵀA · m/K`: weights beside it are relative to the mean square error.
            let scale = (m as f64 / read.rows as f64).sqrt();
            let factor = if read.rows == n {
                factor.scaled(scale)
            } else {
                faer::Scale(scale) * linalg::rows_of(phi, &read.handles)
            };
            nearness = Nearness::new(factor, &found.rest, cage, &found.points).map(Arc::new);
        }
        let mut preparation = found.preparation.clone();
        preparation.condition_handles = read.condition;
        preparation.singular_values = singular_values;
        preparation.weak = read.directions.below(WEAK_SINGULAR_VALUE).max(m - read.rank);
        if reads_all {
            preparation.maxvol = Volume::default();
        }
        let operator = with_unit_row_sums(read.operator(phi, map.data.as_ref()), positions);
        Ok(Solver {
            handles,
            reads_all,
            operator: padded_to_tiles(operator),
            target,
            consistent,
            nearness,
            decoder: decoder.clone(),
            diagonal: found.diagonal,
            preparation,
        })
    }
}

/// Whether the options apply no regularisation at all.
fn is_unregularized(options: SolverOptions) -> bool {
    options.regularizer == Regularizer::None || options.regularizer.is_sub_spectral() && options.spectrum == 0
}

/// Weight of the Gauss–Newton steps' regularisation: λ where there is a term, else a small constant.
fn start_weight(options: SolverOptions) -> f64 {
    const WITHOUT_TERM: f64 = 1e-3;
    let has_term = options.regularizer.is_sub_spectral() || options.regularizer == Regularizer::Global;
    if has_term && !is_unregularized(options) { options.lambda } else { WITHOUT_TERM }
}
