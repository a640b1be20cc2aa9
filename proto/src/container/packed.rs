//! A model alone as a container without frames, by which programs send all that a model has.

use super::{ContainerReader, ContainerWriter, Error, Header};
use cager_geometry::mesh::{Model, TriMesh, bounds};
use cager_geometry::surface::Surface;
use cager_geometry::units::Units;
use std::io::Cursor;

/// A model with what lies on its faces and the pictures of its materials, in a box as its cage.
///
/// # Errors
/// A model that readers would refuse.
pub fn pack_model(model: &Model, units: Units) -> Result<Vec<u8>, Error> {
    let cage = around(model);
    let header = Header { rows_per_frame: cage.vertices.len() as u32, units, ..Header::default() };
    let writer = ContainerWriter::new(Vec::new(), &header, model, &cage)?;
    writer.finish(None)
}

/// The model of a container, its faces in the order of its source, with all that lies on them.
///
/// # Errors
/// Damage.
pub fn unpack_model(bytes: &[u8]) -> Result<(Model, Units), Error> {
    let mut reader = ContainerReader::open(Cursor::new(bytes))?;
    let (rest, colors) = (reader.rest()?, reader.colors()?);
    let pictures = reader.pictures()?;
    let (surface, faces) = match reader.surface()? {
        Some((surface, faces)) => (Surface { pictures, ..surface }, faces),
        None => (Surface::default(), rest.faces.clone()),
    };
    Ok((Model { faces, colors, surface, ..rest }, reader.header().units))
}

fn around(model: &Model) -> TriMesh {
    let (low, high) = bounds(&model.points);
    let corner =
        |k: usize| std::array::from_fn(|axis| if k >> axis & 1 == 0 { low[axis] - 1.0 } else { high[axis] + 1.0 });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices: (0..8).map(corner).collect(), triangles }
}
