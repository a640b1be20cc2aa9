//! Cages from files: meshes, and the rest cages of .cager files.

use super::{dropped, grouped, is_container, read_with_units, warn};
use anyhow::{Context, Result, bail};
use cager_cages::diagnosis::weld;
use cager_capture::decode::{self, DecodeError};
use cager_capture::origin::{move_from, move_to};
use cager_client::MeshFile;
use cager_core::cage::{Cage, CageError};
use cager_formats::{Units, obj_bytes};
use cager_geometry::mesh::{Model, Point, TriMesh};
use std::path::Path;

/// The mesh of a cage as it is encoded with: in the units of its model, with vertices merged that seams split. Both are told.
pub(super) fn read_welded_cage(path: &Path, units: Units) -> Result<Model> {
    let (mut model, said) = read_cage_mesh(path)?;
    let change = said.change_to(units);
    if !change.is_none() {
        change.apply_to(&mut model.points);
        let what = format!("{}: the cage is {change}, as its unit and axes are not those of its model", path.display());
        warn(&[what]);
    }
    if let Some(welded) = weld(&model) {
        let places = grouped(welded.merged);
        warn(&[format!(
            "{}: merged {places} vertices with others in the same place, as seams split them",
            path.display()
        )]);
        model = welded.model;
    }
    Ok(model)
}

/// The cage in a file, checked, about the origin and in the units of its model.
pub(super) fn read_cage(path: &Path, flip: bool, (origin, units): (Option<Point>, Units)) -> Result<Cage> {
    let mut model = read_welded_cage(path, units)?;
    if model.faces.is_empty() {
        bail!("{}: has no faces, and a cage is a closed mesh; export the cage with its faces", path.display());
    }
    move_to(origin, &mut model.points);
    let mesh = TriMesh::from(&model);
    let cage = Cage::new(if flip { mesh.flipped() } else { mesh });
    match cage {
        Err(CageError::Inward { .. }) if flip => {
            bail!("{}: turned around, the faces of the cage point inwards; leave out --flip-cage", path.display())
        }
        Err(error @ CageError::Inward { .. }) => bail!("{}: {error}, or pass --flip-cage", path.display()),
        _ => {}
    }
    let polygon_of = model.faces.polygon_of_triangle();
    cage.map_err(|error| error.renumbered(|triangle| polygon_of[triangle] as usize))
        .with_context(|| path.display().to_string())
}

/// The mesh of a cage as it stands, in the units and axes of its model where both files say theirs.
pub(super) fn read_cage_like(path: &Path, units: Units) -> Result<Model> {
    let (mut model, said) = read_cage_mesh(path)?;
    said.change_to(units).apply_to(&mut model.points);
    Ok(model)
}

/// What is lost of a cage that is written anew; what is wrong with it is told where it is read.
pub(super) fn dropped_of_cage(path: &Path) -> Option<String> {
    let read = cager_formats::read_mesh(path, None).ok().filter(|_| !is_container(path))?;
    dropped(path, &read)
}

/// A cage for a service, in the units and axes of its model.
pub(super) fn cage_file(path: &Path, units: Units) -> Result<MeshFile> {
    Ok(MeshFile::new("cage.obj", obj_bytes(&read_cage_like(path, units)?)))
}

/// The mesh of a cage as it stands in its file, with what that says of its coordinates.
fn read_cage_mesh(path: &Path) -> Result<(Model, Units)> {
    if !is_container(path) {
        return Ok(read_with_units(path, None)?);
    }
    let mut container = decode::open(path)?;
    let cage = container.cage().map_err(|cause| DecodeError::container(path, cause))?;
    let mut model = Model::from(cage);
    move_from(container.header().origin, &mut model.points);
    Ok((model, container.header().units))
}
