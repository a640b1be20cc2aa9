//! Arrays of numpy as they are given, read where they lie: single or double precision, in any memory order.

use crate::fault::{Fault, of};
use cager_geometry::mesh::{Model, Point, Polygons};
use numpy::ndarray::{ArrayView2, ArrayView3, ArrayViewD, Axis, Ix2, Ix3};
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;

/// An array of floats, and the name of the argument that it came in.
pub(crate) struct Floats<'py> {
    values: Values<'py>,
    name: String,
}

enum Values<'py> {
    Single(PyReadonlyArrayDyn<'py, f32>),
    Double(PyReadonlyArrayDyn<'py, f64>),
}

/// One frame: n × 3.
#[derive(Clone)]
pub(crate) enum FrameView<'a> {
    Single(ArrayView2<'a, f32>),
    Double(ArrayView2<'a, f64>),
}

impl FrameView<'_> {
    /// Number of points.
    pub(crate) fn points(&self) -> usize {
        match self {
            Self::Single(view) => view.nrows(),
            Self::Double(view) => view.nrows(),
        }
    }

    /// Coordinates `x y z x y z …`.
    pub(crate) fn write_to(&self, out: &mut Vec<f64>) {
        out.clear();
        match self {
            Self::Single(view) => out.extend(view.iter().map(|&x| f64::from(x))),
            Self::Double(view) => match view.as_slice() {
                Some(values) => out.extend_from_slice(values),
                None => out.extend(view.iter()),
            },
        }
    }
}

impl<'py> Floats<'py> {
    /// What numpy makes an array of; anything but floats in the machine's byte order is converted.
    pub(crate) fn new(value: &Bound<'py, PyAny>, name: impl Into<String>) -> Result<Self, Fault> {
        let name = name.into();
        let py = value.py();
        let numpy = py.import("numpy")?;
        let array = numpy.call_method1("asarray", (value,)).map_err(|error| unreadable(py, &name, error))?;
        let dtype = array.getattr("dtype")?;
        if !["f", "i", "u", "b"].contains(&dtype.getattr("kind")?.extract::<String>()?.as_str()) {
            return Err(of(&name, format!("has elements of the type {dtype}; give numbers, such as float32")));
        }
        let is_aligned: bool = array.getattr("flags")?.getattr("aligned")?.extract()?;
        let array = match array.cast::<PyArrayDyn<f32>>() {
            Ok(single) if is_aligned => {
                let values = single.try_readonly().map_err(|_| written_elsewhere(&name))?;
                return Ok(Self { values: Values::Single(values), name });
            }
            _ if is_aligned && array.cast::<PyArrayDyn<f64>>().is_ok() => array,
            _ => numpy.call_method1("array", (&array, "float64"))?,
        };
        let double = array.cast_into::<PyArrayDyn<f64>>().map_err(|error| unreadable(py, &name, error.into()))?;
        let values = double.try_readonly().map_err(|_| written_elsewhere(&name))?;
        Ok(Self { values: Values::Double(values), name })
    }

    /// The array itself, for Python.
    pub(crate) fn array(&self) -> &Bound<'py, PyAny> {
        match &self.values {
            Values::Single(array) => array.as_any(),
            Values::Double(array) => array.as_any(),
        }
    }

    fn shape(&self) -> &[usize] {
        match &self.values {
            Values::Single(array) => array.shape(),
            Values::Double(array) => array.shape(),
        }
    }

    fn refuse(&self, wanted: &str) -> Fault {
        let shape: Vec<String> = self.shape().iter().map(ToString::to_string).collect();
        let shape =
            if shape.is_empty() { "a single number".to_owned() } else { format!("the shape {}", shape.join(" × ")) };
        of(&self.name, format!("has {shape}; give {wanted}"))
    }

    /// Of an array n × 3.
    pub(crate) fn frame(&self) -> Result<FrameView<'_>, Fault> {
        let refused = || self.refuse("an array of n × 3 coordinates");
        let view = match &self.values {
            Values::Single(array) => fixed2(array.as_array()).map(FrameView::Single),
            Values::Double(array) => fixed2(array.as_array()).map(FrameView::Double),
        };
        view.ok_or_else(refused)
    }

    /// Of an array f × n × 3.
    pub(crate) fn frames(&self) -> Result<Vec<FrameView<'_>>, Fault> {
        let refused = || self.refuse("an array of f × n × 3 coordinates, or one array of n × 3 for each frame");
        let views = match &self.values {
            Values::Single(array) => fixed3(array.as_array()).map(|all| each(&all).map(FrameView::Single).collect()),
            Values::Double(array) => fixed3(array.as_array()).map(|all| each(&all).map(FrameView::Double).collect()),
        };
        views.ok_or_else(refused)
    }

    /// Of an array of one dimension.
    pub(crate) fn numbers(&self) -> Result<Vec<f64>, Fault> {
        match (&self.values, self.shape().len()) {
            (Values::Single(array), 1) => Ok(array.as_array().iter().map(|&x| f64::from(x)).collect()),
            (Values::Double(array), 1) => Ok(array.as_array().iter().copied().collect()),
            _ => Err(self.refuse("a list of numbers")),
        }
    }

    /// Of an array n × 3 whose coordinates are finite.
    pub(crate) fn points(&self) -> Result<Vec<Point>, Fault> {
        let mut values = Vec::new();
        self.frame()?.write_to(&mut values);
        if let Some(at) = values.iter().position(|x| !x.is_finite()) {
            let what =
                format!("point {} has a coordinate that is NaN or infinite; repair it or leave the point out", at / 3);
            return Err(of(&self.name, what));
        }
        Ok(values.as_chunks().0.to_vec())
    }
}

