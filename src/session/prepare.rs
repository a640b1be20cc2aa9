//! From uploaded files to a prepared solver: parsing, validation, preparation. All functions block.

use super::solver_cache::Prepared;
use crate::coding::{CodingError, Goal, InversionChoices, RestMeshes, slack};
use crate::preparation_warnings::preparation_warnings;
use crate::problem::{self, ApiError};
use crate::store::{Content, NamedFile};
use cager_cages::diagnosis::weld;
use cager_codec::{CodedMesh, MOST_ROWS};
use cager_core::cage::Cage;
use cager_core::coordinates;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{Handles, PrepareError, Preparing, Solver, SolverOptions, check_options};
use cager_core::mesh::{Model, TriMesh, diagonal};
use cager_core::regularize::{Regularizer, SparseMatrix, Term};
use cager_formats::{MeshFormat, read_matrix_bytes, read_model_bytes};
use cager_proto::container::colors_bytes;
use cager_proto::messages::SessionOptions;
use std::ops::ControlFlow;
use std::path::Path;

/// Validated options, except the upper bound of `spectrum`, which depends on the cage.
#[derive(Clone, Copy)]
pub(crate) struct Choices {
    pub(crate) system: &'static dyn CoordinateSystem,
    pub(crate) inversion: InversionChoices,
    pub(crate) flip_cage: bool,
    /// What the container is to meet; without it frames are stored as they are solved for.
    pub(crate) goal: Option<Goal>,
    pub(crate) exact_rest: bool,
    /// Number of frames, where it was given.
    frames: u32,
}

const NAME_CHARACTERS: usize = 200;

impl Choices {
    /// Validates what does not depend on the cage.
    ///
    /// # Errors
    /// An option that is unknown, out of range or not available.
    pub(crate) fn of(options: &SessionOptions) -> Result<Self, ApiError> {
        let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        if options.name.as_ref().is_some_and(|name| name.chars().count() > NAME_CHARACTERS) {
            return refuse(format!("name: is longer than {NAME_CHARACTERS} characters; shorten it"));
        }
        if options.frame_rate.is_some_and(|rate| !(rate.is_finite() && rate > 0.0)) {
            return refuse("frame_rate: give a positive number of frames per second".to_owned());
        }
        if options.frames == Some(0) {
            return refuse(
                "frames: a capture has at least one frame; leave it out where their number is not known".to_owned(),
            );
        }
        let name = options.coordinates.as_deref().unwrap_or("mvc");
        let Some(system) = coordinates::by_name(name) else {
            let names = coordinates::SYSTEMS.map(CoordinateSystem::name).join(", ");
            return refuse(format!("coordinates: {name:?} is not available; give one of {names}"));
        };
        let wanted = options.handles.as_deref().unwrap_or(Handles::default().name());
        if !Handles::NAMES.contains(&wanted) {
            let names = Handles::NAMES.join(", ");
            return refuse(format!("handles: {wanted:?} is not available; give one of {names}"));
        }
        let Some(handles) = Handles::by_name(wanted, options.handle_count.map(|count| count as usize)) else {
            return refuse(format!("handle_count: {wanted} has a fixed number of handles; leave it out"));
        };
        let handles = (options.handles.is_some() || options.handle_count.is_some()).then_some(handles);
        let wanted = options.regularizer.as_deref().unwrap_or(Regularizer::default().name());
        let Some(regularizer) = Regularizer::by_name(wanted) else {
            let names: Vec<&str> = Regularizer::ALL.iter().map(|r| r.name()).collect();
            return refuse(format!("regularizer: {wanted:?} is not available; give one of {}", names.join(", ")));
        };
        if let Some(lambda) = options.lambda
            && !(lambda.is_finite() && lambda >= 0.0)
        {
            return refuse(format!("lambda: is {lambda}; give a finite number of at least 0"));
        }
        let spectrum = options.spectrum.map(|threshold| threshold as usize);
        let SessionOptions { lambda, flip_cage, exact_rest, .. } = *options;
        let goal = goal(options)?;
        let inversion = InversionChoices { system, handles, regularizer, spectrum, lambda, is_coded: goal.is_some() };
        let frames = options.frames.unwrap_or(0);
        Ok(Self { system, inversion, flip_cage, goal, exact_rest, frames })
    }
}

