//! The frames and cages of a capture, decoded into arrays.

use super::Capture;
use crate::apart::interruptible;
use crate::fault::{Fault, computing, of};
use crate::geometry::array;
use cager_capture::decode::{self, Animation, DecodeError};
use cager_capture::origin::{move_from, move_to};
use cager_geometry::mesh::Point;
use numpy::ndarray::{ArrayViewMut3, Axis};
use numpy::{BorrowError, IntoPyArray, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use std::sync::PoisonError;

/// Frames that are decoded at a time, in bytes.
const BATCH_BYTES: usize = 64 << 20;

impl Capture {
    /// Works with the decoder, which is prepared when it is needed first.
    fn decoding<T>(&self, work: impl FnOnce(&mut Animation) -> Result<T, Fault>) -> Result<T, Fault> {
        let mut positions = self.positions.lock().unwrap_or_else(PoisonError::into_inner);
        work(match &mut *positions {
            Some(there) => there,
            none => none.insert(self.again(|path| {
                let path = path.to_owned();
                interruptible(move || Ok(Animation::open(&path)?))
            })?),
        })
    }

    /// The frame that has this number, counted from the end where it is negative.
    pub(super) fn numbered(&self, frame: &Bound<'_, PyAny>) -> Result<usize, Fault> {
        let number = match frame.extract::<isize>() {
            Ok(number) => Some(number),
            Err(error) if error.is_instance_of::<PyOverflowError>(frame.py()) => None,
            Err(_) => {
                return Err(PyTypeError::new_err("frames are numbered by integers; give one, or a slice").into());
            }
        };
        let counted = number.map(|number| if number < 0 { number + self.frames as isize } else { number });
        let there = counted.and_then(|number| usize::try_from(number).ok()).filter(|&number| number < self.frames);
        there.ok_or_else(|| {
            let what = format!("there is no frame {frame}; the capture has {}, counted from 0", self.frames);
            PyIndexError::new_err(what).into()
        })
    }

    /// Positions of these frames in single precision, about the origin.
    pub(super) fn read(&self, frames: &[usize]) -> Result<Vec<Vec<f32>>, Fault> {
        self.decoding(|positions| Ok(positions.read(frames)?))
    }

    /// Positions in a cage, both in single precision and about the origin.
    pub(super) fn read_pose(&self, mut cage: Vec<Point>) -> Result<Vec<f32>, Fault> {
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
    pub(super) fn read_cages(&self) -> Result<Vec<f32>, Fault> {
        let mut container = self.again(decode::open)?;
        let (mut all, mut cage) = (Vec::with_capacity(3 * self.cage.vertices.len() * self.frames), Vec::new());
        for frame in 0..self.frames {
            container.read_frame(frame, &mut cage).map_err(|cause| DecodeError::container(&self.path, cause))?;
            all.extend_from_slice(&cage[..3 * self.cage.vertices.len()]);
        }
        Ok(all)
    }

    /// Positions about the origin as the user gets them: single precision, or double precision where the capture lies far away.
    pub(super) fn shown(&self, positions: Vec<f32>) -> Shown {
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
    pub(super) fn decoded<'py>(&self, py: Python<'py>, wanted: &[usize]) -> Result<Bound<'py, PyAny>, Fault> {
        let shape = [wanted.len(), self.rest.points.len(), 3];
        if self.origin.is_some() {
            let out = PyArray3::<f64>::zeros(py, shape, false);
            self.fill(py, wanted, &mut out.readwrite().as_array_mut(), |x| x)?;
            return Ok(out.into_any());
        }
        let out = PyArray3::<f32>::zeros(py, shape, false);
        self.fill(py, wanted, &mut out.readwrite().as_array_mut(), |x| x as f32)?;
        Ok(out.into_any())
    }

    /// Fills an array that was given, with all frames.
    pub(super) fn decode_into(&self, py: Python<'_>, out: &Bound<'_, PyAny>) -> Result<(), Fault> {
        let wanted: Vec<usize> = (0..self.frames).collect();
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
            check_places(single.strides(), shape, size_of::<f32>())?;
            self.check_precision()?;
            let mut single = single.try_readwrite().map_err(unwritable)?;
            return self.fill(py, &wanted, &mut single.as_array_mut(), |x| x as f32);
        }
        let double = out.cast::<PyArray3<f64>>().map_err(|_| refused())?;
        check_places(double.strides(), shape, size_of::<f64>())?;
        let mut double = double.try_readwrite().map_err(unwritable)?;
        self.fill(py, &wanted, &mut double.as_array_mut(), |x| x)
    }

    /// Refuses single precision where files of it are refused.
    fn check_precision(&self) -> Result<(), Fault> {
        let farthest = self.origin.iter().flatten().fold(0.0, |far: f64, x| far.max(x.abs()));
        let lost = 3f64.sqrt() * farthest * f64::from(f32::EPSILON) / 2.0;
        if lost == 0.0 {
            return Ok(());
        }
        let allowed = self.decoding(|positions| Ok(positions.may_lose()?))?;
        if lost <= allowed {
            return Ok(());
        }
        let what = format!(
            "holds single precision, which moves points by up to {lost:.1e} units so far from the origin, where {allowed:.1e} are allowed; give an array of float64"
        );
        Err(of("out", what))
    }

    fn fill<T>(
        &self,
        py: Python<'_>,
        wanted: &[usize],
        out: &mut ArrayViewMut3<'_, T>,
        rounded: fn(f64) -> T,
    ) -> Result<(), Fault> {
        let origin = self.origin.unwrap_or_default();
        self.decode_in_batches(py, wanted, |first, frames| {
            for (k, frame) in frames.iter().enumerate() {
                let mut place = out.index_axis_mut(Axis(0), first + k);
                for (i, (to, from)) in place.iter_mut().zip(frame).enumerate() {
                    *to = rounded(f64::from(*from) + origin[i % 3]);
                }
            }
            Ok(())
        })
    }
}

/// Refuses arrays in which one number would overwrite another: along each axis, the shortest steps first, a step must not end within what the axes
/// before it span.
fn check_places(strides: &[isize], shape: [usize; 3], size: usize) -> Result<(), Fault> {
    let mut axes: Vec<(usize, usize)> = strides.iter().map(|step| step.unsigned_abs()).zip(shape).collect();
    axes.retain(|&(_, count)| count > 1);
    axes.sort_unstable();
    let mut span = size;
    for (step, count) in axes {
        if step < span {
            return Err(of(
                "out",
                "has numbers that share their places; give an array in which each has its own, such as one of numpy.empty",
            ));
        }
        span += step * (count - 1);
    }
    Ok(())
}

/// Coordinates as Python gets them.
pub(super) enum Shown {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

impl Shown {
    pub(super) fn of_shape<'py>(self, py: Python<'py>, shape: [usize; 3]) -> Result<Bound<'py, PyAny>, Fault> {
        Ok(match self {
            Self::Single(values) => values.into_pyarray(py).reshape(shape)?.into_any(),
            Self::Double(values) => values.into_pyarray(py).reshape(shape)?.into_any(),
        })
    }

    pub(super) fn of_points(self, py: Python<'_>) -> Result<Bound<'_, PyAny>, Fault> {
        Ok(match self {
            Self::Single(values) => array(py, values)?.into_any(),
            Self::Double(values) => array(py, values)?.into_any(),
        })
    }
}
