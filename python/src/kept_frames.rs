//! Frames in arrays that Python keeps while they are sent, read one by one on any thread.

use crate::arrays::{Floats, frame_arrays};
use crate::fault::Fault;
use cager_capture::origin::move_to;
use cager_client::FrameSource;
use cager_geometry::mesh::Point;
use pyo3::prelude::*;
use pyo3::types::PyList;
use std::io;

/// An array f × n × 3, or a list of arrays n × 3.
pub(crate) struct KeptFrames {
    arrays: Py<PyAny>,
    frames: usize,
    points: usize,
    /// What is subtracted from all positions.
    pub(crate) origin: Option<Point>,
    next: usize,
    wide: Vec<f64>,
}

impl KeptFrames {
    /// The frames of an argument, each of so many points.
    pub(crate) fn new(value: &Bound<'_, PyAny>, name: &str, points: usize) -> Result<Self, Fault> {
        let (arrays, whole) = frame_arrays(value, name)?;
        let arrays = match arrays.as_slice() {
            [all] if whole => all.array().clone(),
            each => PyList::new(value.py(), each.iter().map(Floats::array))?.into_any(),
        };
        // One of no dimension has no length, and is refused where its frames are read.
        let frames = arrays.len().unwrap_or(0);
        Ok(Self { arrays: arrays.unbind(), frames, points, origin: None, next: 0, wide: Vec::new() })
    }

    /// For [`frame_arrays`].
    pub(crate) fn arrays<'py>(&self, py: Python<'py>) -> &Bound<'py, PyAny> {
        self.arrays.bind(py)
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.frames
    }

    fn read_wide(&mut self) -> Result<(), Fault> {
        Python::try_attach(|py| {
            let array = self.arrays.bind(py).get_item(self.next)?;
            Floats::new(&array, format!("frames[{}]", self.next))?.frame()?.write_to(&mut self.wide);
            Ok(())
        })
        .unwrap_or_else(|| Err(Fault::Told("Python has ended".to_owned())))
    }
}

impl FrameSource for KeptFrames {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> Option<u32> {
        u32::try_from(self.frames).ok()
    }

    fn seek(&mut self, frame: u32) -> io::Result<()> {
        self.next = frame as usize;
        Ok(())
    }

    fn read(&mut self, out: &mut Vec<f32>) -> io::Result<bool> {
        out.clear();
        if self.next >= self.frames {
            return Ok(false);
        }
        self.read_wide().map_err(|fault| match fault {
            Fault::Told(words) => io::Error::other(words),
            Fault::Raised(error) => io::Error::other(error.to_string()),
        })?;
        move_to(self.origin, self.wide.as_chunks_mut().0);
        out.extend(self.wide.iter().map(|&x| x as f32));
        self.next += 1;
        Ok(true)
    }
}
