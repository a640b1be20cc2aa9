//! A capture in a container: its frames as arrays, its cages, and other cages in their place.

use crate::arrays::{Floats, frame_arrays, frame_views};
use crate::export::export;
use crate::fault::{Fault, computing, detached, of};
use crate::frames::Cages;
use crate::geometry::{array, triangles};
use cager_capture::decode::{self, DecodeError, Positions};
use cager_capture::edit::edit;
use cager_capture::edited::EditedCages;
use cager_capture::origin::{move_from, move_to};
use cager_formats::{Action, AtomicFile, Error, FrameReader, Target, commit_together};
use cager_geometry::mesh::{Model, Point, TriMesh};
use numpy::ndarray::{ArrayViewMut3, Axis};
use numpy::{BorrowError, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyIndexError, PyOverflowError, PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::{PyList, PySlice};
use std::ffi::CString;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;
use tempfile::{NamedTempFile, TempPath};

/// Frames that are decoded at a time, in bytes.
const BATCH_BYTES: usize = 64 << 20;

/// A capture in a container.
#[pyclass(frozen, module = "cager")]
pub(crate) struct Capture {
    positions: Mutex<Option<Positions>>,
    path: PathBuf,
    stamp: Stamp,
    /// Of a capture that has no name yet.
    _temporary: Option<TempPath>,
    rest: Model,
    cage: TriMesh,
    origin: Option<Point>,
    rows: usize,
    frames: usize,
    frame_rate: Option<f64>,
    report: String,
    warnings: Vec<String>,
}

/// Open a `.cager` file.
#[pyfunction]
pub(crate) fn open(py: Python<'_>, path: PathBuf) -> Result<Capture, Fault> {
    detached(py, || Capture::open(path, None))
}

impl Capture {
    /// Of a container that goes with the last capture of it.
    pub(crate) fn of_encoding(path: TempPath) -> Result<Self, Fault> {
        Self::open(path.to_path_buf(), Some(path))
    }

    /// Tells Python of what the user should know of the encoding, `level` frames of the stack up.
    pub(crate) fn warn(&self, py: Python<'_>, level: i32) -> PyResult<()> {
        self.warnings.iter().try_for_each(|words| {
            let words = CString::new(words.replace('\0', ""))?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &words, level)
        })
    }

    fn open(path: PathBuf, temporary: Option<TempPath>) -> Result<Self, Fault> {
        let fail = |cause| DecodeError::container(&path, cause);
        let mut container = decode::open(&path)?;
        let (rest, cage) = (container.rest().map_err(fail)?, container.cage().map_err(fail)?);
        let report = container.report().map_err(fail)?;
        let warnings = report.warnings.clone();
        let report = serde_json::to_string(&report).map_err(|error| of(path.display(), error))?;
        let header = container.header();
        let (origin, rows, frame_rate) = (header.origin, header.rows_per_frame as usize, header.frame_rate);
        let (frames, positions, stamp) = (container.frames(), Mutex::new(None), stamp(&path)?);
        // It is opened again, perhaps from another working directory.
        let path = std::path::absolute(&path).unwrap_or(path);
        Ok(Self {
            positions,
            path,
            stamp,
            _temporary: temporary,
            rest,
            cage,
            origin,
            rows,
            frames,
            frame_rate,
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

    /// Works with the decoder, which is prepared when it is needed first.
    fn decoding<T>(&self, work: impl FnOnce(&mut Positions) -> Result<T, Fault>) -> Result<T, Fault> {
        let mut positions = self.positions.lock().unwrap_or_else(PoisonError::into_inner);
        work(match &mut *positions {
            Some(there) => there,
            none => none.insert(self.again(Positions::open)?),
        })
    }

    /// Positions of these frames in single precision, about the origin.
    fn read(&self, frames: &[usize]) -> Result<Vec<Vec<f32>>, Fault> {
        self.decoding(|positions| Ok(positions.read(frames)?))
    }

    /// Positions in a cage, both in single precision and about the origin.
    fn read_pose(&self, mut cage: Vec<Point>) -> Result<Vec<f32>, Fault> {
        let (vertices, rows) = (self.cage.vertices.len(), self.rows);
        if rows != vertices {
            return Err(of(
                "cage",
                "has no normals, which this capture keeps for every face beside the vertices; encode it with the coordinates \"green\" or \"mvc\" to pose it",
            ));
        }
        if cage.len() != vertices {
            return Err(of(
                "cage",
                format!(
                    "has {} vertices where the capture's has {vertices}; give as many, in the order of capture.cages",
                    cage.len()
                ),
            ));
        }
        move_to(self.origin, &mut cage);
        let single: Vec<f32> = cage.as_flattened().iter().map(|&x| x as f32).collect();
        if let Some(at) = single.iter().position(|x| !x.is_finite()) {
            return Err(of("cage", format!("vertex {} is too far away for single precision; move it closer", at / 3)));
        }
        self.decoding(|positions| Ok(positions.of_cage(&single)))
    }

    /// The cages of these frames, vertices × 3 each, about the origin.
    fn read_cages(&self) -> Result<Vec<f32>, Fault> {
        let mut container = self.again(decode::open)?;
        let (mut all, mut cage) = (Vec::with_capacity(3 * self.cage.vertices.len() * self.frames), Vec::new());
        for frame in 0..self.frames {
            container.read_frame(frame, &mut cage).map_err(|cause| DecodeError::container(&self.path, cause))?;
            all.extend_from_slice(&cage[..3 * self.cage.vertices.len()]);
        }
        Ok(all)
    }

    /// Positions about the origin as the user gets them: single precision, or double precision where the capture lies far away.
    fn shown(&self, positions: Vec<f32>) -> Shown {
        let Some(origin) = self.origin else { return Shown::Single(positions) };
        let mut wide: Vec<f64> = positions.into_iter().map(f64::from).collect();
        move_from(Some(origin), wide.as_chunks_mut().0);
        Shown::Double(wide)
    }

    /// Decodes frames batch by batch, each told to `take` with the place of its first.
    fn decode_in_batches(
        &self,
        py: Python<'_>,
        wanted: &[usize],
        mut take: impl FnMut(usize, Vec<Vec<f32>>) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let batch = (BATCH_BYTES / (12 * self.rest.points.len().max(1))).clamp(1, 64);
        for (k, frames) in wanted.chunks(batch).enumerate() {
            take(k * batch, computing(py, || self.read(frames))?)?;
            py.check_signals()?;
        }
        Ok(())
    }

    /// Frames as one array f × n × 3.
    fn decoded<'py>(&self, py: Python<'py>, wanted: &[usize]) -> Result<Bound<'py, PyAny>, Fault> {
        let shape = [wanted.len(), self.rest.points.len(), 3];
        if self.origin.is_some() {
            let out = PyArray3::<f64>::zeros(py, shape, false);
            self.fill_double(py, wanted, &mut out.readwrite().as_array_mut())?;
            return Ok(out.into_any());
        }
        let out = PyArray3::<f32>::zeros(py, shape, false);
        self.fill_single(py, wanted, &mut out.readwrite().as_array_mut())?;
        Ok(out.into_any())
    }

    fn fill_single(&self, py: Python<'_>, wanted: &[usize], out: &mut ArrayViewMut3<'_, f32>) -> Result<(), Fault> {
        let origin = self.origin.unwrap_or_default();
        self.decode_in_batches(py, wanted, |first, frames| {
            for (k, frame) in frames.iter().enumerate() {
                let mut place = out.index_axis_mut(Axis(0), first + k);
                for (i, (to, from)) in place.iter_mut().zip(frame).enumerate() {
                    *to = (f64::from(*from) + origin[i % 3]) as f32;
                }
            }
            Ok(())
        })
    }

    fn fill_double(&self, py: Python<'_>, wanted: &[usize], out: &mut ArrayViewMut3<'_, f64>) -> Result<(), Fault> {
        let origin = self.origin.unwrap_or_default();
        self.decode_in_batches(py, wanted, |first, frames| {
            for (k, frame) in frames.iter().enumerate() {
                let mut place = out.index_axis_mut(Axis(0), first + k);
                for (i, (to, from)) in place.iter_mut().zip(frame).enumerate() {
                    *to = f64::from(*from) + origin[i % 3];
                }
            }
            Ok(())
        })
    }

    /// Moves points out of the coordinates of the origin, and makes an array of them.
    fn moved<'py>(&self, py: Python<'py>, points: &[Point]) -> Result<Bound<'py, PyArray2<f64>>, Fault> {
        let mut points = points.to_vec();
        move_from(self.origin, &mut points);
        array(py, points.into_flattened())
    }
}

