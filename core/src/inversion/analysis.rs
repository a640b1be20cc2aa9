//! A rest pose and its cage, analysed: coordinates, handles of maximum volume and decompositions, which solvers with any
//! options share.

use super::operator::{Decomposed, Spectra};
use super::prepare::{
    check, check_options, coordinates_fit, outside, refuse_far_points, refuse_unreproduced, reproduction_error,
};
use super::reading::Reading;
use super::{Preparation, PrepareError, Solver, SolverOptions};
use crate::cage::Cage;
use crate::coordinates::{CoordinateSystem, MeanValue};
use crate::decode::Decoder;
use crate::dense;
use crate::handles::Handles;
use crate::maxvol::MaxVol;
use crate::mesh::{Point, diagonal};
use crate::spectrum::{RANK_TOLERANCE, RowBasis, deficient_basis, row_basis};
use crate::svd;
use faer::{Mat, MatRef};
use std::time::Instant;

/// A rest pose and its cage, analysed: solvers with any options follow at the cost of their operator alone.
///
/// It holds `Φ` in double precision as well; whoever wants one solver calls [`Solver::prepare`].
///
/// Of a system whose normals follow from the vertices, it analyses where its inversion starts from: mean value coordinates of the
/// same cage and points. Only the decoder and the errors of reproduction are the system's own.
pub struct Analysis {
    pub(super) phi: Mat<f64>,
    pub(super) cage: Cage,
    pub(super) points: Vec<Point>,
    /// Unknowns of the rest pose, m × 3.
    pub(super) rest: Vec<Point>,
    basis: RowBasis,
    spectra: Spectra,
    pub(super) decoder: Decoder,
    pub(super) diagonal: f64,
    pub(super) preparation: Preparation,
}

