//! From a choice of handles to solvers: the regularised map of singular directions, and the regularisation target.

use super::analysis::Analysis;
use super::decomposition::Decomposition;
use super::maxvol::Volume;
use super::terms::{SpectralMap, Term, spectral_map};
use crate::decode::Decoder;
use crate::inversion::{
    Consistent, Handles, Nearness, PrepareError, RegularizationTarget, Solver, SolverOptions, about_first,
    check_options, failed, padded_to_tiles, with_unit_row_sums, with_zero_row_sums,
};
use crate::regularize::{Reference, Regularizer, WEAK_SINGULAR_VALUE};
use cager_geometry::linalg::{self, SparseMatrix};
use faer::Mat;
use std::sync::{Arc, OnceLock};

/// The linear system of a choice of handles of an [`Analysis`] with its decomposition, from which solvers with any regularisation follow at little
/// cost.
pub struct HandleSystem<'a> {
    pub(super) analysis: &'a Analysis,
    pub(super) decomposition: Decomposition,
    /// Scaled Gram matrix of the rows read, for dependent normals; expensive, and therefore computed on first use.
    gram: OnceLock<Mat<f64>>,
}

impl Analysis {
    /// The linear system of a choice of handles with its decomposition, from which solvers with any regularisation follow.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn handle_system(&self, handles: Handles) -> Result<HandleSystem<'_>, PrepareError> {
        let options = SolverOptions { handles, spectrum: 0, ..SolverOptions::PAPER };
        check_options(self.found.phi.nrows(), self.found.phi.ncols(), options, self.memory)?;
        Ok(HandleSystem::new(self, Decomposition::new(self, handles)?))
    }

    /// As [`Self::handle_system`], of the given rows, at least as many as unknowns.
    ///
    /// # Errors
    /// [`PrepareError::NoSolution`] where the rows determine nothing.
    pub fn handle_system_of(&self, rows: &[u32]) -> Result<HandleSystem<'_>, PrepareError> {
        let decomposition =
            Decomposition::of_given_rows(self.found.phi.as_ref(), rows.to_vec(), self.found.phi.ncols())?;
        Ok(HandleSystem::new(self, decomposition))
    }

    /// The solver with these options.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn solver(&self, options: SolverOptions) -> Result<Solver, PrepareError> {
        self.handle_system(options.handles)?.solver(options, None)
    }
}

impl<'a> HandleSystem<'a> {
    pub(super) fn new(analysis: &'a Analysis, decomposition: Decomposition) -> Self {
        Self { analysis, decomposition, gram: OnceLock::new() }
    }

