//! A capture in a container: its frames as arrays, its cages, and other cages in their place.

mod decoding;
mod layers;
mod parts;
mod stamp;

use self::layers::{check_name, told};
use self::stamp::{Stamp, stamp};
use crate::arguments;
use crate::arrays::{Floats, frame_arrays, frame_views};
use crate::export::export;
use crate::fault::{Fault, computing, detached, of, warn};
use crate::frames::Cages;
use crate::geometry::{array, triangles};
use crate::meaning;
use crate::own_file::OwnFile;
use cager_capture::decode::{self, Animation, DecodeError};
use cager_capture::edit::{self, Editing, edit};
use cager_capture::edited::EditedCages;
use cager_capture::origin::move_from;
use cager_formats::{Action, AtomicFile, Error, FrameReader, Target, commit_together};
use cager_geometry::mesh::{Model, Point, Polygons, TriMesh};
use cager_geometry::surface::Surface;
use cager_geometry::units::{Units, Up};
use cager_proto::container::EditLayer;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyRange, PySlice};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// A capture in a container.
#[pyclass(frozen, weakref, module = "cager")]
pub(crate) struct Capture {
    positions: Mutex<Option<Animation>>,
    path: PathBuf,
    stamp: Stamp,
    /// Of a capture that has no name yet.
    _temporary: Option<OwnFile>,
    rest: Model,
    /// What lies on its faces, and these in the order of the source.
    surface: Option<(Surface, Polygons)>,
    cage: TriMesh,
    origin: Option<Point>,
    rows: usize,
    frames: usize,
    frame_rate: Option<f64>,
    units: Units,
    numbers: Vec<f64>,
    edits: Vec<EditLayer>,
    report: String,
    pub(crate) warnings: Vec<String>,
}

/// Open a `.cager` file.
#[pyfunction]
pub(crate) fn open(py: Python<'_>, #[pyo3(from_py_with = arguments::path)] path: PathBuf) -> Result<Capture, Fault> {
    detached(py, || Capture::open(path, None))
}

impl Capture {
    /// Of a container that goes with the last capture of it.
    pub(crate) fn of_encoding(file: OwnFile) -> Result<Self, Fault> {
        Self::open(file.path().to_owned(), Some(file))
    }

    /// Tells Python of what the user should know of the encoding, `level` frames of the stack up.
    pub(crate) fn warn(&self, py: Python<'_>, level: i32) -> PyResult<()> {
        warn(py, &self.warnings, level)
    }

    fn open(path: PathBuf, temporary: Option<OwnFile>) -> Result<Self, Fault> {
        let fail = |cause| DecodeError::container(&path, cause);
        let mut container = decode::open(&path)?;
        let (rest, cage) = (container.rest().map_err(fail)?, container.cage().map_err(fail)?);
        let surface = container.surface().map_err(fail)?;
        let report = container.report().map_err(fail)?;
        let warnings = report.warnings.clone();
        let report = serde_json::to_string(&report).map_err(|error| of(path.display(), error))?;
        let header = container.header();
        let (origin, rows, frame_rate) = (header.origin, header.rows_per_frame as usize, header.frame_rate);
        let units = header.units;
        let numbers = container.frame_numbers().map_err(fail)?;
        let edits = container.layers().map_err(fail)?.to_vec();
        let (frames, positions, stamp) = (container.frames(), Mutex::new(None), stamp(&path)?);
        // It is opened again, perhaps from another working directory.
        let path = std::path::absolute(&path).unwrap_or(path);
        Ok(Self {
            positions,
            path,
            stamp,
            _temporary: temporary,
            rest,
            surface,
            cage,
            origin,
            rows,
            frames,
            frame_rate,
            units,
            numbers,
            edits,
            report,
            warnings,
        })
    }

    /// Opens the file once more, unless it is another one by now.
    fn again<T, E: Into<Fault>>(&self, open: impl FnOnce(&Path) -> Result<T, E>) -> Result<T, Fault> {
        let opened = open(&self.path).map_err(Into::into)?;
        if stamp(&self.path)? != self.stamp {
            return Err(of(self.path.display(), "has been written anew since it was opened; open it again"));
        }
        Ok(opened)
    }

    /// Moves points out of the coordinates of the origin, and makes an array of them.
    fn moved<'py>(&self, py: Python<'py>, points: &[Point]) -> Result<Bound<'py, PyArray2<f64>>, Fault> {
        let mut points = points.to_vec();
        move_from(self.origin, &mut points);
        array(py, points.into_flattened())
    }
}

