//! From uploaded files and options to a prepared solver, and the cache of these.

mod cage_maker;
mod checks;
mod geometry;
mod reach;
mod shared_cache;
mod solvers;
mod valid_options;

pub(crate) use cage_maker::{
    CAGE_NAME, CageMaker, Enclosed, VERTICES, check_extent, obj_of, refuse_cage, vertices_detail,
};
pub(crate) use checks::{cannot_be_coded, check, check_model};
pub(crate) use geometry::{Geometry, cage_of, read, read_cage, read_part, read_part_with_units};
pub(crate) use reach::Reach;
pub(crate) use solvers::{KeptSolvers, SolverRequest, SolverResponse, Solvers, kept_solvers};
pub(crate) use valid_options::{ValidOptions, check_told, content_key, goal};

use crate::problem::ApiError;
use cager_capture::preparation_warnings::preparation_warnings;
use cager_capture::speed::StepClock;
use cager_core::cage::Cage;
use cager_core::inversion::{PrepareContext, PrepareError, Solver, SolverOptions};
use checks::{check_memory, refused};
use std::ops::ControlFlow;

/// A prepared solver with its warnings, cage sizes and the digest of its handles.
pub(crate) struct Prepared {
    pub(crate) solver: Solver,
    pub(crate) options: SolverOptions,
    pub(crate) handles_digest: String,
    pub(crate) cage_vertices: u32,
    pub(crate) cage_faces: u32,
    /// Where the points of frames may lie.
    pub(crate) reach: Reach,
    pub(crate) warnings: Vec<String>,
}

/// The prepared solver and the seconds of [`StepClock::seconds`]. `wanted` is called before each step; `None` once it is false.
///
/// # Errors
/// `INVALID_GEOMETRY`, `INVALID_OPTIONS`.
pub(crate) fn prepare(
    geometry: &Geometry,
    valid: &ValidOptions,
    max_bytes: u64,
    wanted: &dyn Fn() -> bool,
) -> Result<Option<(Prepared, [f64; 3])>, ApiError> {
    let unknowns = valid.system.values(&geometry.cage).unknowns();
    let options = valid.inversion.options(unknowns);
    check_memory(geometry, valid, options, max_bytes)?;
    let clock = StepClock::default();
    let before_step = |step| {
        clock.begin(step);
        if wanted() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    };
    let context = PrepareContext {
        matrix: geometry.matrix.as_ref(),
        memory: max_bytes,
        before_step: &before_step,
        ..PrepareContext::default()
    };
    match Solver::prepare_with(valid.system, &geometry.cage, &geometry.rest.points, options, &context) {
        Ok(solver) => {
            let seconds = clock.seconds();
            Ok(Some((with_solver(solver, &geometry.cage, options), seconds)))
        }
        Err(PrepareError::Stopped) => Ok(None),
        Err(error) => Err(refused(&error)),
    }
}

/// A prepared solver with its warnings, cage sizes and the digest of its handles.
pub(crate) fn with_solver(solver: Solver, cage: &Cage, options: SolverOptions) -> Prepared {
    let warnings = preparation_warnings(options, &solver);
    let handles: Vec<u8> = solver.handles().iter().flat_map(|handle| handle.to_le_bytes()).collect();
    Prepared {
        handles_digest: blake3::hash(&handles).to_hex().to_string(),
        reach: Reach::around(cage.vertices(), solver.diagonal()),
        solver,
        options,
        cage_vertices: cage.vertices().len() as u32,
        cage_faces: cage.faces().len() as u32,
        warnings,
    }
}