/// What the container is to meet.
fn goal(options: &SessionOptions) -> Result<Option<Goal>, ApiError> {
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
    let SessionOptions { max_error, mean_error, target_size, quality, frames, .. } = options;
    let names = [
        max_error.map(|_| "max_error"),
        mean_error.map(|_| "mean_error"),
        target_size.map(|_| "target_size"),
        quality.as_ref().map(|_| "quality"),
    ];
    let given: Vec<&str> = names.into_iter().flatten().collect();
    if let [first, second, ..] = given[..] {
        return refuse(format!("{second}: is given beside {first}; give one of them"));
    }
    if let (&[name], Some(error)) = (&given[..], max_error.or(*mean_error))
        && !(error > 0.0 && error < 1.0)
    {
        return refuse(format!("{name}: is {error}; give a fraction of the rest pose's diagonal above 0 and below 1"));
    }
    if target_size.is_some() && frames.is_none() {
        return refuse("target_size: is shared out among the frames; give their number as frames".to_owned());
    }
    Ok(match quality.as_deref() {
        None => max_error.map(Goal::MaxError).or(mean_error.map(Goal::MeanError)).or(target_size.map(Goal::Size)),
        Some("preview") => Some(Goal::Preview),
        Some("standard") => Some(Goal::Standard),
        Some("master") => Some(Goal::MASTER),
        Some(other) => {
            return refuse(format!("quality: {other:?} is not available; give one of preview, standard, master"));
        }
    })
}

/// Rest pose and cage of a session, on a grid where its frames are coded.
pub(crate) struct Geometry {
    pub(crate) rest: Model,
    pub(crate) cage: Cage,
    /// The matrix of the regularizer `matrix`.
    pub(crate) matrix: Option<SparseMatrix>,
    /// Rest pose and cage in the bytes of the codec.
    pub(crate) coded: Option<(CodedMesh, CodedMesh)>,
    /// The unit of guaranteed errors: the diagonal of the rest pose as it was sent, or as it is stored, whichever is less.
    pub(crate) unit: f64,
}

fn read_matrix(content: &Content, choices: &Choices) -> Result<Option<SparseMatrix>, ApiError> {
    let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, format!("regularizer_matrix: {detail}")));
    match (&content.matrix, choices.inversion.regularizer) {
        (Some(file), Regularizer::Matrix) => {
            read_matrix_bytes(Path::new(&file.name), &file.bytes).map(Some).or_else(|error| refuse(error.to_string()))
        }
        (None, Regularizer::Matrix) => refuse("the regularizer matrix needs it; send it as a file".to_owned()),
        (Some(_), other) => refuse(format!("{} uses no matrix; choose the regularizer matrix", other.name())),
        (None, _) => Ok(None),
    }
}

/// Reads and checks rest pose and cage.
///
/// # Errors
/// Bytes that cannot be read; a cage that cannot be used.
pub(crate) fn read(content: &Content, choices: &Choices) -> Result<Geometry, ApiError> {
    let rest = read_part("rest", &content.rest.name, &content.rest.bytes)?;
    let cage = read_cage(&content.cage, choices)?;
    let matrix = read_matrix(content, choices)?;
    let given = diagonal(&rest.points);
    let goal = choices.goal.filter(|_| !choices.exact_rest);
    Ok(match goal.and_then(|goal| RestMeshes::new(goal, &rest, &cage, choices.system)) {
        Some(RestMeshes { rest, cage, checked }) => Geometry {
            unit: given.min(diagonal(&rest.mesh.points)),
            rest: rest.mesh.clone(),
            cage: checked,
            matrix,
            coded: Some((rest, cage)),
        },
        None => Geometry { rest, cage, matrix, coded: None, unit: given },
    })
}

