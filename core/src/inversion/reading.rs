//! From a choice of handles to solvers: a regularised map, and what pulls cages towards others.

use super::consistent::Consistent;
use super::operator::{Decomposed, failed, with_whole_tiles};
use super::prepare::check_options;
use super::pull::Pull;
use super::translations::{cages_stay, keep_translations};
use super::{Analysis, PrepareError, Solver, SolverOptions};
use crate::dense;
use crate::mesh::Point;
use crate::regularize::{CageLaplacian, Reference, Regularizer, SpectralMap, Spectrum, Term, TermError, spectral_map};
use faer::Mat;
use std::sync::Arc;
use std::time::Instant;

/// A choice of handles of an [`Analysis`], decomposed: solvers with any regularisation follow at little cost.
pub struct Reading<'a> {
    pub(super) analysis: &'a Analysis,
    pub(super) decomposed: Decomposed,
    /// Time the decomposition took.
    pub(super) seconds: f64,
}

/// A term as numbers.
pub(super) struct Bent {
    pub(super) delta: Mat<f64>,
    pub(super) reference: Reference,
}

impl Reading<'_> {
    /// The solver with these options; the handles among them are not looked at.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn solver(&self, options: SolverOptions) -> Result<Solver, PrepareError> {
        self.solver_with(options, options.regularizer.term().ok_or(TermError::Missing)?)
    }

    /// As [`Self::solver`], with a term of the caller's own, for [`Regularizer::Matrix`]; the other regularizers use it where no
    /// point feels an unknown.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn solver_with(&self, options: SolverOptions, term: &dyn Term) -> Result<Solver, PrepareError> {
        let clock = Instant::now();
        let analysis = self.analysis;
        let m = analysis.phi.ncols();
        check_options(analysis.phi.nrows(), m, options)?;
        let tied = analysis.decoder.tied_normals().is_some();
        // Where steps follow, the points alone decide by way of them: from a calm start, since a wild one leads to a worse minimum.
        let calm = tied && follows_points_alone(options);
        let bent = self.bent(if calm { &CageLaplacian } else { term })?;
        let map = if calm {
            let sigma = &self.decomposed.sigma;
            let wild = sigma.iter().filter(|&&x| x < WILD * sigma[0]).count();
            self.map(&bent, Regularizer::Laplacian, wild.min(m / 4), 1.0)?
        } else {
            self.map(&bent, options.regularizer, options.spectrum, options.lambda)?
        };
        let positions = analysis.decoder.positions();
        let operator = self.decomposed.operator(analysis.phi.as_ref(), map.data.as_ref());
        let operator = with_whole_tiles(keep_translations(operator, positions));
        let pull = self.pull(&map, bent.reference);
        let decoder = analysis.decoder.clone();
        // All points of a sample are some of the model's.
        let (handles, reads_all) = match analysis.sample() {
            Some(sample) if self.decomposed.reads_all => (sample.to_vec(), false),
            _ => (analysis.points_of(&self.decomposed.handles), self.decomposed.reads_all),
        };
        let consistent = match decoder.tied_normals() {
            None => None,
            Some(_) => {
                let rows = (!reads_all).then_some(handles.as_slice());
                let prepared = Consistent::new(&decoder, rows, shape_weight(options));
                Some(Arc::new(prepared.ok_or(failed("preparation of the consistent inversion"))?))
            }
        };
        let mut preparation = analysis.preparation.clone();
        preparation.condition_handles = self.decomposed.condition;
        preparation.singular_values = self.decomposed.sigma.clone();
        preparation.svd_seconds += self.seconds + clock.elapsed().as_secs_f64();
        Ok(Solver { handles, reads_all, operator, pull, consistent, decoder, diagonal: analysis.diagonal, preparation })
    }

    pub(super) fn bent(&self, term: &dyn Term) -> Result<Bent, PrepareError> {
        let unknowns = self.analysis.phi.ncols();
        Ok(Bent { delta: term.delta(&self.analysis.cage, unknowns)?, reference: term.reference() })
    }

    pub(super) fn map(
        &self,
        bent: &Bent,
        regularizer: Regularizer,
        s: usize,
        lambda: f64,
    ) -> Result<SpectralMap, PrepareError> {
        let found = &self.decomposed;
        let spectrum = Spectrum {
            sigma: &found.sigma[..found.rank],
            v: found.v.as_ref(),
            delta: bent.delta.as_ref(),
            reference: bent.reference,
        };
        spectral_map(&spectrum, regularizer, s, lambda).ok_or(failed("regularised solve"))
    }

    /// What pulls the cages: towards the rest cage a constant, towards the previous one a matrix.
    pub(super) fn pull(&self, map: &SpectralMap, reference: Reference) -> Pull {
        let Some(pull) = &map.pull else { return Pull::None };
        let to_cage = dense::product(self.decomposed.v.as_ref(), pull.as_ref());
        let positions = self.analysis.decoder.positions();
        let operator = cages_stay(to_cage, positions);
        let rest = &self.analysis.rest;
        if reference == Reference::RestCage {
            return Pull::Constant(dense::product(operator.as_ref(), about_first(rest, positions).as_ref()));
        }
        let first = rest.iter().flatten().map(|&x| x as f32).collect();
        Pull::Previous { operator, first }
    }
}

/// Singular values below this fraction of the largest are of directions that the points hardly determine.
const WILD: f64 = 1e-2;

/// Whether no term and no damping takes part.
fn follows_points_alone(options: SolverOptions) -> bool {
    options.regularizer == Regularizer::None || options.regularizer.is_sub_spectral() && options.spectrum == 0
}

/// How much the shape of the linear start counts beside the points: as much as a term, where there is one.
fn shape_weight(options: SolverOptions) -> f64 {
    const WITHOUT_TERM: f64 = 1e-3;
    let has_term = options.regularizer.is_sub_spectral() || options.regularizer == Regularizer::Global;
    if has_term && !follows_points_alone(options) { options.lambda } else { WITHOUT_TERM }
}

/// Unknowns with the first vertex as origin, m × 3: the pull does not see the difference, and digits are kept.
pub(super) fn about_first(unknowns: &[Point], positions: usize) -> Mat<f64> {
    Mat::from_fn(unknowns.len(), 3, |i, k| unknowns[i][k] - if i < positions { unknowns[0][k] } else { 0.0 })
}
