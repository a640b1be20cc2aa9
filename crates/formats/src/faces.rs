//! Faces of meshes as they are read: whether they name vertices that exist.

use cager_geometry::mesh::Polygons;

use crate::error::Fault;

/// How much of a file is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Contents {
    PointsAndFaces,
    Points,
}

/// Checks the corners of one face, which `place` names in messages, against the number of points.
pub(crate) fn check_face(corners: &[u32], points: usize, place: impl Fn() -> String) -> Result<(), Fault> {
    match corners.iter().find(|&&index| index as usize >= points) {
        Some(&index) => Err(no_such_vertex(&place(), index.into(), points)),
        None => Ok(()),
    }
}

/// Checks all faces.
pub(crate) fn check_faces(faces: &Polygons, points: usize, of: &str) -> Result<(), Fault> {
    faces.iter().enumerate().try_for_each(|(k, face)| check_face(face, points, || format!("face {k}{of}")))
}

pub(crate) fn no_such_vertex(place: &str, index: i64, points: usize) -> Fault {
    Fault::invalid(format!(
        "{place}: the face names vertex {index}, but there are {points} vertices; export the mesh again"
    ))
}