/// Reads and checks the cage.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_cage(file: &NamedFile, choices: &Choices) -> Result<Cage, ApiError> {
    let NamedFile { name, bytes } = file;
    let model = read_part("cage", name, bytes)?;
    if model.faces.is_empty() {
        return Err(geometry(format!(
            "{name}: has no faces, and a cage is a closed mesh; export the cage with its faces"
        )));
    }
    let model = weld(&model).map(|welded| welded.model).unwrap_or(model);
    let mesh = TriMesh::from(&model);
    let polygon_of = model.faces.polygon_of_triangle();
    Cage::new(if choices.flip_cage { mesh.flipped() } else { mesh }).map_err(|error| {
        let error = error.renumbered(|triangle| polygon_of[triangle] as usize);
        geometry(format!("{name}: {error}"))
    })
}

/// Validates rest pose, cage and options together, without expensive computation.
///
/// # Errors
/// `INVALID_GEOMETRY`, `INVALID_OPTIONS`.
pub(crate) fn check(geometry: &Geometry, choices: &Choices, max_bytes: u64) -> Result<(), ApiError> {
    let unknowns = choices.system.unknowns(&geometry.cage);
    let options = choices.inversion.options(unknowns);
    // Report a handle count beyond the points before one beyond the memory. With too few points the options are not at fault.
    if geometry.rest.points.len() >= unknowns {
        match check_options(geometry.rest.points.len(), unknowns, options) {
            Ok(()) | Err(PrepareError::HandlesOutOfMemory { .. }) => {}
            Err(error) => return Err(refused(&error)),
        }
    }
    check_memory(geometry, choices, options, max_bytes)?;
    Solver::check(choices.system, &geometry.cage, &geometry.rest.points, options).map_err(|error| refused(&error))?;
    choices.goal.map_or(Ok(()), |goal| check_goal(goal, geometry, unknowns, choices.frames))?;
    let Some(matrix) = &geometry.matrix else { return Ok(()) };
    matrix.delta(&geometry.cage, unknowns).map_err(|error| refused(&error.into()))?;
    Ok(())
}

