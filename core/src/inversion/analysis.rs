//! What solvers with any options share: coordinates, handles and decompositions, computed once.

use super::operator::{Spectra, keep_translations, operator, with_whole_tiles};
use super::prepare::{
    NOT_REPRODUCED, check, check_options, coordinates_fit, outside, refuse_far_points, reproduction_error,
};
use super::{Handles, Preparation, PrepareError, Solver, SolverOptions};
use crate::cage::Cage;
use crate::coordinates::CoordinateSystem;
use crate::decode::Decoder;
use crate::dense;
use crate::maxvol::MaxVol;
use crate::mesh::{Point, diagonal};
use crate::regularize::{Spectrum, cage_laplacian, spectral_map};
use crate::spectrum::{RANK_TOLERANCE, RowBasis, deficient_basis, row_basis};
use crate::svd::{self, Svd};
use faer::{Mat, MatRef};
use std::time::Instant;

/// A rest pose and its cage, analysed: solvers with any options follow at the cost of their operator alone.
///
/// For comparisons. It holds `Φ` in double precision as well; whoever wants one solver calls [`Solver::prepare`].
pub struct Analysis {
    phi: Mat<f64>,
    delta: Mat<f64>,
    basis: RowBasis,
    spectra: Spectra,
    decoder: Decoder,
    diagonal: f64,
    preparation: Preparation,
}

impl Analysis {
    /// Computes coordinates, handles and decompositions. Runs on the current rayon pool; its result does not depend on it.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn new(system: &dyn CoordinateSystem, cage: &Cage, points: &[Point]) -> Result<Self, PrepareError> {
        let m = system.unknowns(cage);
        check(points, m, SolverOptions { spectrum: 0, ..SolverOptions::default() })?;
        let diagonal = diagonal(points);
        let clock = Instant::now();
        if !coordinates_fit(points.len(), m, 3) {
            let gigabytes = 28e-9 * points.len() as f64 * m as f64;
            return Err(PrepareError::OutOfMemory { points: points.len(), unknowns: m, gigabytes });
        }
        refuse_far_points(cage, points)?;
        let coordinates = system.coordinates(cage, points)?;
        let phi = coordinates.phi;
        let (point, error) = reproduction_error(phi.as_ref(), &system.rest_unknowns(cage), cage, points);
        let relative = error / diagonal.min(cage.diagonal());
        if relative.is_nan() || relative > NOT_REPRODUCED {
            return Err(PrepareError::NotReproduced { point, error: relative });
        }
        let (outside, outside_distance) = outside(cage, points, &coordinates.outside, diagonal);
        let coordinates_seconds = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let no_handles = PrepareError::NoSolution { what: "choice of handles" };
        let mut basis = row_basis(phi.as_ref()).ok_or(no_handles.clone())?;
        let maxvol_seconds = clock.elapsed().as_secs_f64();

        let clock = Instant::now();
        let mut spectra = Spectra::of(&basis, Handles::All)?;
        if basis.rank == m && spectra.full_sigma[m - 1] <= RANK_TOLERANCE * spectra.full_sigma[0] {
            basis = deficient_basis(phi.as_ref()).ok_or(no_handles)?;
            spectra = Spectra::of(&basis, Handles::All)?;
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
            coordinates_seconds,
            maxvol_seconds,
            svd_seconds: clock.elapsed().as_secs_f64(),
        };
        let delta = cage_laplacian(cage);
        let decoder = Decoder::new(phi.as_ref(), cage.vertices().len());
        Ok(Self { phi, delta, basis, spectra, decoder, diagonal, preparation })
    }

    /// The solver with these options.
    ///
    /// # Errors
    /// As [`Solver::prepare`].
    pub fn solver(&self, options: SolverOptions) -> Result<Solver, PrepareError> {
        check_options(self.phi.ncols(), options)?;
        let clock = Instant::now();
        let mut preparation = self.preparation.clone();
        let operator = operator(
            self.phi.as_ref(),
            &self.basis,
            self.spectra.reading(options.handles),
            self.delta.as_ref(),
            options,
            &mut preparation,
        )?;
        preparation.svd_seconds += clock.elapsed().as_secs_f64();
        let handles = self.basis.handles.rows.clone();
        Ok(self.solver_of(operator, handles, options.handles == Handles::All, preparation))
    }

    /// A solver that reads the given rows instead of those of maximum volume, as many as unknowns or more; the handles among the
    /// options are not looked at.
    ///
    /// # Errors
    /// As [`Solver::prepare`]; [`PrepareError::NoSolution`] where the rows determine nothing.
    pub fn solver_reading(&self, rows: &[u32], options: SolverOptions) -> Result<Solver, PrepareError> {
        check_options(self.phi.ncols(), options)?;
        let failed = |what| PrepareError::NoSolution { what };
        let square = dense::rows_of(self.phi.as_ref(), rows);
        let Svd { u, sigma, v } =
            svd::svd(square.as_ref()).ok_or(failed("singular value decomposition of the rows"))?;
        let rank = sigma.iter().filter(|&&x| x > RANK_TOLERANCE * sigma[0]).count();
        if rank == 0 {
            return Err(failed("choice of rows"));
        }
        let spectrum = Spectrum { sigma: &sigma[..rank], v: v.as_ref(), delta: self.delta.as_ref() };
        let map = spectral_map(&spectrum, options.regularizer, options.spectrum, options.lambda)
            .ok_or(failed("regularised solve"))?;
        let to_cage = dense::product(v.as_ref(), map.as_ref());
        let operator = dense::product(u.as_ref().subcols(0, rank), to_cage.transpose());
        let preparation = Preparation {
            rank,
            condition_handles: sigma[0] / sigma[sigma.len().min(v.ncols()) - 1],
            singular_values: sigma,
            ..self.preparation.clone()
        };
        Ok(self.solver_of(operator, rows.to_vec(), false, preparation))
    }

    fn solver_of(&self, operator: Mat<f64>, handles: Vec<u32>, reads_all: bool, preparation: Preparation) -> Solver {
        let operator = with_whole_tiles(keep_translations(operator, self.decoder.positions()));
        Solver { handles, reads_all, operator, decoder: self.decoder.clone(), diagonal: self.diagonal, preparation }
    }

    /// What preparing found out; the singular values are empty, see [`Self::handle_spectrum`] and [`Self::full_spectrum`].
    pub fn preparation(&self) -> &Preparation {
        &self.preparation
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
