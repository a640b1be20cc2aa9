//! From a choice of handles to solvers: a regularised map, and what pulls cages towards others.

use super::consistent::Consistent;
use super::factored::Factored;
use super::operator::{Decomposed, failed, with_whole_tiles};
use super::prepare::check_options;
use super::pull::Pull;
use super::translations::{cages_stay, keep_translations};
use super::{Analysis, PrepareError, Solver, SolverOptions};
use crate::decode::Decoder;
use crate::dense;
use crate::mesh::Point;
use crate::regularize::{CageLaplacian, Reference, Regularizer, SpectralMap, Spectrum, Term, TermError, spectral_map};
use faer::Mat;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// A choice of handles of an [`Analysis`], decomposed: solvers with any regularisation follow at little cost.
pub struct Reading<'a> {
    pub(super) analysis: &'a Analysis,
    pub(super) decomposed: Decomposed,
    /// Time the decomposition took.
    pub(super) seconds: f64,
    /// The Gram matrix of the rows read, where normals are tied: what takes longest there, computed when it is first needed.
    gram: OnceLock<Mat<f64>>,
}

/// A term as numbers.
pub(super) struct Bent {
    pub(super) delta: Mat<f64>,
    pub(super) reference: Reference,
}

impl<'a> Reading<'a> {
    pub(super) fn new(analysis: &'a Analysis, decomposed: Decomposed, seconds: f64) -> Self {
        Self { analysis, decomposed, seconds, gram: OnceLock::new() }
    }

    /// Cages back to positions.
    pub fn decoder(&self) -> &'a Decoder {
        &self.analysis.decoder
    }

    /// Singular values of the matrix that is inverted, descending.
    pub fn singular_values(&self) -> &[f64] {
        &self.decomposed.sigma
    }

    /// The solver with these options; the handles among them are not looked at. The weight λ is relative to the mean square error of the
    /// points in the data term, so that it means the same whichever points are read: λ · K/m multiplies the regularisation of a
    /// sum over K points, for m unknowns. For maximum-volume handles K = m, the paper's own setting.
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
        let (map, pull, consistent) = self.parts(options, term)?;
        let operator = self.decomposed.operator(analysis.phi.as_ref(), map.data.as_ref());
        let operator = with_whole_tiles(keep_translations(operator, analysis.decoder.positions()));
        let (handles, reads_all) = self.points_read();
        let mut preparation = analysis.preparation.clone();
        preparation.condition_handles = self.decomposed.condition;
        preparation.singular_values = self.decomposed.sigma.clone();
        preparation.svd_seconds += self.seconds + clock.elapsed().as_secs_f64();
        Ok(Solver {
            handles,
            reads_all,
            operator,
            pull,
            consistent,
            decoder: analysis.decoder.clone(),
            diagonal: analysis.diagonal,
            preparation,
        })
    }

    /// As [`Self::solver`], in factors: much cheaper to prepare, and cheaper to apply where many are applied to the same frames.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn factored(&self, options: SolverOptions) -> Result<Factored, PrepareError> {
        if self.analysis.decoder.tied_normals().is_some() {
            return Ok(self.solver(options)?.into());
        }
        let (map, pull, _) = self.parts(options, options.regularizer.term().ok_or(TermError::Missing)?)?;
        Ok(Factored::new(self, &map, pull))
    }

    /// The points of the model that are read, unless all are.
    fn points_read(&self) -> (Vec<u32>, bool) {
        let reads_all = self.decomposed.reads_all;
        match self.analysis.sample() {
            // All points of a sample are some of the model's.
            Some(sample) if reads_all => (sample.to_vec(), false),
            Some(sample) => (self.decomposed.handles.iter().map(|&row| sample[row as usize]).collect(), false),
            None => (self.decomposed.handles.clone(), reads_all),
        }
    }

    /// The map of singular directions, what pulls the cages, and what improves them afterwards.
    fn parts(
        &self,
        options: SolverOptions,
        term: &dyn Term,
    ) -> Result<(SpectralMap, Pull, Option<Arc<Consistent>>), PrepareError> {
        let analysis = self.analysis;
        let m = analysis.phi.ncols();
        check_options(analysis.phi.nrows(), m, options)?;
        let options = without_idle_term(options);
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
        let pull = self.pull(&map, bent.reference);
        let decoder = &analysis.decoder;
        let consistent = match decoder.tied_normals() {
            None => None,
            Some(_) => {
                let (handles, reads_all) = self.points_read();
                let rows = (!reads_all).then_some(handles.as_slice());
                let gram = self.gram.get_or_init(|| Consistent::gram_of(decoder, rows)).clone();
                let prepared = Consistent::from_gram(decoder, rows, shape_weight(options), gram);
                Some(Arc::new(prepared.ok_or(failed("preparation of the consistent inversion"))?))
            }
        };
        Ok((map, pull, consistent))
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
        let unknowns = found.v.ncols();
        let spectrum = Spectrum {
            sigma: &found.sigma[..found.rank],
            v: found.v.as_ref(),
            delta: bent.delta.as_ref(),
            reference: bent.reference,
        };
        let squared = if regularizer == Regularizer::Tikhonov { lambda * lambda } else { lambda };
        let weight = squared * found.rows as f64 / unknowns as f64;
        spectral_map(&spectrum, regularizer, s, weight).ok_or(failed("regularised solve"))
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

/// A weight of zero is the same as a threshold of zero.
fn without_idle_term(options: SolverOptions) -> SolverOptions {
    if options.lambda > 0.0 {
        return options;
    }
    let usual = SolverOptions { spectrum: 0, lambda: SolverOptions::default().lambda, ..options };
    match options.regularizer {
        Regularizer::Global => SolverOptions { regularizer: Regularizer::None, ..usual },
        regularizer if regularizer.is_sub_spectral() => usual,
        _ => options,
    }
}

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
