//! What is refused before anything expensive is computed. All functions block.

use super::geometry::geometry;
use super::{Geometry, ValidOptions};
use crate::problem::{self, ApiError};
use cager_capture::coding::{CodingError, Goal, slack};
use cager_capture::origin::{MAX_ROUNDING_ERROR, own_origin};
use cager_codec::MAX_ROWS;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{Handles, PrepareError, Solver, SolverOptions, check_options};
use cager_core::regularize::Regularizer;
use cager_geometry::mesh::{Point, diagonal};
use cager_proto::container::colors_bytes;

/// Validates rest pose, cage and options together, without expensive computation.
///
/// # Errors
/// `INVALID_GEOMETRY`, `INVALID_OPTIONS`.
pub(crate) fn check(geometry: &Geometry, valid: &ValidOptions, max_bytes: u64) -> Result<(), ApiError> {
    let unknowns = valid.system.values(&geometry.cage).unknowns();
    let options = valid.inversion.options(unknowns);
    // Report a handle count beyond the points before one beyond the memory. With too few points the options are not at fault.
    if geometry.rest.points.len() >= unknowns {
        check_options(geometry.rest.points.len(), unknowns, options, u64::MAX).map_err(|error| refused(&error))?;
    }
    check_memory(geometry, valid, options, max_bytes)?;
    check_place(&geometry.rest.points)?;
    Solver::check(valid.system, &geometry.cage, &geometry.rest.points, options, u64::MAX)
        .map_err(|error| refused(&error))?;
    valid.goal.map_or(Ok(()), |goal| check_goal(goal, geometry, unknowns, valid.frames))?;
    let Some(matrix) = &geometry.matrix else { return Ok(()) };
    Regularizer::Matrix.delta(Some(matrix), &geometry.cage, unknowns).map_err(|error| refused(&error.into()))?;
    Ok(())
}

/// Refuses a rest pose so far away that the single precision in which frames are sent would lose what is seen.
fn check_place(points: &[Point]) -> Result<(), ApiError> {
    let farthest = points.iter().flatten().fold(0.0f64, |far, x| far.max(x.abs()));
    let lost = farthest * f64::from(f32::EPSILON) / 2.0 / diagonal(points);
    match own_origin(points) {
        Some([x, y, z]) if lost > MAX_ROUNDING_ERROR => Err(geometry(format!(
            "the rest pose lies so far from the origin that the single precision in which frames are sent loses {lost:.1e} of its diagonal; subtract {x} {y} {z} from rest pose, cage and frames, as cager encode --server does"
        ))),
        _ => Ok(()),
    }
}

/// Refuses a goal that no frame could meet.
fn check_goal(goal: Goal, geometry: &Geometry, rows: usize, frames: u32) -> Result<(), ApiError> {
    let farthest = geometry.rest.points.iter().flatten().fold(0.0f64, |far, x| far.max(x.abs()));
    let meshes = geometry
        .coded
        .as_ref()
        .map_or(0, |(rest, cage)| (rest.bytes() + cage.bytes() + colors_bytes(&rest.mesh.colors)) as u64);
    let checked = match goal {
        _ if rows > MAX_ROWS => Err(CodingError::TooManyRows { rows, most: MAX_ROWS }),
        goal => goal
            .check_size(meshes, frames as usize)
            .and_then(|()| goal.check_precision(geometry.unit, slack(geometry.unit, 0, 0.0, farthest))),
    };
    checked.map_err(|error| cannot_be_coded(goal, &error))
}

/// The response where frames cannot be coded as asked for.
pub(crate) fn cannot_be_coded(goal: Goal, error: &CodingError) -> ApiError {
    let kind = if matches!(error, CodingError::Uncountable { .. }) {
        problem::INVALID_FRAME
    } else {
        problem::INVALID_OPTIONS
    };
    let option = match goal {
        Goal::MaxError(_) => "max_error",
        Goal::MeanError(_) => "mean_error",
        Goal::Size(_) => "target_size",
        Goal::Preview | Goal::Standard => "quality",
    };
    ApiError::new(kind, format!("{option}: {error}"))
}

/// The response for a preparation error; it names the option at fault, or the geometry.
pub(super) fn refused(error: &PrepareError) -> ApiError {
    let option = match error {
        PrepareError::SpectrumTooLarge { .. } => "spectrum",
        PrepareError::BadLambda { .. } => "lambda",
        PrepareError::HandleCount { .. } | PrepareError::HandlesOutOfMemory { .. } => "handle_count",
        PrepareError::Term(_) => "regularizer_matrix",
        _ => return geometry(error.to_string()),
    };
    ApiError::new(problem::INVALID_OPTIONS, format!("{option}: {error}"))
}

