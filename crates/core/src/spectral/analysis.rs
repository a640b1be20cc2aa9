//! Analysis of a rest pose and its cage, shared by solvers with different options.

use super::maxvol::MaxVol;
use super::normal_factor::NormalFactor;
use super::row_basis::{RowBasis, deficient_basis, row_basis};
use crate::cage::Cage;
use crate::coordinates::CoordinateSystem;
use crate::decode::Decoder;
use crate::inversion::{
    AnalysedCoordinates, Handles, PreparationReport, PrepareContext, PrepareError, SolverOptions, Step,
};
use crate::regularize::{Regularizer, WEAK_SINGULAR_VALUE};
use cager_geometry::linalg;
use cager_geometry::linalg::svd::{self, LastDirections, Svd};
use cager_geometry::mesh::Point;
use faer::MatRef;

/// From so many unknowns on, only the directions that a term acts on are computed.
const PARTIAL_SVD_FROM: usize = 1024;
/// They are found on their own only where there are at least this many unknowns for each.
const MIN_UNKNOWNS_PER_DIRECTION: usize = 32;

/// Analysis of a rest pose and its cage, from which solvers with any options follow at the cost of
/// their operator alone. It holds `Φ` in double precision as well.
///
/// Where normals are functions of the vertices, it analyses mean value coordinates, from which the
/// nonlinear inversion starts. Only the decoder and the reproduction errors are the system's own.
pub struct Analysis {
    /// Without a decoder.
    pub(super) found: AnalysedCoordinates,
    pub(super) cage: Cage,
    pub(super) decoder: Decoder,
    /// Handles of maximum volume; `None` where every point is read.
    pub(super) basis: Option<RowBasis>,
    /// Of `Φ□`; `None` where they are not needed, or their last directions alone.
    pub(super) square: Option<Svd>,
    /// R with `ΦᵀΦ = RᵀR`.
    pub(super) factor: NormalFactor,
    /// Singular directions of `Φ`; `None` where least squares does not sum over all points.
    pub(super) all: Option<LastDirections>,
    /// Numerical rank of `Φ`.
    pub(super) rank: usize,
    /// How many of the last directions suffice, where a decomposition of all takes longer.
    pub(super) last: Option<usize>,
    /// See [`PrepareContext::memory`].
    pub(super) memory: u64,
}

impl Analysis {
    /// Computes coordinates, handles and decompositions. The threads of the pool do not matter.
    pub fn new(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let options = SolverOptions { spectrum: 0, ..SolverOptions::PAPER };
        let found = AnalysedCoordinates::checked((system, cage, points), options, None, context)?;
        Self::of(found, cage, None, None, context)
    }

    /// Only what solvers with these handles need; very many points are analysed on a sample.
    pub fn for_options(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let found = AnalysedCoordinates::checked((system, cage, points), options, Some(options.handles), context)?;
        Self::of(found, cage, Some(options.handles), None, context)
    }

    /// As [`Self::for_options`], for the solver with these options alone, from its coordinates.
    pub(crate) fn for_solver(
        found: AnalysedCoordinates,
        cage: &Cage,
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let (options, m) = (options.without_idle_term(), found.phi.ncols());
        // An unregularised start is regularised in as many directions as are ill-conditioned.
        let is_dependent = found.decoder.as_ref().is_some_and(|decoder| decoder.dependent_normals().is_some());
        let acts_on_last = options.regularizer == Regularizer::None || options.regularizer.is_sub_spectral();
        let is_partial = !is_dependent
            && acts_on_last
            && !matches!(options.handles, Handles::Rectangular { .. })
            && m >= PARTIAL_SVD_FROM
            && options.spectrum <= m / MIN_UNKNOWNS_PER_DIRECTION;
        let last = is_partial.then_some(options.spectrum.max(1));
        Self::of(found, cage, Some(options.handles), last, context)
    }