fn fixed2<T>(view: ArrayViewD<'_, T>) -> Option<ArrayView2<'_, T>> {
    view.into_dimensionality::<Ix2>().ok().filter(|view| view.ncols() == 3)
}

fn fixed3<T>(view: ArrayViewD<'_, T>) -> Option<ArrayView3<'_, T>> {
    view.into_dimensionality::<Ix3>().ok().filter(|view| view.dim().2 == 3)
}

fn each<'a, T>(all: &ArrayView3<'a, T>) -> impl Iterator<Item = ArrayView2<'a, T>> {
    let all = *all;
    (0..all.dim().0).map(move |frame| all.index_axis_move(Axis(0), frame))
}

/// What numpy or the object itself says of its values; an interrupt, or too little memory, is passed on.
fn unreadable(py: Python<'_>, name: &str, error: PyErr) -> Fault {
    if !error.is_instance_of::<PyTypeError>(py) && !error.is_instance_of::<PyValueError>(py) {
        return Fault::Raised(error);
    }
    of(name, format!("cannot be read as an array of numbers ({error}); give an array of numpy"))
}

fn written_elsewhere(name: &str) -> Fault {
    of(name, "is being written to by another call; wait for that, or give a copy")
}

/// The frames of a capture: one array f × n × 3, or any iterable of arrays n × 3, which is read to its end first.
pub(crate) fn frame_arrays<'py>(value: &Bound<'py, PyAny>, name: &str) -> Result<(Vec<Floats<'py>>, bool), Fault> {
    if value.hasattr("__array__")? {
        return Ok((vec![Floats::new(value, name)?], true));
    }
    let refused = || of(name, "are no frames; give an array of f × n × 3, or an iterable of arrays of n × 3");
    if value.is_instance_of::<PyString>() {
        return Err(refused());
    }
    let all = value.try_iter().map_err(|_| refused())?;
    let each = all.enumerate().map(|(frame, array)| Floats::new(&array?, format!("{name}[{frame}]")));
    Ok((each.collect::<Result<_, Fault>>()?, false))
}

/// A view of each frame of [`frame_arrays`].
pub(crate) fn frame_views<'a>((arrays, whole): &'a (Vec<Floats<'_>>, bool)) -> Result<Vec<FrameView<'a>>, Fault> {
    match arrays.as_slice() {
        [all] if *whole => all.frames(),
        each => each.iter().map(Floats::frame).collect(),
    }
}

/// Faces: an array k × 3 or k × 4, or lists of vertices; their vertices are counted from 0, and there are so many.
pub(crate) fn faces(value: &Bound<'_, PyAny>, points: usize, name: &str) -> Result<Polygons, Fault> {
    let refused = || of(name, "are no faces; give whole numbers, k × 3 or k × 4, or a list of vertices for each face");
    let mut polygons = Polygons::new();
    let rows = if value.hasattr("tolist")? { value.call_method0("tolist")? } else { value.clone() };
    for (face, row) in rows.try_iter().map_err(|_| refused())?.enumerate() {
        let corners: Vec<i64> = row?
            .try_iter()
            .and_then(|corners| corners.map(|corner| corner?.extract()).collect())
            .map_err(|_: PyErr| refused())?;
        if corners.len() < 3 {
            return Err(of(name, format!("face {face} has {} vertices; a face has three at least", corners.len())));
        }
        let corners =
            corners.iter().map(|&vertex| u32::try_from(vertex).ok().filter(|&v| (v as usize) < points).ok_or(vertex));
        let corners = corners.collect::<Result<Vec<u32>, i64>>().map_err(|vertex| {
            of(name, format!("face {face} names vertex {vertex}, but there are {points}, counted from 0; give the faces of this mesh"))
        })?;
        polygons.push(&corners);
    }
    Ok(polygons)
}

/// A mesh of points and faces; without faces where `None` is given for them.
pub(crate) fn model(
    points: &Bound<'_, PyAny>,
    faces_of: Option<&Bound<'_, PyAny>>,
    [name, faces_name]: [&str; 2],
) -> Result<Model, Fault> {
    let points = Floats::new(points, name)?.points()?;
    if points.is_empty() {
        return Err(of(name, "has no points; give the model in its rest pose"));
    }
    let faces = faces_of.map_or(Ok(Polygons::new()), |given| faces(given, points.len(), faces_name))?;
    Ok(Model { points, faces, ..Model::default() })
}
