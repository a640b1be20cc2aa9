//! What can be wrong with the names and the axes of a skeleton.

/// Why poses cannot be taken from a skeleton.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// No known naming.
    #[error("names its joints as no known table does ({0}, …); give a file with the names of the bones")]
    UnknownNames(String),
    /// The names are no JSON of their form.
    #[error("is no list of bones with their joints: {0}")]
    NamesSyntax(String),
    /// A bone without an entry.
    #[error("has no entry for the bone {0:?}; every bone needs one")]
    MissingBone(&'static str),
    /// A bone that there is not.
    #[error("has an entry for {0:?}, which is no bone; leave it out")]
    UnknownBone(String),
    /// A limb whose end is not named.
    #[error("does not say where the bone {0:?} ends; name the joint at its end")]
    NoEnd(&'static str),
    /// A joint that the names need.
    #[error("has no joint {0:?}; correct the names of the bones")]
    MissingJoint(String),
    /// Bones of no length.
    #[error("has hips, head or legs in one place when all angles are zero; its axes cannot be told")]
    NoAxes,
}