    /// What these handles need, `None` for any.
    fn of(
        mut found: AnalysedCoordinates,
        cage: &Cage,
        handles: Option<Handles>,
        last: Option<usize>,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let (phi, m) = (found.phi.as_ref(), found.phi.ncols());
        let no_handles = PrepareError::NoSolution { what: "choice of handles" };
        let no_spectrum = PrepareError::NoSolution { what: "singular value decomposition of the coordinates" };
        let mut basis = None;
        if handles != Some(Handles::All) {
            context.begin(Step::Handles)?;
            basis = row_basis(phi);
        }
        context.begin(Step::SingularValues)?;
        // Built only now, since memory use peaks in maxvol.
        let decoder = found.decoder.take();
        let decoder = || decoder.unwrap_or_else(|| Decoder::new(phi, cage.vertices().len()));
        let (decoder, factor) = rayon::join(decoder, || NormalFactor::of(phi));
        let sums_over_all = matches!(handles, None | Some(Handles::All | Handles::Spread { .. }));
        let some = last.filter(|_| sums_over_all).and_then(|count| enough(factor.last_directions(count)));
        let all = match some {
            Some(last) => Some(last),
            None if sums_over_all => Some(directions(svd::svd(factor.matrix()).ok_or(no_spectrum.clone())?)),
            None => None,
        };
        let complete = all.as_ref().map(|all| all.sigma.as_slice()).filter(|sigma| sigma.len() == m);
        let (mut rank, condition) = factor.rank_and_condition(complete).ok_or(no_spectrum.clone())?;
        if handles != Some(Handles::All) && (rank < m || basis.is_none()) {
            let svd = svd::svd(factor.matrix()).ok_or(no_spectrum.clone())?;
            let found = deficient_basis(phi, svd.v.as_ref(), rank).ok_or(no_handles)?;
            rank = found.rank;
            basis = Some(found);
        }
        let square = match (&basis, handles) {
            (Some(basis), None | Some(Handles::MaxVol)) if last.is_none() => {
                Some(svd::svd(basis.square.as_ref()).ok_or(no_spectrum)?)
            }
            _ => None,
        };
        let preparation = &mut found.preparation;
        preparation.rank = rank;
        preparation.condition_full = condition;
        if let Some(square) = &square {
            preparation.condition_handles = square.sigma[0] / square.sigma[rank - 1];
        }
        preparation.maxvol = basis.as_ref().map_or_else(Default::default, |basis| basis.handles.volume);
        let (cage, memory) = (cage.clone(), context.memory);
        Ok(Self { found, cage, decoder, basis, square, factor, all, rank, last, memory })
    }

    /// Results of the preparation; the singular values are empty.
    pub fn preparation(&self) -> &PreparationReport {
        &self.found.preparation
    }

    /// The decoder from cages to positions.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// `Φ` of the points analysed, n × m.
    pub fn coordinates(&self) -> MatRef<'_, f64> {
        self.found.phi.as_ref()
    }

    /// Rows of maximum volume, and how they were found; `None` where every point is read.
    pub fn handles(&self) -> Option<&MaxVol> {
        self.basis.as_ref().map(|basis| &basis.handles)
    }

    /// Singular values of `Φ□`, descending; empty for options that do not need them.
    pub fn handle_spectrum(&self) -> &[f64] {
        self.square.as_ref().map_or(&[], |svd| &svd.sigma)
    }

    /// Right singular vectors of `Φ□`, m × m, one per column; 0 × 0 where there are none.
    pub fn handle_vectors(&self) -> MatRef<'_, f64> {
        self.square.as_ref().map_or(MatRef::from_column_major_slice(&[], 0, 0), |svd| svd.v.as_ref())
    }

    /// Singular values of `Φ`, descending; empty for options that do not need them.
    pub fn full_spectrum(&self) -> &[f64] {
        self.all.as_ref().map_or(&[], |all| &all.sigma)
    }

    /// Singular values of the given rows of `Φ`, descending; `None` where they do not converge.
    pub fn spectrum_of(&self, rows: &[u32]) -> Option<Vec<f64>> {
        svd::singular_values(linalg::rows_of(self.found.phi.as_ref(), rows).as_ref())
    }
}

/// All singular directions.
pub(super) fn directions(Svd { mut sigma, v, .. }: Svd) -> LastDirections {
    let first = sigma[0];
    // Of fewer rows than columns the others are zero.
    sigma.resize(v.nrows(), 0.0);
    LastDirections { sigma, v, first }
}

/// The last directions where they are all that a term acts on: where no more are weak.
pub(super) fn enough(last: Option<LastDirections>) -> Option<LastDirections> {
    last.filter(|last| last.sigma[0] >= WEAK_SINGULAR_VALUE * last.first)
}