/// An empty file for a container that has no name yet.
pub(crate) fn temporary() -> Result<NamedTempFile, Fault> {
    let made = tempfile::Builder::new().prefix("cager-").suffix(".cager").tempfile();
    made.map_err(|error| {
        of("the folder of temporary files", format!("cannot be written to ({error}); set TMPDIR to another"))
    })
}

/// What tells a file from one that was written in its place: its length, and when it was written.
type Stamp = (u64, Option<SystemTime>);

fn stamp(path: &Path) -> Result<Stamp, Fault> {
    let found = std::fs::metadata(path);
    let found = found.map_err(|cause| Error::Io { path: path.to_owned(), action: Action::Read, cause })?;
    Ok((found.len(), found.modified().ok()))
}

/// Coordinates as Python gets them.
enum Shown {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

impl Shown {
    fn of_shape<'py>(self, py: Python<'py>, shape: [usize; 3]) -> Result<Bound<'py, PyAny>, Fault> {
        Ok(match self {
            Self::Single(values) => values.into_pyarray(py).reshape(shape)?.into_any(),
            Self::Double(values) => values.into_pyarray(py).reshape(shape)?.into_any(),
        })
    }

    fn of_points(self, py: Python<'_>) -> Result<Bound<'_, PyAny>, Fault> {
        Ok(match self {
            Self::Single(values) => array(py, values)?.into_any(),
            Self::Double(values) => array(py, values)?.into_any(),
        })
    }
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
        let number = match frame.extract::<isize>() {
            Ok(number) => Some(number),
            Err(error) if error.is_instance_of::<PyOverflowError>(py) => None,
            Err(_) => {
                return Err(PyTypeError::new_err("frames are numbered by integers; give one, or a slice").into());
            }
        };
        let counted = number.map(|number| if number < 0 { number + self.frames as isize } else { number });
        let Some(frame) =
            counted.and_then(|number| usize::try_from(number).ok()).filter(|&number| number < self.frames)
        else {
            let what = format!("there is no frame {frame}; the capture has {}, counted from 0", self.frames);
            return Err(PyIndexError::new_err(what).into());
        };
        let positions = computing(py, || Ok(self.shown(self.read(&[frame])?.pop().unwrap_or_default())))?;
        positions.of_points(py)
    }

    /// Decodes all frames into an array f × n × 3: a new one, or `out`.
    #[pyo3(signature = (out=None))]
    fn decode<'py>(&self, py: Python<'py>, out: Option<Bound<'py, PyAny>>) -> Result<Bound<'py, PyAny>, Fault> {
        let wanted: Vec<usize> = (0..self.frames).collect();
        let Some(out) = out else { return self.decoded(py, &wanted) };
        let shape = [self.frames, self.rest.points.len(), 3];
        let refused = || of("out", format!("give a writable array of the shape {shape:?}, of float32 or float64"));
        let flags = out.getattr("flags").and_then(|flags| flags.getattr("aligned")?.extract::<bool>());
        if !flags.is_ok_and(|aligned| aligned) || out.getattr("shape")?.extract::<Vec<usize>>()? != shape {
            return Err(refused());
        }
        let unwritable = |error| match error {
            BorrowError::AlreadyBorrowed => {
                of("out", "is in use by another call; wait for that, or give another array")
            }
            _ => refused(),
        };
        if let Ok(single) = out.cast::<PyArray3<f32>>() {
            let mut single = single.try_readwrite().map_err(unwritable)?;
            self.fill_single(py, &wanted, &mut single.as_array_mut())?;
        } else {
            let double = out.cast::<PyArray3<f64>>().map_err(|_| refused())?;
            let mut double = double.try_readwrite().map_err(unwritable)?;
            self.fill_double(py, &wanted, &mut double.as_array_mut())?;
        }
        Ok(out)
    }

    /// Writes the container; a file of that name is replaced only where `overwrite` says so.
    #[pyo3(signature = (path, overwrite=false))]
    fn save(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> Result<(), Fault> {
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
    #[pyo3(signature = (path, overwrite=false, with_cage=false))]
    fn export(&self, py: Python<'_>, path: PathBuf, overwrite: bool, with_cage: bool) -> Result<Vec<String>, Fault> {
        computing(py, || self.again(|from| export(from, &path, overwrite, with_cage)))
    }

    /// The model in a cage, m × 3: what the cage alone says of its n × 3 positions.
    fn pose<'py>(&self, py: Python<'py>, cage: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Fault> {
        let cage = Floats::new(cage, "cage")?.points()?;
        computing(py, || Ok(self.shown(self.read_pose(cage)?)))?.of_points(py)
    }

    /// The capture with other cages, f × m × 3, as after editing in another program.
    fn with_cages(&self, py: Python<'_>, edited: &Bound<'_, PyAny>) -> Result<Self, Fault> {
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
        let rows = self.rows;
        computing(py, || {
            let container = self.again(decode::open)?;
            let reopen = move || {
                let reader: Box<dyn FrameReader> = Box::new(Cages { cages: cages.clone(), rows, next: 0 });
                Ok(reader)
            };
            let edited = EditedCages::of_frames(Path::new("cages"), &container, Box::new(reopen))?;
            let path = temporary()?.into_temp_path();
            let made = edit(container, &self.path, edited, &Target::Replacing(path.to_path_buf()), &mut |_| ())?;
            commit_together(vec![made.container])?;
            Self::of_encoding(path)
        })
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

    /// Frames per second, where known.
    #[getter]
    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    /// Sizes, errors and warnings of the encoding.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (&self.report,))
    }
}
