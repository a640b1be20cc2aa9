//! Layers of edits: what is added to cages beside frames that stay as they are.

use super::Capture;
use crate::fault::{Fault, computing, of};
use crate::own_file::{OwnFile, temporary};
use cager_capture::decode::{self, Container};
use cager_capture::edit;
use cager_formats::{AtomicFile, Target, commit_together};
use cager_proto::container::{EditLayer, LayerSource, MAX_LAYER_NAME};
use numpy::PyArray1;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyRange};

/// What a layer is, as Python gets it.
pub(super) fn told<'py>(py: Python<'py>, layer: &EditLayer) -> Result<Bound<'py, PyDict>, Fault> {
    let (frames, told) = (layer.frames(), PyDict::new(py));
    told.set_item("name", &layer.name)?;
    told.set_item("on", layer.is_on)?;
    told.set_item("frames", PyRange::new(py, frames.start as isize, frames.end as isize)?)?;
    let vertices = layer.vertices.iter().map(|&vertex| i64::from(vertex));
    told.set_item("vertices", PyArray1::from_iter(py, vertices))?;
    Ok(told)
}

impl Capture {
    /// The place of a layer, counted from the end where it is negative.
    fn layer(&self, layer: isize) -> Result<usize, Fault> {
        let count = self.edits.len();
        let place = if layer < 0 { layer + count as isize } else { layer };
        usize::try_from(place).ok().filter(|&place| place < count).ok_or_else(|| {
            let what = format!("there is no layer {layer}; the capture has {count}, counted from 0");
            PyIndexError::new_err(what).into()
        })
    }

    pub(super) fn without_layer(&self, py: Python<'_>, layer: isize) -> Result<Self, Fault> {
        let gone = self.layer(layer)?;
        let kept = (0..self.edits.len()).filter(|&k| k != gone).map(LayerSource::Kept);
        self.with_layers(py, kept.collect())
    }

    pub(super) fn switched(&self, py: Python<'_>, layer: isize, on: bool) -> Result<Self, Fault> {
        let place = self.layer(layer)?;
        let mut all: Vec<LayerSource> = (0..self.edits.len()).map(LayerSource::Kept).collect();
        if self.edits[place].is_on != on {
            all[place] = LayerSource::New(EditLayer { is_on: on, ..self.edits[place].clone() });
        }
        self.with_layers(py, all)
    }

    fn with_layers(&self, py: Python<'_>, layers: Vec<LayerSource>) -> Result<Self, Fault> {
        self.rewritten(py, |mut container, target| Ok(edit::with_layers(&mut container, &self.path, &layers, target)?))
    }

    /// What is made of the container, in a file that goes when nobody needs it any more.
    pub(super) fn rewritten(
        &self,
        py: Python<'_>,
        write: impl FnOnce(Container, &Target) -> Result<AtomicFile, Fault> + Send,
    ) -> Result<Self, Fault> {
        computing(py, || {
            let container = self.again(decode::open)?;
            let file = OwnFile::new(temporary()?.into_temp_path());
            commit_together(vec![write(container, &Target::Replacing(file.path().to_owned()))?])?;
            Self::of_encoding(file)
        })
    }
}

/// Refuses what a layer cannot be called.
pub(super) fn check_name(name: &str) -> Result<(), Fault> {
    if name.len() <= MAX_LAYER_NAME {
        return Ok(());
    }
    Err(of("name", format!("has {} bytes, more than {MAX_LAYER_NAME}; give a shorter one", name.len())))
}
