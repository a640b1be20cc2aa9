//! From a choice of handles to solvers: the regularised map of singular directions, and the regularisation target.

use super::checks::{about_first, check_options};
use super::consistent::Consistent;
use super::error::failed;
use super::nearness::Nearness;
use super::operator::{Decomposition, Directions, padded_to_tiles};
use super::options::drop_zero_weight_regularizer;
use super::target::RegularizationTarget;
use super::translations::{with_unit_row_sums, with_zero_row_sums};
use super::{Analysis, PrepareError, Solver, SolverOptions};
use crate::decode::Decoder;
use crate::handles::Handles;
use crate::regularize::{
    Reference, RegularizationOperator, Regularizer, SpectralMap, Spectrum, WEAK_SINGULAR_VALUE, last_map, spectral_map,
};
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
        let decomposition =
            Decomposition::new(self.found.phi.as_ref(), &self.found.points, &self.basis, &self.spectra, handles)?;
        Ok(HandleSystem::new(self, decomposition))
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
        let operator = self.decomposition.operator(analysis.found.phi.as_ref(), &map.data);
        let operator = padded_to_tiles(with_unit_row_sums(operator, analysis.decoder.positions()));
        let (handles, reads_all) = self.points_read();
        // The baselines and inversions without a term go where the data take them.
        let held = options.regularizer.is_sub_spectral() && !is_unregularized(drop_zero_weight_regularizer(options));
        let nearness = if held { self.nearness().map(Arc::new) } else { None };
        let mut preparation = analysis.found.preparation.clone();
        preparation.condition_handles = self.decomposition.condition;
        preparation.singular_values = self.singular_values();
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
    pub(super) fn scaled_factor(&self) -> Mat<f64> {
        let Decomposition { directions, rank, rows, .. } = &self.decomposition;
        let scale = (self.analysis.found.phi.ncols() as f64 / *rows as f64).sqrt();
        match directions {
            Directions::All { sigma, v } => Mat::from_fn(*rank, v.nrows(), |k, j| scale * sigma[k] * v[(j, k)]),
            Directions::Last(_) => {
                let factor = self.analysis.spectra.normal_factor.as_ref().unwrap_or(&self.analysis.basis.square);
                Mat::from_fn(factor.nrows(), factor.ncols(), |i, j| scale * factor[(i, j)])
            }
        }
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
    pub(super) fn parts(
        &self,
        options: SolverOptions,
        matrix: Option<&SparseMatrix>,
    ) -> Result<(SpectralMap, RegularizationTarget, Option<Arc<Consistent>>), PrepareError> {
        let analysis = self.analysis;
        let m = analysis.found.phi.ncols();
        check_options(analysis.found.phi.nrows(), m, options, analysis.memory)?;
        let options = drop_zero_weight_regularizer(options);
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
        let (delta, reference) = (regularizer.delta(matrix, &analysis.cage, m)?, regularizer.reference());
        let map = self.map(&RegularizationOperator { delta, reference }, regularizer, s, lambda)?;
        let target = self.target(&map, reference);
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

    fn map(
        &self,
        regularization_operator: &RegularizationOperator,
        regularizer: Regularizer,
        s: usize,
        lambda: f64,
    ) -> Result<SpectralMap, PrepareError> {
        let found = &self.decomposition;
        let unknowns = self.analysis.found.phi.ncols();
        let squared = if regularizer == Regularizer::Tikhonov { lambda * lambda } else { lambda };
        let weight = squared * found.rows as f64 / unknowns as f64;
        let map = match &found.directions {
            Directions::All { sigma, v } => {
                let spectrum = Spectrum { sigma: &sigma[..found.rank], v: v.as_ref(), term: regularization_operator };
                spectral_map(&spectrum, regularizer, s, weight)
            }
            Directions::Last(last) => {
                let s = if regularizer.is_sub_spectral() { s.max(last.below(WEAK_SINGULAR_VALUE)) } else { 0 };
                last_map(last, regularization_operator, s, weight)
            }
        };
        map.ok_or(failed("regularised solve"))
    }

    /// The regularisation target: a constant for the rest cage, a matrix for the previous frame's cage.
    fn target(&self, map: &SpectralMap, reference: Reference) -> RegularizationTarget {
        let Some(target) = &map.target else { return RegularizationTarget::None };
        let to_cage = self.decomposition.directions.to_cage(target.as_ref());
        let positions = self.analysis.decoder.positions();
        let rest = &self.analysis.found.rest;
        if reference == Reference::RestCage {
            let operator = with_zero_row_sums(to_cage, positions);
            return RegularizationTarget::Constant(linalg::product(
                operator.as_ref(),
                about_first(rest, positions).as_ref(),
            ));
        }
        RegularizationTarget::towards_previous(to_cage, rest, positions)
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
