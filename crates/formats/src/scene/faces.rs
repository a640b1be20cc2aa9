//! Faces of a mesh, stored as the corners of all of them and how many each has.

use cager_geometry::mesh::Polygons;

use crate::error::Fault;
use crate::faces::check_face;

/// Corners that a point has at the most, and those that a mesh may have however few its points are.
const CORNERS_OF_POINT: u64 = 64;
const MOST_OF_FEW: u64 = 1 << 18;

/// How many corners, or faces, so many points may have.
pub(crate) fn most_corners(points: usize) -> u64 {
    MOST_OF_FEW.max(CORNERS_OF_POINT.saturating_mul(points as u64))
}

#[derive(Debug, Default)]
pub(crate) struct Faces {
    /// Those of three corners and more.
    pub(crate) polygons: Polygons,
    /// How many there are beside them of fewer than three corners.
    pub(crate) left_out: usize,
}

impl Faces {
    /// Faces in the order of their corners or, `turned`, in the opposite one; none where there are fewer corners than the faces have.
    pub(crate) fn of(
        counts: impl Iterator<Item = u32>,
        mut corners: impl Iterator<Item = u32>,
        points: usize,
        turned: bool,
    ) -> Result<Self, Fault> {
        let (mut faces, mut face) = (Self::default(), Vec::new());
        for (k, count) in counts.enumerate() {
            face.clear();
            face.extend(corners.by_ref().take(count as usize));
            if face.len() != count as usize {
                return Err(Fault::damaged(format!(
                    "face {k} has more corners than are there, so the file is damaged; copy or export it again"
                )));
            }
            if turned {
                face.reverse();
            }
            check_face(&face, points, || format!("face {k}"))?;
            if face.len() < 3 {
                faces.left_out += 1;
            } else {
                faces.polygons.push(&face);
            }
        }
        Ok(faces)
    }
}

/// Of a frame whose points or faces are not those of the first.
pub(crate) fn topology_changes(what: &str) -> Fault {
    Fault::unsupported(format!(
        "its topology changes: {what}; export a mesh that keeps its points and faces, or only the frames before"
    ))
}
