//! Preparation of a solver: coordinates, handles, spectrum and operator.

use super::AnalysedCoordinates;
use super::checks::{check, reject_carriers, reject_far_points};
use super::{PrepareContext, PrepareError, Solver, SolverOptions, Step, least_squares};
use crate::cage::Cage;
use crate::coordinates::CoordinateSystem;
use crate::spectral::Analysis;
use cager_geometry::mesh::Point;

impl Solver {
    /// The checks of [`Self::prepare`] that need no computation; handles may take `memory` bytes.
    pub fn check(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        memory: u64,
    ) -> Result<(), PrepareError> {
        check(points, system.values(cage).unknowns(), options, memory)?;
        reject_far_points(cage, points)?;
        reject_carriers(system, cage, points.len())?;
        Ok(system.check(cage, points)?)
    }

    /// Computes coordinates, handles, spectrum and operator. The threads of the pool do not matter.
    pub fn prepare(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
    ) -> Result<Self, PrepareError> {
        Self::prepare_with(system, cage, points, options, &PrepareContext::default())
    }

    /// As [`Self::prepare`], with a custom matrix, progress and cancellation.
    pub fn prepare_with(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        points: &[Point],
        options: SolverOptions,
        context: &PrepareContext<'_>,
    ) -> Result<Self, PrepareError> {
        // A matrix that does not fit the cage is refused before anything is computed.
        let values = system.values(cage);
        let unknowns = values.unknowns();
        let delta = options.regularizer.delta(context.matrix, cage, unknowns)?;
        let mut found = AnalysedCoordinates::checked((system, cage, points), options, Some(options.handles), context)?;
        if values.dependent_normals.is_none() && least_squares::applies(options, unknowns) {
            match least_squares::solver(found, cage, delta.as_ref(), options, context)? {
                Ok(solver) => return Ok(solver),
                Err(ill_conditioned) => found = ill_conditioned,
            }
        }
        drop(delta);
        let analysis = Analysis::for_solver(found, cage, options, context)?;
        context.begin(Step::Operator)?;
        analysis.handle_system(options.handles)?.solver(options, context.matrix)
    }
}
