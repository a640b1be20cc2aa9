//! Faces of meshes as they are read: whether they are wanted, and whether they name vertices that exist.

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

pub(crate) fn no_such_vertex(place: &str, index: i64, points: usize) -> Fault {
    Fault::invalid(format!(
        "{place}: the face names vertex {index}, but there are {points} vertices; export the mesh again"
    ))
}