pub(super) fn check_memory(
    geometry: &Geometry,
    valid: &ValidOptions,
    options: SolverOptions,
    max_bytes: u64,
) -> Result<(), ApiError> {
    let points = geometry.rest.points.len();
    let values = valid.system.values(&geometry.cage);
    let unknowns = values.unknowns();
    let handles = match options.handles {
        // Covariance of the handles, its Cholesky factor, and the solution.
        Handles::Spread { .. } => {
            let count = options.handles.count(points, unknowns) as u64;
            count.saturating_mul(16 * (count + unknowns as u64))
        }
        _ => 0,
    };
    let columns = values.columns() as u64;
    // The Gram matrix of the iteration, in double and in single precision.
    let iterated = if columns > unknowns as u64 { 12 * columns * columns } else { 0 };
    let elements = valid.system.working_bytes(&geometry.cage, None);
    // Peak memory: two matrices of points × columns in double precision and one in single.
    let needed =
        (20 * points as u64 * columns).saturating_add(handles).saturating_add(iterated).saturating_add(elements);
    if needed > max_bytes {
        let detail = format!(
            "{points} points times {columns} values of the cage{} need {needed} bytes to be prepared, and this service allows {max_bytes}; use a coarser cage or a lighter model{}",
            with_elements(elements),
            if elements > 0 { ", or mean value coordinates (mvc)" } else { "" }
        );
        return Err(ApiError::new(problem::INVALID_GEOMETRY, detail).limit(max_bytes));
    }
    Ok(())
}

/// What boundary elements add to a size, in words.
fn with_elements(bytes: u64) -> String {
    if bytes > 0 { format!(" and its boundary elements, up to {bytes} bytes,") } else { String::new() }
}

/// Refuses another model of so many points, whose coordinates this service does not allow.
///
/// # Errors
/// More than `max_bytes` at their peak.
pub(crate) fn check_model(
    points: usize,
    system: &dyn CoordinateSystem,
    cage: &Cage,
    max_bytes: u64,
) -> Result<(), ApiError> {
    let (columns, elements) = (system.values(cage).columns(), system.working_bytes(cage, None));
    // Peak memory: one matrix in double precision, the work space of the solve, and one matrix in single precision.
    let needed = (20 * points as u64 * columns as u64).saturating_add(elements);
    if needed <= max_bytes {
        return Ok(());
    }
    let detail = format!(
        "model: {points} points times {columns} values of the cage{} need {needed} bytes, and this service allows {max_bytes}; send a lighter model",
        with_elements(elements)
    );
    Err(ApiError::new(problem::INVALID_GEOMETRY, detail).limit(max_bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_demo::{Capture, Options};
    use cager_formats::Units;
    use cager_proto::messages::SessionOptions;

    #[test]
    fn boundary_elements_count_as_memory_before_anything_is_prepared() {
        let Capture { rest, cage, .. } = Capture::new(&Options { points: 2000, frames: 1, cage_vertices: 300 });
        let cage = Cage::new(cage).expect("a cage");
        let geometry = Geometry { rest, cage, matrix: None, coded: None, unit: 1.0, units: Units::UNKNOWN };
        let checked = |system: &str, max_bytes: u64| {
            let options = SessionOptions { coordinates: Some(system.to_owned()), ..SessionOptions::default() };
            let valid = ValidOptions::of(&options).expect("options");
            let columns = valid.inversion.options(valid.system.values(&geometry.cage).unknowns());
            let other = check_model(2000, valid.system, &geometry.cage, max_bytes);
            (check_memory(&geometry, &valid, columns, max_bytes), other)
        };
        let (own, other) = checked("harmonic", 512 << 20);
        for refused in [own.expect_err("too little"), other.expect_err("too little")] {
            assert_eq!(refused.problem.status, problem::INVALID_GEOMETRY.status);
            assert!(refused.problem.detail.contains("boundary elements"), "{}", refused.problem.detail);
        }
        let (own, other) = checked("harmonic", 4 << 30);
        assert!(own.is_ok() && other.is_ok());
        let (own, other) = checked("mvc", 512 << 20);
        assert!(own.is_ok() && other.is_ok());
    }
}
