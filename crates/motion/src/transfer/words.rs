//! What the words of the options of a transfer stand for, on the command line and in the service.

use super::job::{MethodChoice, Public};
use super::placing::similarity;
use cager_geometry::mesh::Point;
use cager_proto::transfer_messages::{PublicShape, RestPose, SourceAlignment, TransferMethod, UpAxis};
use cager_shape::transfer::alignment::AlignBy;
use cager_shape::transfer::public_cage::PublicCage;
use cager_shape::transfer::{Pose, RIGIDITY};

/// How a motion is moved; with the paper's methods by a cage that is given, or by one of a shape.
pub fn method(
    method: TransferMethod,
    (has_cage, shape): (bool, Option<PublicShape>),
    rigidity: Option<f64>,
) -> MethodChoice {
    let cage = match shape {
        None if has_cage => Public::Given,
        None | Some(PublicShape::Sphere) => Public::Made(PublicCage::Sphere(162)),
        Some(PublicShape::Box) => Public::Made(PublicCage::Box),
        Some(PublicShape::Ico) => Public::Made(PublicCage::Icosahedron),
        Some(PublicShape::Hull) => Public::Made(PublicCage::Hull(42)),
        Some(PublicShape::Offset) => Public::Made(PublicCage::Offset(350)),
    };
    match method {
        TransferMethod::Fitted => MethodChoice::Fitted,
        TransferMethod::Public => MethodChoice::Public(cage),
        TransferMethod::Rigid => MethodChoice::Rigid(cage, rigidity.unwrap_or(RIGIDITY)),
    }
}

/// Which pose the target has at rest.
pub fn pose(pose: Option<RestPose>) -> Pose {
    match pose.unwrap_or_default() {
        RestPose::Auto => Pose::Auto,
        RestPose::Relative => Pose::Relative,
        RestPose::Absolute => Pose::Absolute,
    }
}

/// The direction of an axis.
pub fn axis(up: UpAxis) -> Point {
    match up {
        UpAxis::X => [1.0, 0.0, 0.0],
        UpAxis::Y => [0.0, 1.0, 0.0],
        UpAxis::Z => [0.0, 0.0, 1.0],
    }
}

/// How a source is laid onto a target; `None` where the matrix is no similarity.
pub fn align(align: Option<SourceAlignment>, matrix: Option<[f64; 16]>) -> Option<AlignBy> {
    match (align.unwrap_or_default(), matrix) {
        (_, Some(matrix)) => similarity(&matrix).map(AlignBy::Given),
        (SourceAlignment::Pca, None) => Some(AlignBy::Surfaces),
        (SourceAlignment::None, None) => Some(AlignBy::AsTheyStand),
    }
}
