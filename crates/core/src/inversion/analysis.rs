//! Analysis of a rest pose and its cage: coordinates, maximum-volume handles and singular value decompositions, shared by solvers with different
//! options.

use super::analysed_coordinates::{AnalysisCoordinates, checked_coordinates};
use super::options::drop_zero_weight_regularizer;
use super::spectra::{RequiredDecompositions, Spectra};
use super::{PreparationReport, PrepareContext, PrepareError, SolverOptions, Step};
use crate::cage::Cage;
use crate::coordinates::CoordinateSystem;
use crate::decode::Decoder;
use crate::maxvol::{MaxVol, RANK_TOLERANCE};
use crate::row_basis::{RowBasis, deficient_basis, row_basis};
use cager_geometry::linalg;
use cager_geometry::linalg::svd;
use cager_geometry::mesh::Point;
use faer::MatRef;

/// Analysis of a rest pose and its cage, from which solvers with any options follow at the cost of their operator alone.
///
/// It holds `Φ` in double precision as well; for a single solver use [`Solver::prepare`](super::Solver::prepare).
///
/// For a system whose normals are functions of the vertices, it analyses mean value coordinates of the same cage and points, from which the nonlinear
/// inversion starts. Only the decoder and the reproduction errors are the system's own.
pub struct Analysis {
    /// Without a decoder.
    pub(super) found: AnalysisCoordinates,
    pub(super) cage: Cage,
    pub(super) basis: RowBasis,
    pub(super) spectra: Spectra,
    pub(super) decoder: Decoder,
    /// See [`PrepareContext::memory`].
    pub(super) memory: u64,
}

impl Analysis {
    /// Computes coordinates, handles and decompositions. Runs on the current rayon pool; its result does not depend on it.
    ///
    /// # Errors
    /// As [`Solver::prepare`](super::Solver::prepare).
    pub fn new(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let options = SolverOptions { spectrum: 0, ..SolverOptions::PAPER };
        let found = checked_coordinates((system, cage, points), options, None, context)?;
        Self::of(found, cage, RequiredDecompositions::Everything, context)
    }

    /// As [`Self::new`], computing only what solvers with these handles need. A model of very many points is analysed on a sample.
    ///
    /// # Errors
    /// As [`Solver::prepare`](super::Solver::prepare).
    pub fn for_options(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let found = checked_coordinates((system, cage, points), options, Some(options.handles), context)?;
        Self::of(found, cage, RequiredDecompositions::For(options.handles), context)
    }

    /// As [`Self::for_options`], for the solver with these options alone, from its coordinates.
    pub(super) fn for_solver(
        found: AnalysisCoordinates,
        cage: &Cage,
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let is_dependent = found.decoder.as_ref().is_some_and(|decoder| decoder.dependent_normals().is_some());
        // An unregularised start is regularised nevertheless, in as many directions as are ill-conditioned.
        let required = if is_dependent {
            RequiredDecompositions::For(options.handles)
        } else {
            RequiredDecompositions::of_solver(drop_zero_weight_regularizer(options))
        };
        Self::of(found, cage, required, context)
    }

    fn of(
        mut found: AnalysisCoordinates,
        cage: &Cage,
        required: RequiredDecompositions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        context.begin(Step::Handles)?;
        let (phi, m) = (found.phi.as_ref(), found.phi.ncols());
        let no_handles = PrepareError::NoSolution { what: "choice of handles" };
        let mut basis = row_basis(phi).ok_or(no_handles.clone())?;

        context.begin(Step::SingularValues)?;
        // Built only now, since memory use peaks in maxvol.
        let decoder = found.decoder.take();
        let decoder = || decoder.unwrap_or_else(|| Decoder::new(phi, cage.vertices().len()));
        let (decoder, spectra) = rayon::join(decoder, || Spectra::of(phi, &basis, required));
        let mut spectra = spectra?;
        if basis.rank == m && spectra.full_ends[2] <= RANK_TOLERANCE * spectra.full_ends[0] {
            basis = deficient_basis(phi).ok_or(no_handles)?;
            spectra = Spectra::of(phi, &basis, required)?;
        }
        let preparation = &mut found.preparation;
        preparation.rank = basis.rank;
        preparation.condition_full = spectra.full_ends[0] / spectra.full_ends[1];
        preparation.condition_handles = spectra.handles_ends.map_or(f64::NAN, |[first, last]| first / last);
        preparation.maxvol = basis.handles.volume;
        Ok(Self { found, cage: cage.clone(), basis, spectra, decoder, memory: context.memory })
    }

    /// Indices of the points analysed; `None` where all are.
    pub(super) fn sample(&self) -> Option<&[u32]> {
        self.found.sample.as_deref()
    }

    /// Results of the preparation; the singular values are empty, see [`Self::handle_spectrum`] and [`Self::full_spectrum`].
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

    /// Rows of maximum volume, and how they were found.
    pub fn handles(&self) -> &MaxVol {
        &self.basis.handles
    }

    /// Singular values of `Φ□`, descending; empty for an analysis [for options](Self::for_options) that do not need them.
    pub fn handle_spectrum(&self) -> &[f64] {
        self.spectra.handles.as_ref().map_or(&[], |svd| &svd.sigma)
    }

    /// Right singular vectors of `Φ□`, m × m, one per column in the order of [`Self::handle_spectrum`]; 0 × 0 where there are none.
    pub fn handle_vectors(&self) -> MatRef<'_, f64> {
        self.spectra.handles.as_ref().map_or(MatRef::from_column_major_slice(&[], 0, 0), |svd| svd.v.as_ref())
    }

    /// Singular values of `Φ`, descending. Those of `ΦᵀΦ` are their squares. Of an analysis [for options](Self::for_options) that do
    /// not need them, none.
    pub fn full_spectrum(&self) -> &[f64] {
        &self.spectra.full_sigma
    }

    /// Singular values of the given rows of `Φ`, descending; `None` where they do not converge.
    pub fn spectrum_of(&self, rows: &[u32]) -> Option<Vec<f64>> {
        svd::singular_values(linalg::rows_of(self.found.phi.as_ref(), rows).as_ref())
    }
}