/// Refuses a goal that no frame could meet.
fn check_goal(goal: Goal, geometry: &Geometry, rows: usize, frames: u32) -> Result<(), ApiError> {
    let farthest = geometry.rest.points.iter().flatten().fold(0.0f64, |far, x| far.max(x.abs()));
    let meshes = geometry
        .coded
        .as_ref()
        .map_or(0, |(rest, cage)| (rest.bytes() + cage.bytes() + colors_bytes(&rest.mesh.colors)) as u64);
    let checked = match goal {
        _ if rows > MOST_ROWS => Err(CodingError::TooManyRows { rows, most: MOST_ROWS }),
        goal => goal
            .check_size(meshes, frames as usize)
            .and_then(|()| goal.check_precision(geometry.unit, slack(geometry.unit, 0.0, farthest))),
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

/// Prepares the solver. `wanted` is called before each step; returns `None` once it is false.
///
/// # Errors
/// `INVALID_GEOMETRY`, `INVALID_OPTIONS`.
pub(crate) fn prepare(
    geometry: &Geometry,
    choices: &Choices,
    max_bytes: u64,
    wanted: &dyn Fn() -> bool,
) -> Result<Option<Prepared>, ApiError> {
    let unknowns = choices.system.unknowns(&geometry.cage);
    let options = choices.inversion.options(unknowns);
    check_memory(geometry, choices, options, max_bytes)?;
    let term = geometry.matrix.as_ref().map(|matrix| matrix as &dyn Term);
    let next = |_| if wanted() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
    let preparing = Preparing { term, next: &next, ..Preparing::default() };
    match Solver::prepare_with(choices.system, &geometry.cage, &geometry.rest.points, options, &preparing) {
        Ok(solver) => Ok(Some(with_solver(solver, &geometry.cage, options))),
        Err(PrepareError::Stopped) => Ok(None),
        Err(error) => Err(refused(&error)),
    }
}

/// The response for a preparation error; it names the option at fault, or the geometry.
fn refused(error: &PrepareError) -> ApiError {
    let option = match error {
        PrepareError::SpectrumTooLarge { .. } => "spectrum",
        PrepareError::BadLambda { .. } => "lambda",
        PrepareError::HandleCount { .. } | PrepareError::HandlesOutOfMemory { .. } => "handle_count",
        PrepareError::Term(_) => "regularizer_matrix",
        _ => return geometry(error.to_string()),
    };
    ApiError::new(problem::INVALID_OPTIONS, format!("{option}: {error}"))
}

/// A prepared solver with its warnings, cage sizes and the digest of its handles.
pub(crate) fn with_solver(solver: Solver, cage: &Cage, options: SolverOptions) -> Prepared {
    let warnings = preparation_warnings(options, &solver);
    let handles: Vec<u8> = solver.handles().iter().flat_map(|handle| handle.to_le_bytes()).collect();
    Prepared {
        handles_digest: blake3::hash(&handles).to_hex().to_string(),
        solver,
        options,
        cage_vertices: cage.vertices().len() as u32,
        cage_faces: cage.faces().len() as u32,
        warnings,
    }
}

fn check_memory(
    geometry: &Geometry,
    choices: &Choices,
    options: SolverOptions,
    max_bytes: u64,
) -> Result<(), ApiError> {
    let points = geometry.rest.points.len();
    let unknowns = choices.system.unknowns(&geometry.cage);
    let handles = match options.handles {
        // Covariance of the handles, its Cholesky factor, and the solution.
        Handles::Spread { .. } => {
            let count = options.handles.count(points, unknowns) as u64;
            count.saturating_mul(16 * (count + unknowns as u64))
        }
        _ => 0,
    };
    let columns = choices.system.columns(&geometry.cage) as u64;
    // The Gram matrix of the iteration, in double and in single precision.
    let iterated = if columns > unknowns as u64 { 12 * columns * columns } else { 0 };
    let elements = choices.system.working_bytes(&geometry.cage);
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
    let (columns, elements) = (system.columns(cage), system.working_bytes(cage));
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

/// Parses a mesh file; `part` names it in errors.
///
/// # Errors
/// Bytes that cannot be read.
pub(crate) fn read_part(part: &str, name: &str, bytes: &[u8]) -> Result<Model, ApiError> {
    let path = Path::new(name);
    let format = MeshFormat::from_path(path).map_err(|error| geometry(format!("{part}: {error}")))?;
    read_model_bytes(format, path, bytes).map_err(|error| geometry(format!("{part}: {error}")))
}

fn geometry(detail: String) -> ApiError {
    ApiError::new(problem::INVALID_GEOMETRY, detail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::synthetic::{Capture, Options};

    #[test]
    fn boundary_elements_count_as_memory_before_anything_is_prepared() {
        let Capture { rest, cage, .. } = Capture::new(&Options { points: 2000, frames: 1, cage_vertices: 300 });
        let cage = Cage::new(cage).expect("a cage");
        let geometry = Geometry { rest, cage, matrix: None, coded: None, unit: 1.0 };
        let checked = |system: &str, max_bytes: u64| {
            let options = SessionOptions { coordinates: Some(system.to_owned()), ..SessionOptions::default() };
            let choices = Choices::of(&options).expect("options");
            let columns = choices.inversion.options(choices.system.unknowns(&geometry.cage));
            let other = check_model(2000, choices.system, &geometry.cage, max_bytes);
            (check_memory(&geometry, &choices, columns, max_bytes), other)
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
