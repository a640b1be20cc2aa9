//! Preparation of a solver: coordinates, handles, spectrum and operator.

use super::checks::{check, reject_far_points};
use super::{Analysis, PrepareContext, PrepareError, Solver, SolverOptions, Step};
use crate::cage::Cage;
use crate::coordinates::CoordinateSystem;
use cager_geometry::mesh::Point;

impl Solver {
    /// The checks of [`Self::prepare`] that need no computation; the covariance of handles may take `memory` bytes.
    ///
    /// # Errors
    /// See [`PrepareError`].
    pub fn check(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        memory: u64,
    ) -> Result<(), PrepareError> {
        check(points, system.values(cage).unknowns(), options, memory)?;
        reject_far_points(cage, points)?;
        Ok(system.check(cage, points)?)
    }

    /// Computes coordinates, handles, spectrum and operator. Runs on the current rayon pool; its result does not depend on it.
    ///
    /// # Errors
    /// See [`PrepareError`].
    pub fn prepare(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
    ) -> Result<Self, PrepareError> {
        Self::prepare_with(system, cage, points, options, &PrepareContext::default())
    }

    /// As [`Self::prepare`], with a custom matrix, progress and cancellation.
    ///
    /// # Errors
    /// See [`PrepareError`].
    pub fn prepare_with(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        // A matrix that does not fit the cage is refused before anything is computed.
        options.regularizer.delta(context.matrix, cage, system.values(cage).unknowns())?;
        let analysis = Analysis::for_solver(system, cage, points, options, context)?;
        context.begin(Step::Operator)?;
        analysis.handle_system(options.handles)?.solver(options, context.matrix)
    }
}
