//! Analysis of a rest pose and its cage: coordinates, maximum-volume handles and singular value decompositions, shared by solvers with different
//! options.

use super::analysed_coordinates::{AnalysisCoordinates, coordinates};
use super::checks::{check, reject_far_points};
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
use cager_geometry::mesh::{Point, diagonal};
use faer::{Mat, MatRef};

/// Analysis of a rest pose and its cage, from which solvers with any options follow at the cost of their operator alone.
///
/// It holds `Φ` in double precision as well; for a single solver use [`Solver::prepare`](super::Solver::prepare).
///
/// For a system whose normals are functions of the vertices, it analyses mean value coordinates of the same cage and points, from which the nonlinear
/// inversion starts. Only the decoder and the reproduction errors are the system's own.
pub struct Analysis {
    /// `Φ` of the points analysed.
    pub(super) phi: Mat<f64>,
    pub(super) cage: Cage,
    /// The points analysed.
    pub(super) points: Vec<Point>,
    /// Their indices in the model; `None` where all points are analysed.
    sample: Option<Vec<u32>>,
    /// Unknowns of the rest pose, m × 3.
    pub(super) rest: Vec<Point>,
    pub(super) basis: RowBasis,
    pub(super) spectra: Spectra,
    pub(super) decoder: Decoder,
    pub(super) diagonal: f64,
    /// See [`PrepareContext::memory`].
    pub(super) memory: u64,
    pub(super) preparation: PreparationReport,
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
        Self::of(system, cage, points, options, RequiredDecompositions::Everything, context)
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
        Self::of(system, cage, points, options, RequiredDecompositions::For(options.handles), context)
    }

    /// As [`Self::for_options`], for the solver with these options alone.
    pub(super) fn for_solver(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        // An unregularised start is regularised nevertheless, in as many directions as are ill-conditioned.
        let required = if system.values(cage).dependent_normals.is_some() {
            RequiredDecompositions::For(options.handles)
        } else {
            RequiredDecompositions::of_solver(drop_zero_weight_regularizer(options))
        };
        Self::of(system, cage, points, options, required, context)
    }

    fn of(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        required: RequiredDecompositions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        let (m, diagonal) = (system.values(cage).unknowns(), diagonal(points));
        check(points, m, options, context.memory)?;
        reject_far_points(cage, points)?;
        context.begin(Step::Coordinates)?;
        let AnalysisCoordinates {
            phi,
            sample,
            decoder,
            rest,
            error,
            outside: (outside, outside_distance),
            refinement,
            plan,
        } = coordinates(system, cage, points, required, context)?;
        context.begin(Step::Handles)?;
        let no_handles = PrepareError::NoSolution { what: "choice of handles" };
        let mut basis = row_basis(phi.as_ref()).ok_or(no_handles.clone())?;

        context.begin(Step::SingularValues)?;
        // Built only now, since memory use peaks in maxvol.
        let decoder = || decoder.unwrap_or_else(|| Decoder::new(phi.as_ref(), cage.vertices().len()));
        let (decoder, spectra) = rayon::join(decoder, || Spectra::of(phi.as_ref(), &basis, required));
        let mut spectra = spectra?;
        if basis.rank == m && spectra.full_ends[2] <= RANK_TOLERANCE * spectra.full_ends[0] {
            basis = deficient_basis(phi.as_ref()).ok_or(no_handles)?;
            spectra = Spectra::of(phi.as_ref(), &basis, required)?;
        }
        let rank = basis.rank;
        let preparation = PreparationReport {
            rank,
            affine_reproduction_error: error / diagonal,
            condition_full: spectra.full_ends[0] / spectra.full_ends[1],
            condition_handles: spectra.handles_ends.map_or(f64::NAN, |[first, last]| first / last),
            singular_values: Vec::new(),
            maxvol: basis.handles.volume,
            outside,
            outside_distance,
            refinement,
            plan,
        };
        let points = match &sample {
            Some(sample) => sample.iter().map(|&i| points[i as usize]).collect(),
            None => points.to_vec(),
        };
        let cage = cage.clone();
        let memory = context.memory;
        Ok(Self { phi, cage, points, sample, rest, basis, spectra, decoder, diagonal, memory, preparation })
    }

    /// Indices of the points analysed; `None` where all are.
    pub(super) fn sample(&self) -> Option<&[u32]> {
        self.sample.as_deref()
    }

    /// Results of the preparation; the singular values are empty, see [`Self::handle_spectrum`] and [`Self::full_spectrum`].
    pub fn preparation(&self) -> &PreparationReport {
        &self.preparation
    }

    /// The decoder from cages to positions.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// `Φ` of the points analysed, n × m.
    pub fn coordinates(&self) -> MatRef<'_, f64> {
        self.phi.as_ref()
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
        svd::singular_values(linalg::rows_of(self.phi.as_ref(), rows).as_ref())
    }
}