    /// The decoder from cages to positions.
    pub fn decoder(&self) -> &'a Decoder {
        &self.analysis.decoder
    }

    /// Singular values of the matrix that is inverted, descending.
    pub fn singular_values(&self) -> Vec<f64> {
        self.decomposition.directions.values()
    }

    /// The solver with these options; their handles are checked, but this system's are used. The weight λ is relative to the mean square error of the
    /// points in the data term, so that it means the same whichever points are read: λ · K/m multiplies the regularisation of a
    /// sum over K points, for m unknowns. For maximum-volume handles K = m, the paper's own setting. `matrix` is Δ of [`Regularizer::Matrix`].
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn solver(&self, options: SolverOptions, matrix: Option<&SparseMatrix>) -> Result<Solver, PrepareError> {
        let analysis = self.analysis;
        let (map, target, consistent) = self.parts(options, matrix)?;
        let operator = self.decomposition.operator(analysis.found.phi.as_ref(), map.data.as_ref());
        let operator = padded_to_tiles(with_unit_row_sums(operator, analysis.decoder.positions()));
        let (handles, reads_all) = self.points_read();
        // The baselines and inversions without a term go where the data take them.
        let held = options.regularizer.is_sub_spectral() && !is_unregularized(options.without_idle_term());
        let nearness = if held { self.nearness().map(Arc::new) } else { None };
        let mut preparation = analysis.found.preparation.clone();
        preparation.condition_handles = self.decomposition.condition;
        preparation.singular_values = self.singular_values();
        let Decomposition { directions, rank, .. } = &self.decomposition;
        preparation.weak = directions.below(WEAK_SINGULAR_VALUE).max(analysis.found.phi.ncols() - rank);
        if reads_all {
            preparation.maxvol = Volume::default();
        }
        Ok(Solver {
            handles,
            reads_all,
            operator,
            target,
            consistent,
            nearness,
            decoder: analysis.decoder.clone(),
            diagonal: analysis.found.diagonal,
            preparation,
        })
    }

    /// What brings cages back to their frames.
    fn nearness(&self) -> Option<Nearness> {
        let analysis = self.analysis;
        Nearness::new(self.scaled_factor(), &analysis.found.rest, &analysis.cage, &analysis.found.points)
    }

    /// F with `FᵀF = AᵀA · m/K` for the K rows of what is inverted, so that weights beside it are relative to the mean square error.
    fn scaled_factor(&self) -> Mat<f64> {
        let (analysis, read) = (self.analysis, &self.decomposition);
        let phi = analysis.found.phi.as_ref();
        let scale = (phi.ncols() as f64 / read.rows as f64).sqrt();
        if read.rows == phi.nrows() {
            return analysis.factor.scaled(scale);
        }
        faer::Scale(scale) * linalg::rows_of(phi, &read.handles)
    }

    /// Indices of the points read, and whether all points are read instead.
    fn points_read(&self) -> (Vec<u32>, bool) {
        let reads_all = self.decomposition.reads_all;
        match self.analysis.sample() {
            // Even if all points of the sample are read, they are only part of the model.
            Some(sample) if reads_all => (sample.to_vec(), false),
            Some(sample) => (self.decomposition.handles.iter().map(|&row| sample[row as usize]).collect(), false),
            None => (self.decomposition.handles.clone(), reads_all),
        }
    }

    /// The map of singular directions, the regularisation target, and the consistent inversion that follows, if any.
    fn parts(
        &self,
        options: SolverOptions,
        matrix: Option<&SparseMatrix>,
    ) -> Result<(SpectralMap, RegularizationTarget, Option<Arc<Consistent>>), PrepareError> {
        let analysis = self.analysis;
        let m = analysis.found.phi.ncols();
        check_options(analysis.found.phi.nrows(), m, options, analysis.memory)?;
        let options = options.without_idle_term();
        let dependent = analysis.decoder.dependent_normals().is_some();
        // Without regularisation the Gauss–Newton steps are held to their start by the small weight of `start_weight` only; the start itself is
        // regularised nevertheless, since from an ill-conditioned one they end in a worse minimum.
        let unregularized = dependent && is_unregularized(options);
        let (regularizer, s, lambda) = if unregularized {
            let sigma = self.singular_values();
            let ill_conditioned = sigma.iter().filter(|&&x| x < ILL_CONDITIONED * sigma[0]).count();
            (Regularizer::Laplacian, ill_conditioned.min(m / 4), 1.0)
        } else {
            (options.regularizer, options.spectrum, options.lambda)
        };
        let delta = regularizer.delta(matrix, &analysis.cage, m)?;
        let squared = if regularizer == Regularizer::Tikhonov { lambda * lambda } else { lambda };
        let weight = squared * self.decomposition.rows as f64 / m as f64;
        let term = Term { regularizer, delta, spectrum: s, weight };
        let Decomposition { directions, rank, .. } = &self.decomposition;
        let map = spectral_map(directions, *rank, &term).ok_or(failed("regularised solve"))?;
        let target = self.target(&map, regularizer.reference());
        let decoder = &analysis.decoder;
        let consistent = match decoder.dependent_normals() {
            None => None,
            Some(_) => {
                let (handles, reads_all) = self.points_read();
                let rows = (!reads_all).then_some(handles.as_slice());
                let gram = self.gram.get_or_init(|| Consistent::gram_of(decoder, rows)).clone();
                let prepared = Consistent::from_gram(decoder, rows, start_weight(options), gram);
                Some(Arc::new(prepared.ok_or(failed("preparation of the consistent inversion"))?))
            }
        };
        Ok((map, target, consistent))
    }

    /// The regularisation target: a constant for the rest cage, a matrix for the previous frame's cage.
    fn target(&self, map: &SpectralMap, reference: Reference) -> RegularizationTarget {
        let Some(target) = map.target.clone() else { return RegularizationTarget::None };
        let positions = self.analysis.decoder.positions();
        let rest = &self.analysis.found.rest;
        if reference == Reference::RestCage {
            let operator = with_zero_row_sums(target, positions);
            return RegularizationTarget::Constant(linalg::product(
                operator.as_ref(),
                about_first(rest, positions).as_ref(),
            ));
        }
        RegularizationTarget::towards_previous(target, rest, positions)
    }
}

/// Singular values below this fraction of the largest are of directions that the points hardly determine.
const ILL_CONDITIONED: f64 = 1e-2;

/// Whether the options apply no regularisation at all.
fn is_unregularized(options: SolverOptions) -> bool {
    options.regularizer == Regularizer::None || options.regularizer.is_sub_spectral() && options.spectrum == 0
}

/// Weight of the Gauss–Newton steps' regularisation towards the linear start: λ where the options have a term, otherwise a small constant.
fn start_weight(options: SolverOptions) -> f64 {
    const WITHOUT_TERM: f64 = 1e-3;
    let has_term = options.regularizer.is_sub_spectral() || options.regularizer == Regularizer::Global;
    if has_term && !is_unregularized(options) { options.lambda } else { WITHOUT_TERM }
}
