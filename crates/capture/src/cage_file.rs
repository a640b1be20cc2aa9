//! Cages from files: meshes, and the rest cages of `.cager` files.

use crate::decode::{self, DecodeError};
use crate::encode::EncodeError;
use crate::origin::{move_from, move_to};
use cager_cages::diagnosis::weld;
use cager_core::cage::Cage;
use cager_formats::read_mesh;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::units::Units;
use std::path::Path;

/// The cage in a file, turned around where `flip` says so, about the origin and in the units of its
/// model.
///
/// # Errors
/// A file that cannot be read, and [`EncodeError::Cage`].
pub fn read_cage(
    path: &Path,
    flip: bool,
    (origin, units): (Option<Point>, Units),
    warnings: &mut Vec<String>,
) -> Result<Cage, EncodeError> {
    let mut model = read_welded_cage(path, units, warnings)?;
    if model.faces.is_empty() {
        let what = "has no faces, and a cage is a closed mesh; export the cage with its faces".to_owned();
        return Err(cager_formats::Error::Invalid { path: path.to_owned(), what }.into());
    }
    move_to(origin, &mut model.points);
    let mesh = TriMesh::from(&model);
    let polygon_of = model.faces.polygon_of_triangle();
    let carriers = match is_container(path) {
        true => decode::open(path)?.carriers().map_err(|cause| DecodeError::container(path, cause))?,
        false => Vec::new(),
    };
    let cage = Cage::new(if flip { mesh.flipped() } else { mesh }).and_then(|cage| cage.with_carriers(carriers));
    cage.map_err(|cause| EncodeError::Cage {
        path: path.to_owned(),
        cause: cause.renumbered(|triangle| polygon_of[triangle] as usize),
    })
}

fn is_container(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("cager"))
}

/// The mesh of a cage in the units of its model, with vertices merged that seams split.
///
/// # Errors
/// A file that cannot be read.
pub fn read_welded_cage(path: &Path, units: Units, warnings: &mut Vec<String>) -> Result<Model, EncodeError> {
    let (mut model, own) = read_cage_mesh(path, warnings)?;
    let change = own.change_to(units);
    if !change.is_none() {
        change.apply_to(&mut model.points);
        let path = path.display();
        warnings.push(format!("{path}: the cage is {change}, as its unit and axes are not those of its model"));
    }
    // What encoding wrote has no doubled vertices, but components may touch.
    if let Some(welded) = weld(&model).filter(|_| !is_container(path)) {
        let (path, merged) = (path.display(), welded.merged);
        warnings.push(format!("{path}: merged {merged} vertices with others in the same place, as seams split them"));
        model = welded.model;
    }
    Ok(model)
}

/// The mesh of a cage as it stands in its file, with what that says of its coordinates.
///
/// # Errors
/// A file that cannot be read.
pub fn read_cage_mesh(path: &Path, warnings: &mut Vec<String>) -> Result<(Model, Units), EncodeError> {
    if !is_container(path) {
        let read = read_mesh(path, &[])?;
        warnings.extend(read.note);
        return Ok((read.model, read.units));
    }
    let mut container = decode::open(path)?;
    let cage = container.cage().map_err(|cause| DecodeError::container(path, cause))?;
    let mut model = Model::from(cage);
    move_from(container.header().origin, &mut model.points);
    Ok((model, container.header().units))
}
