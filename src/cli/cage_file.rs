//! Cages from files, with what is wrong with them told in the words of the command line.

use super::checks::explained_cage;
use super::{is_container, warning};
use anyhow::Result;
use cager_capture::cage_file;
use cager_client::MeshFile;
use cager_core::cage::Cage;
use cager_formats::{Units, obj_bytes};
use cager_geometry::mesh::{Model, Point};
use std::path::Path;

/// [`cage_file::read_welded_cage`] with its warnings told.
pub(super) fn read_welded_cage(path: &Path, units: Units) -> Result<Model> {
    Ok(warning(|warnings| cage_file::read_welded_cage(path, units, warnings))?)
}

/// [`cage_file::read_cage`] with its warnings told.
pub(super) fn read_cage(path: &Path, place: (Option<Point>, Units)) -> Result<Cage> {
    warning(|warnings| cage_file::read_cage(path, false, place, warnings)).map_err(|error| explained_cage(error, false))
}

/// The mesh of a cage as it stands, in the units and axes of its model where both files say theirs.
pub(super) fn read_cage_like(path: &Path, units: Units) -> Result<Model> {
    let (mut model, said) = warning(|warnings| cage_file::read_cage_mesh(path, warnings))?;
    said.change_to(units).apply_to(&mut model.points);
    Ok(model)
}

/// What is lost of a cage that is written anew; what is wrong with it is told where it is read.
pub(super) fn dropped_of_cage(path: &Path) -> Option<String> {
    let read = cager_formats::read_mesh(path, &[]).ok().filter(|_| !is_container(path))?;
    read.dropped_with_appearance().sentence(path, false)
}

/// A cage for a service, in the units and axes of its model.
pub(super) fn cage_file(path: &Path, units: Units) -> Result<MeshFile> {
    Ok(MeshFile::new("cage.obj", obj_bytes(&read_cage_like(path, units)?)))
}
