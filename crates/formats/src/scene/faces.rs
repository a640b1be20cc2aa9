//! Faces of a mesh, stored as the corners of all of them and how many each has.

use cager_geometry::mesh::Polygons;

use super::bytes::damaged;
use crate::error::Fault;
use crate::faces::check_face;

/// Corners that a point has at the most, and those that a mesh may have however few its points are.
const CORNERS_OF_POINT: u64 = 64;
const MOST_OF_FEW: u64 = 1 << 18;

/// How many corners, or faces, so many points may have.
pub(crate) fn most_corners(points: usize) -> u64 {
    MOST_OF_FEW.max(CORNERS_OF_POINT.saturating_mul(points as u64))
}

/// Faces of three corners and more, and how many there are beside them; in the opposite order of
/// corners where `turned`.
pub(crate) fn faces(
    counts: impl Iterator<Item = u32>,
    mut corners: impl Iterator<Item = u32>,
    points: usize,
    turned: bool,
) -> Result<(Polygons, usize), Fault> {
    let (mut faces, mut left_out, mut face) = (Polygons::new(), 0, Vec::new());
    for (k, count) in counts.enumerate() {
        face.clear();
        face.extend(corners.by_ref().take(count as usize));
        if face.len() != count as usize {
            return Err(damaged(&format!("face {k} has more corners than are there")));
        }
        if turned {
            face.reverse();
        }
        check_face(&face, points, || format!("face {k}"))?;
        if face.len() < 3 {
            left_out += 1;
        } else {
            faces.push(&face);
        }
    }
    Ok((faces, left_out))
}

/// Of a frame whose points or faces are not those of the first.
pub(crate) fn topology_changes(what: &str) -> Fault {
    Fault::unsupported(format!(
        "its topology changes: {what}; export a mesh that keeps its points and faces, or only the frames before"
    ))
}
