//! Cages designed from a capture, and the coordinates of points in a cage.

use crate::apart::interruptible;
use crate::arguments;
use crate::arrays::{FrameView, frame_arrays, frame_views, model};
use crate::fault::{Fault, computing, of, warn};
use crate::frames::Frames;
use crate::watch::Watch;
use cager_cages::{Design, DesignError, DesignOptions, EncloseError, Goal, Progress, Style, design};
use cager_capture::design::{FRAMES, STYLES, default_vertices, style_by_name, style_name};
use cager_capture::encode::sample_frames;
use cager_capture::memory::free_bytes;
use cager_capture::origin::{move_from, move_to, own_origin};
use cager_core::cage::{Cage, CageError};
use cager_core::coordinates::{CoordinateSystem, SYSTEMS, by_name};
use cager_core::inversion::{coordinates_bytes, reject_far_points};
use cager_geometry::mesh::{Model, TriMesh};
use numpy::ndarray::{Array2, ShapeBuilder};
use numpy::{IntoPyArray, PyArray2};
use pyo3::prelude::*;
use std::time::Duration;

/// The coordinate system with this name.
pub(crate) fn system(name: &str, argument: &str) -> Result<&'static dyn CoordinateSystem, Fault> {
    by_name(name).ok_or_else(|| {
        let names: Vec<&str> = SYSTEMS.iter().map(|system| system.name()).collect();
        of(argument, format!("there is no {name:?}; give one of {}", names.join(", ")))
    })
}

/// A checked cage.
pub(crate) fn cage(mesh: TriMesh) -> Result<Cage, Fault> {
    Cage::new(mesh).map_err(|error| match error {
        CageError::Inward { .. } => of("cage", format!("{error}; turn them with faces[:, ::-1]")),
        error => of("cage", error),
    })
}

/// The cage in arrays of vertices and faces.
pub(crate) fn cage_mesh(vertices: &Bound<'_, PyAny>, faces: &Bound<'_, PyAny>) -> Result<TriMesh, Fault> {
    Ok(TriMesh::from(&model(vertices, Some(faces), ["cage", "cage faces"])?))
}

/// How many vertices a designed cage has, or which error it meets.
pub(crate) fn design_goal(vertices: Option<usize>, mean_error: Option<f64>, points: usize) -> Result<Goal, Fault> {
    match (vertices, mean_error) {
        (Some(_), Some(_)) => Err(of("vertices", "either they are given or mean_error; leave one of them out")),
        (Some(vertices), _) if vertices > points => Err(Fault::Told(format!(
            "a cage of {vertices} vertices has more unknowns than the rest pose has points ({points}); ask for fewer vertices"
        ))),
        (_, Some(error)) if !(error.is_finite() && error > 0.0) => Err(of(
            "mean_error",
            format!("is {error}; give a fraction of the rest pose's diagonal above 0, such as 0.001"),
        )),
        (_, Some(error)) => Ok(Goal::MeanError(error)),
        (vertices, None) => Ok(Goal::Vertices(vertices.unwrap_or(default_vertices(points)))),
    }
}

/// Designs a cage from evenly spaced frames.
pub(crate) fn designed(
    rest: &Model,
    frames: &Frames<'_>,
    options: &DesignOptions,
    watch: &Watch,
) -> Result<Design, Fault> {
    let samples = sample_frames(&mut frames.open(), FRAMES, false).map_err(|error| Fault::Told(error.to_string()))?;
    let mut tell = |now: Progress<'_>| watch.tell(now.stage, now.fraction);
    let made = design(rest, &samples, None, options, &mut tell).map_err(|error| match &error {
        DesignError::TooManyVertices { .. } | DesignError::Enclose(EncloseError::TooFewVertices { .. }) => {
            of("vertices", error)
        }
        DesignError::BadGoal(_) => of("mean_error", error),
        DesignError::Enclose(_) => of("rest", error),
        _ => of(frames.name, error),
    });
    watch.unless_stopped(made)
}

/// A mesh as arrays: vertices m × 3, and triangles k × 3.
pub(crate) fn mesh_arrays<'py>(py: Python<'py>, mesh: &TriMesh) -> Result<Mesh<'py>, Fault> {
    Ok((array(py, mesh.vertices.as_flattened().to_vec())?, triangles(py, &mesh.triangles)?))
}

/// Vertices and triangles.
pub(crate) type Mesh<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>);

/// Rows of three, without a copy.
pub(crate) fn array<T: numpy::Element>(py: Python<'_>, values: Vec<T>) -> Result<Bound<'_, PyArray2<T>>, Fault> {
    let rows = Array2::from_shape_vec((values.len() / 3, 3), values).map_err(|error| Fault::Told(error.to_string()))?;
    Ok(rows.into_pyarray(py))
}

/// Triangles, k × 3.
pub(crate) fn triangles<'py>(py: Python<'py>, triangles: &[[u32; 3]]) -> Result<Bound<'py, PyArray2<i64>>, Fault> {
    array(py, triangles.as_flattened().iter().map(|&vertex| i64::from(vertex)).collect())
}

