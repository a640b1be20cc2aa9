//! Why a rig cannot be read or placed.

use super::QUADS;

/// What is wrong with a rig or with a template for one; the message says what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RigError {
    /// The file is no JSON, or not of this form.
    #[error("is no rig file ({0}); write it with `cager rig`")]
    Syntax(String),
    /// A quad that no rig has.
    #[error(
        "names the quad {0:?}, which a rig does not have; it has pelvis, waist, chest, neck, head and, left and right, shoulder, elbow, wrist, hand, hip, knee, ankle and toe"
    )]
    UnknownQuad(String),
    /// A quad that is there twice.
    #[error("has the quad {0:?} twice; remove one")]
    RepeatedQuad(String),
    /// A quad that is not there.
    #[error("has no quad {0:?}; a rig has {QUADS}")]
    MissingQuad(&'static str),
    /// A coordinate that is NaN or infinite, or axes that are not orthogonal unit vectors.
    #[error(
        "has a coordinate that is not finite, or axes that are not orthogonal unit vectors; place the rig anew with `cager rig`"
    )]
    BadNumbers,
    /// The axes that a template is placed by are one and the same, or opposite.
    #[error("a person cannot look along the axis that points up; choose another axis to look along, or another up")]
    ForwardIsUp,
    /// The template has too few points or faces.
    #[error("has {points} points and {faces} faces; a rig is placed in a surface of a person")]
    NoSurface {
        /// Points of the template.
        points: usize,
        /// Its faces.
        faces: usize,
    },
    /// No arms stand out from the trunk, or no legs part.
    #[error(
        "{0} cannot be told from the trunk; use a template with arms held away from the body and legs apart, and name its up axis"
    )]
    NoLimb(&'static str),
}