/// These frames of a capture, one by one.
fn each<'py>(capture: &Bound<'py, Capture>, frames: &Bound<'py, PyRange>) -> PyResult<Bound<'py, PyAny>> {
    let decode = capture.getattr("__getitem__")?;
    capture.py().import("builtins")?.call_method1("map", (decode, frames))
}

#[pymethods]
impl Capture {
    fn __len__(&self) -> usize {
        self.frames
    }

    fn __repr__(&self) -> String {
        let points = self.rest.points.len();
        format!(
            "<cager.Capture of {} frames, {points} points, {} cage vertices>",
            self.frames,
            self.cage.vertices.len()
        )
    }

    fn __getitem__<'py>(&self, py: Python<'py>, frame: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Fault> {
        if let Ok(slice) = frame.cast::<PySlice>() {
            let range = slice.indices(self.frames as isize)?;
            let wanted: Vec<usize> =
                (0..range.slicelength as isize).map(|k| (range.start + k * range.step) as usize).collect();
            return self.decoded(py, &wanted);
        }
        let frame = self.numbered(frame)?;
        let positions = computing(py, || Ok(self.shown(self.read(&[frame])?.pop().unwrap_or_default())))?;
        positions.of_points(py)
    }

    /// Each frame in turn, decoded when it is asked for.
    fn __iter__<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let frames = this.get().frames as isize;
        each(this, &PyRange::new(this.py(), 0, frames)?)
    }

    fn __reversed__<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let frames = this.get().frames as isize;
        each(this, &PyRange::new_with_step(this.py(), frames - 1, -1, -1)?)
    }

    /// Itself, since nothing in it changes.
    fn __copy__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __deepcopy__(this: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        this
    }

    fn __reduce__(&self) -> PyResult<()> {
        let what = "a capture is not pickled, since its frames lie in a file; save it with capture.save(path), send the path, and open it there with cager.open(path)";
        Err(PyTypeError::new_err(what))
    }

    /// Decodes all frames into an array f × n × 3: a new one, or `out`.
    #[pyo3(signature = (out=None))]
    fn decode<'py>(&self, py: Python<'py>, out: Option<Bound<'py, PyAny>>) -> Result<Bound<'py, PyAny>, Fault> {
        let Some(out) = out else { return self.decoded(py, &(0..self.frames).collect::<Vec<_>>()) };
        self.decode_into(py, &out)?;
        Ok(out)
    }

    /// Writes the container; a file of that name is replaced only where `overwrite` says so.
    #[pyo3(signature = (path, overwrite=false))]
    fn save(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        overwrite: bool,
    ) -> Result<(), Fault> {
        detached(py, || {
            let read = |cause| Error::Io { path: self.path.clone(), action: Action::Read, cause };
            let mut from = self.again(|path| File::open(path).map_err(read))?;
            let mut file = AtomicFile::create(if overwrite {
                Target::Replacing(path.clone())
            } else {
                Target::New(path.clone())
            })?;
            // Errors of writing name the file already.
            let write = |cause| Error::Io { path, action: Action::Write, cause };
            io::copy(&mut from, &mut file).map_err(|cause| cause.downcast().unwrap_or_else(write))?;
            commit_together(vec![file])?;
            Ok(())
        })
    }

    /// Writes the frames in a format of other programs, the one of the path's ending; what the file loses is returned in words.
    #[pyo3(signature = (path, overwrite=false, with_cage=false, *, up=None, unit=None))]
    fn export(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        overwrite: bool,
        with_cage: bool,
        up: Option<&str>,
        unit: Option<&Bound<'_, PyAny>>,
    ) -> Result<Vec<String>, Fault> {
        let units = meaning::units(unit, up)?;
        computing(py, || self.again(|from| export(from, path, overwrite, with_cage, units)))
    }

    /// The model in a cage, m × 3: what the cage alone says of its n × 3 positions.
    fn pose<'py>(&self, py: Python<'py>, cage: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Fault> {
        let cage = Floats::new(cage, "cage")?.points()?;
        computing(py, || Ok(self.shown(self.read_pose(cage)?)))?.of_points(py)
    }

    /// The capture with other cages, f × m × 3, as after editing in another program: one more layer says what is moved.
    #[pyo3(signature = (edited, *, name=""))]
    fn with_cages(&self, py: Python<'_>, edited: &Bound<'_, PyAny>, name: &str) -> Result<Self, Fault> {
        check_name(name)?;
        let given = frame_arrays(edited, "cages")?;
        let views = frame_views(&given)?;
        let cages = views.iter().map(|view| {
            let mut cage = Vec::new();
            view.write_to(&mut cage);
            cage
        });
        let cages: Arc<[Vec<f64>]> = cages.collect();
        if cages.is_empty() {
            return Err(of("cages", "has no frames; give at least one"));
        }
        let rows = self.cage.vertices.len();
        self.rewritten(py, |container, target| {
            let reopen = move || {
                let reader: Box<dyn FrameReader> = Box::new(Cages { cages: cages.clone(), rows, next: 0 });
                Ok(reader)
            };
            let edited = EditedCages::of_frames(Path::new("cages"), &container, Box::new(reopen))?;
            let what = Editing { name, range: None };
            Ok(edit(container, &self.path, edited, &what, target, &mut |_| ())?.container)
        })
    }

    /// The layers of edits, in the order in which they are applied.
    #[getter]
    fn layers<'py>(&self, py: Python<'py>) -> Result<Vec<Bound<'py, PyDict>>, Fault> {
        self.edits.iter().map(|layer| told(py, layer)).collect()
    }

    /// The capture without a layer, the last one where none is named.
    #[pyo3(signature = (layer=-1))]
    fn remove_layer(&self, py: Python<'_>, layer: isize) -> Result<Self, Fault> {
        self.without_layer(py, layer)
    }

    /// The capture with a layer switched on or off.
    fn switch_layer(&self, py: Python<'_>, layer: isize, on: bool) -> Result<Self, Fault> {
        self.switched(py, layer, on)
    }

    /// The capture whose cages have the layers in them that are on, and which has no layers.
    fn flatten(&self, py: Python<'_>) -> Result<Self, Fault> {
        self.rewritten(py, |container, target| Ok(edit::flattened(container, &self.path, None, target)?))
    }

    /// The cage of every frame: f × m × 3.
    #[getter]
    fn cages<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Fault> {
        let shape = [self.frames, self.cage.vertices.len(), 3];
        computing(py, || Ok(self.shown(self.read_cages()?)))?.of_shape(py, shape)
    }

    /// Triangles of the cage: k × 3.
    #[getter]
    fn cage_faces<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<i64>>, Fault> {
        triangles(py, &self.cage.triangles)
    }

    /// Vertices of the cage around the rest pose: m × 3.
    #[getter]
    fn rest_cage<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<f64>>, Fault> {
        self.moved(py, &self.cage.vertices)
    }

    /// Points of the rest pose: n × 3.
    #[getter]
    fn rest<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<f64>>, Fault> {
        self.moved(py, &self.rest.points)
    }

    /// Faces of the model: k × 3 or k × 4 where all have as many vertices, else a list of arrays.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Fault> {
        let faces = &self.rest.faces;
        let corners = faces.arities().first().copied().unwrap_or(3) as usize;
        if faces.arities().iter().all(|&arity| arity as usize == corners) {
            let indices: Vec<i64> = faces.indices().iter().map(|&vertex| i64::from(vertex)).collect();
            return Ok(indices.into_pyarray(py).reshape([faces.len(), corners])?.into_any());
        }
        let each = faces.iter().map(|face| PyArray1::from_iter(py, face.iter().map(|&vertex| i64::from(vertex))));
        Ok(PyList::new(py, each.collect::<Vec<_>>())?.into_any())
    }

    /// The meshes that the model is made of, with what lies on their faces in the order of the source: dictionaries of path, points (first and
    /// last + 1), face_counts, face_points (of the part's own points), uvs, colors (by corner), materials (of faces; -1 for none) and shown.
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> Result<Vec<Bound<'py, PyDict>>, Fault> {
        self.surface.as_ref().map_or(Ok(Vec::new()), |surface| parts::parts(py, surface))
    }

    /// The materials that parts count: name, base_color, opacity, roughness, metalness, textures and texture_sequences.
    #[getter]
    fn materials<'py>(&self, py: Python<'py>) -> Result<Vec<Bound<'py, PyDict>>, Fault> {
        self.surface.as_ref().map_or(Ok(Vec::new()), |(surface, _)| parts::materials(py, surface))
    }

    /// Frames per second, where known.
    #[getter]
    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    /// Metres of one unit of its positions, where known.
    #[getter]
    fn unit(&self) -> Option<f64> {
        self.units.metres_per_unit
    }

    /// The axis that points up, where known.
    #[getter]
    fn up(&self) -> Option<&'static str> {
        self.units.up.map(Up::name)
    }

    /// The number of each frame where it comes from: f.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.numbers)
    }

    /// Sizes, errors and warnings of the encoding.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (&self.report,))
    }
}
