//! The parts of a capture and what lies on their faces, as dictionaries of arrays.

use crate::fault::Fault;
use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{CornerSet, Material, NO_MATERIAL, Part, PartRange, Surface};
use numpy::{PyArray1, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Each part of a surface on these faces.
pub(super) fn parts<'py>(
    py: Python<'py>,
    (surface, faces): &(Surface, Polygons),
) -> Result<Vec<Bound<'py, PyDict>>, Fault> {
    let told = |(part, range): (&Part, PartRange)| {
        let local = range.local(faces);
        let dict = PyDict::new(py);
        dict.set_item("path", &part.path)?;
        dict.set_item("points", (range.points.start, range.points.end))?;
        let counts = local.arities().iter().map(|&count| i64::from(count));
        dict.set_item("face_counts", PyArray1::from_iter(py, counts))?;
        let corners = local.indices().iter().map(|&point| i64::from(point));
        dict.set_item("face_points", PyArray1::from_iter(py, corners))?;
        dict.set_item("uvs", sets(py, &part.uv_sets)?)?;
        dict.set_item("colors", sets(py, &part.color_sets)?)?;
        let number = |&material: &u32| if material == NO_MATERIAL { -1 } else { i64::from(material) };
        let materials = part.materials.iter().map(number);
        dict.set_item("materials", (!part.materials.is_empty()).then(|| PyArray1::from_iter(py, materials)))?;
        let shown = part.shown.as_ref();
        dict.set_item("shown", shown.map(|shown| shown.iter().map(|r| (r.start, r.end)).collect::<Vec<_>>()))?;
        Ok(dict)
    };
    surface.ranges(faces).map(told).collect()
}

pub(super) fn materials<'py>(py: Python<'py>, surface: &Surface) -> Result<Vec<Bound<'py, PyDict>>, Fault> {
    let told = |material: &Material| {
        let (dict, textures, sequences) = (PyDict::new(py), PyDict::new(py), PyDict::new(py));
        dict.set_item("name", &material.name)?;
        dict.set_item("base_color", material.base_color)?;
        dict.set_item("opacity", material.opacity)?;
        dict.set_item("roughness", material.roughness)?;
        dict.set_item("metalness", material.metalness)?;
        for texture in &material.textures {
            textures.set_item(texture.channel.name(), &texture.path)?;
            if !texture.frames.is_empty() {
                sequences.set_item(texture.channel.name(), &texture.frames)?;
            }
        }
        dict.set_item("textures", textures)?;
        dict.set_item("texture_sequences", sequences)?;
        Ok(dict)
    };
    surface.materials.iter().map(told).collect()
}

/// The value of each corner, by the names of the sets.
fn sets<'py, const N: usize>(py: Python<'py>, sets: &[CornerSet<N>]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for set in sets {
        let values: Vec<f32> = set.corners.iter().flat_map(|&k| set.values[k as usize]).collect();
        dict.set_item(&set.name, values.to_pyarray(py).reshape([set.corners.len(), N])?)?;
    }
    Ok(dict)
}