impl Analysis {
    /// Computes coordinates, handles and decompositions. Runs on the current rayon pool; its result does not depend on it.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn new(system: &dyn CoordinateSystem, cage: &Cage, points: &[Point]) -> Result<Self, PrepareError> {
        Self::with_copies(system, cage, points, true, 3)
    }

    /// As [`Self::new`], with what solvers of these options need and no more.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn for_options(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
    ) -> Result<Self, PrepareError> {
        let whole_frames = matches!(options.handles, Handles::All | Handles::Spread { .. });
        check(points, system.unknowns(cage), options)?;
        Self::with_copies(system, cage, points, whole_frames, 2)
    }

    fn with_copies(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        whole_frames: bool,
        copies: usize,
    ) -> Result<Self, PrepareError> {
        let m = system.unknowns(cage);
        check(points, m, SolverOptions { spectrum: 0, ..SolverOptions::PAPER })?;
        let diagonal = diagonal(points);
        let clock = Instant::now();
        let columns = system.columns(cage);
        if !coordinates_fit(points.len(), columns, copies) {
            let gigabytes = (4 + 8 * copies) as f64 * 1e-9 * points.len() as f64 * columns as f64;
            return Err(PrepareError::OutOfMemory { points: points.len(), unknowns: m, gigabytes });
        }
        refuse_far_points(cage, points)?;
        let coordinates = system.coordinates(cage, points)?;
        let mut phi = coordinates.phi;
        let mut rest = system.rest_values(cage);
        let (point, error) = reproduction_error(phi.as_ref(), &rest, cage, points);
        refuse_unreproduced(point, error, cage, diagonal)?;
        let (outside, outside_distance) = outside(cage, points, &coordinates.outside, diagonal);
        let decoder_of = |phi: &Mat<f64>| Decoder::new(phi.as_ref(), cage.vertices().len());
        let tied = system.tied_normals(cage).map(|tied| decoder_of(&phi).with_tied_normals(Some(tied)));
        if tied.is_some() {
            drop(phi);
            phi = MeanValue.coordinates(cage, points)?.phi;
            rest.truncate(m);
        }
        let coordinates_seconds = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let no_handles = PrepareError::NoSolution { what: "choice of handles" };
        let mut basis = row_basis(phi.as_ref()).ok_or(no_handles.clone())?;
        let maxvol_seconds = clock.elapsed().as_secs_f64();
        // Not before: maxvol takes the most memory.
        let decoder = tied.unwrap_or_else(|| decoder_of(&phi));

        let clock = Instant::now();
        let mut spectra = Spectra::of(&basis, whole_frames)?;
        if basis.rank == m && spectra.full_sigma[m - 1] <= RANK_TOLERANCE * spectra.full_sigma[0] {
            basis = deficient_basis(phi.as_ref()).ok_or(no_handles)?;
            spectra = Spectra::of(&basis, whole_frames)?;
        }
        let rank = basis.rank;
        let preparation = Preparation {
            rank,
            affine_reproduction_error: error / diagonal,
            condition_full: spectra.full_sigma[0] / spectra.full_sigma[rank - 1],
            condition_handles: spectra.handles.sigma[0] / spectra.handles.sigma[rank - 1],
            singular_values: Vec::new(),
            swaps: basis.handles.swaps,
            log_volume: basis.handles.log_volume,
            max_entry: basis.handles.max_entry,
            outside,
            outside_distance,
            refinement: coordinates.refinement,
            coordinates_seconds,
            maxvol_seconds,
            svd_seconds: clock.elapsed().as_secs_f64(),
        };
        let (cage, points) = (cage.clone(), points.to_vec());
        Ok(Self { phi, cage, points, rest, basis, spectra, decoder, diagonal, preparation })
    }

    /// A choice of handles, decomposed: solvers with any regularisation follow.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn reading(&self, handles: Handles) -> Result<Reading<'_>, PrepareError> {
        let clock = Instant::now();
        let options = SolverOptions { handles, spectrum: 0, ..SolverOptions::PAPER };
        check_options(self.phi.nrows(), self.phi.ncols(), options)?;
        let decomposed = Decomposed::new(self.phi.as_ref(), &self.points, &self.basis, &self.spectra, handles)?;
        Ok(Reading::new(self, decomposed, clock.elapsed().as_secs_f64()))
    }

    /// As [`Self::reading`], of the given rows, as many as unknowns or more.
    ///
    /// # Errors
    /// [`PrepareError::NoSolution`] where the rows determine nothing.
    pub fn reading_of(&self, rows: &[u32]) -> Result<Reading<'_>, PrepareError> {
        let clock = Instant::now();
        let decomposed = Decomposed::of_given_rows(self.phi.as_ref(), rows.to_vec(), self.phi.ncols())?;
        Ok(Reading::new(self, decomposed, clock.elapsed().as_secs_f64()))
    }

    /// The solver with these options.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn solver(&self, options: SolverOptions) -> Result<Solver, PrepareError> {
        self.reading(options.handles)?.solver(options)
    }

    /// A solver that reads the given rows instead of those of maximum volume, as many as unknowns or more; the handles among the
    /// options are not looked at.
    ///
    /// # Errors
    /// As [`Solver::prepare`]; [`PrepareError::NoSolution`] where the rows determine nothing.
    pub fn solver_reading(&self, rows: &[u32], options: SolverOptions) -> Result<Solver, PrepareError> {
        self.reading_of(rows)?.solver(options)
    }

    /// What preparing found out; the singular values are empty, see [`Self::handle_spectrum`] and [`Self::full_spectrum`].
    pub fn preparation(&self) -> &Preparation {
        &self.preparation
    }

    /// Cages back to positions.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// `Φ`, n × m.
    pub fn coordinates(&self) -> MatRef<'_, f64> {
        self.phi.as_ref()
    }

    /// Rows of maximum volume, and how they were found.
    pub fn handles(&self) -> &MaxVol {
        &self.basis.handles
    }

    /// Singular values of `Φ□`, descending.
    pub fn handle_spectrum(&self) -> &[f64] {
        &self.spectra.handles.sigma
    }

    /// Right singular vectors of `Φ□`, m × m, one per column in the order of [`Self::handle_spectrum`].
    pub fn handle_vectors(&self) -> MatRef<'_, f64> {
        self.spectra.handles.v.as_ref()
    }

    /// Singular values of `Φ`, descending. Those of `ΦᵀΦ` are their squares.
    pub fn full_spectrum(&self) -> &[f64] {
        &self.spectra.full_sigma
    }

    /// Singular values of the given rows of `Φ`, descending; `None` where they do not converge.
    pub fn spectrum_of(&self, rows: &[u32]) -> Option<Vec<f64>> {
        svd::singular_values(dense::rows_of(self.phi.as_ref(), rows).as_ref())
    }
}
