//! Where a source is to be laid at first, as a user says it.

use cager_geometry::linalg::nearest_rotation;
use cager_geometry::mesh::Point;
use cager_shape::Similarity;
use cager_shape::transfer::alignment::AlignBy;
use glam::{DMat3, DVec3};

/// The similarity of a 4 × 4 matrix, row by row; `None` where it is none.
pub(super) fn similarity(m: &[f64; 16]) -> Option<Similarity> {
    let linear = DMat3::from_cols_array_2d(&[[m[0], m[4], m[8]], [m[1], m[5], m[9]], [m[2], m[6], m[10]]]);
    let scale = linear.determinant().cbrt();
    let rotation = linear * (1.0 / scale);
    let is_affine = m[12..] == [0.0, 0.0, 0.0, 1.0] && m.iter().all(|x| x.is_finite());
    let is_similarity =
        is_affine && scale > 0.0 && (rotation * rotation.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-4);
    let translation = DVec3::new(m[3], m[7], m[11]);
    is_similarity.then(|| Similarity { rotation: nearest_rotation(rotation), scale, translation })
}

/// An alignment with a target from which an origin was subtracted.
pub fn about_origin(align: AlignBy, origin: Option<Point>) -> AlignBy {
    match (align, origin.map(DVec3::from)) {
        (AlignBy::Given(similarity), Some(origin)) => {
            AlignBy::Given(Similarity { translation: similarity.translation - origin, ..similarity })
        }
        (AlignBy::AsTheyStand, Some(origin)) => {
            AlignBy::Given(Similarity { translation: -origin, ..Similarity::IDENTITY })
        }
        (align, _) => align,
    }
}