/// Design a cage from a capture: vertices (m, 3) and triangles (k, 3).
#[pyfunction]
#[pyo3(signature = (rest, faces, frames, vertices=None, *, mean_error=None, style="free", seed=0, time_limit=None, force=false, progress=None))]
#[expect(clippy::too_many_arguments, reason = "arguments with names")]
pub(crate) fn design_cage<'py>(
    py: Python<'py>,
    rest: &Bound<'py, PyAny>,
    faces: Option<&Bound<'py, PyAny>>,
    frames: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = arguments::vertices)] vertices: Option<usize>,
    mean_error: Option<f64>,
    style: &str,
    #[pyo3(from_py_with = arguments::seed)] seed: u64,
    time_limit: Option<f64>,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> Result<Mesh<'py>, Fault> {
    let mut rest = model(rest, faces, ["rest", "faces"])?;
    let given = frame_arrays(frames, "frames")?;
    let views = frame_views(&given)?;
    let options = DesignOptions {
        goal: design_goal(vertices, mean_error, rest.points.len())?,
        style: self::style(style)?,
        seed,
        time_limit: seconds(time_limit)?,
        ..DesignOptions::default()
    };
    let watch = Watch::new(progress);
    let design = computing(py, || {
        let mut frames = of_rest(&mut rest, &views, &watch);
        frames.check(&rest, force)?;
        let mut design = designed(&rest, &frames, &options, &watch)?;
        move_from(frames.origin, &mut design.cage.vertices);
        Ok(design)
    })?;
    warn(py, &design.warnings, 1)?;
    mesh_arrays(py, &design.cage)
}

/// The frames of a rest pose, both about an origin of their own where it lies far away.
pub(crate) fn of_rest<'a>(rest: &mut Model, views: &'a [FrameView<'a>], watch: &'a Watch) -> Frames<'a> {
    let origin = own_origin(&rest.points);
    move_to(origin, &mut rest.points);
    let (points, numbers) = (rest.points.len(), [].into());
    Frames { views, name: "frames", points, frame_rate: None, numbers, origin, belonging: None, watch }
}

fn style(name: &str) -> Result<Style, Fault> {
    style_by_name(name)
        .ok_or_else(|| of("style", format!("there is no {name:?}; give one of {}", STYLES.map(style_name).join(", "))))
}

/// More than a clock counts is no limit.
fn seconds(limit: Option<f64>) -> Result<Option<Duration>, Fault> {
    match limit {
        Some(limit) if limit > 0.0 => {
            Ok(Duration::try_from_secs_f64(limit).ok().map(|limit| limit.max(Duration::from_nanos(1))))
        }
        Some(limit) => Err(of("time_limit", format!("is {limit}; give a number of seconds above 0"))),
        None => Ok(None),
    }
}

/// Coordinates of points in a cage: an array n × m, whose product with the vertices of the cage gives the points.
///
/// With kind "green" and "green-free" columns for the triangles of the cage follow those of its m vertices. They are multiplied with
/// the triangles' unit normals, each times the root of the mean area of all triangles. Of a cage of triangles, as those of
/// cager.design_cage and capture.cage_faces are (faces of more corners are cut into triangles from their first corner on):
///
///     normals = np.cross(*(cage_vertices[cage_faces[:, 1:]] - cage_vertices[cage_faces[:, :1]]).swapaxes(0, 1))
///     lengths = np.linalg.norm(normals, axis=1, keepdims=True)
///     points = phi @ np.vstack([cage_vertices, normals / lengths * np.sqrt(lengths.mean() / 2)])
///
/// To move the points with the cage, "green" takes the unit normals of the moved triangles, each also times its stretch; "green-free"
/// takes any. docs/FORMAT.md defines both under "Coordinate systems".
#[pyfunction]
#[pyo3(signature = (rest, cage_vertices, cage_faces, kind="mvc"))]
pub(crate) fn coordinates<'py>(
    py: Python<'py>,
    rest: &Bound<'py, PyAny>,
    cage_vertices: &Bound<'py, PyAny>,
    cage_faces: &Bound<'py, PyAny>,
    kind: &str,
) -> Result<Bound<'py, PyArray2<f64>>, Fault> {
    let mut rest = model(rest, None, ["rest", "faces"])?;
    let mut mesh = cage_mesh(cage_vertices, cage_faces)?;
    let system = system(kind, "kind")?;
    let phi = computing(py, || {
        interruptible(move || {
            let origin = own_origin(&rest.points);
            move_to(origin, &mut rest.points);
            move_to(origin, &mut mesh.vertices);
            let cage = cage(mesh)?;
            reject_far_points(&cage, &rest.points).map_err(|error| of("rest", error))?;
            let columns = system.values(&cage).columns();
            let needed =
                coordinates_bytes(rest.points.len(), columns, 2).saturating_add(system.working_bytes(&cage, None));
            if needed > free_bytes() {
                return Err(of(
                    "rest",
                    format!("its coordinates need {:.0} GB of memory; give fewer points", 1e-9 * needed as f64),
                ));
            }
            let phi = system.coordinates(&cage, &rest.points, None).map_err(|error| of("cage", error))?.phi;
            let values = (0..phi.ncols()).flat_map(|column| phi.col(column).iter().copied()).collect();
            Array2::from_shape_vec((phi.nrows(), phi.ncols()).f(), values)
                .map_err(|error| Fault::Told(error.to_string()))
        })
    })?;
    Ok(phi.into_pyarray(py))
}
