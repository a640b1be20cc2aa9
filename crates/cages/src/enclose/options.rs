//! How a cage is made around a model, and why none can be made.

/// How a cage is made around a model.
#[derive(Clone, Debug, PartialEq)]
pub struct EncloseOptions {
    /// Most vertices that the cage may have.
    pub vertices: usize,
    /// Least distance of points to the cage, over the diagonal; a fifth of the offset where it is
    /// `None`.
    pub clearance: Option<f64>,
    /// One closed surface for each connected part. Parts too close for the offset share one.
    pub per_part: bool,
}

impl Default for EncloseOptions {
    fn default() -> Self {
        Self { vertices: 350, clearance: None, per_part: false }
    }
}

/// Why no cage can be made around a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EncloseError {
    /// No points at all.
    #[error("the rest pose has no points; a cage needs a model to enclose")]
    Empty,
    /// NaN or infinity: the point.
    #[error("rest point {0} has a coordinate that is NaN or infinite; repair or delete it")]
    NotFinite(usize),
    /// All points in one place.
    #[error(
        "all points of the rest pose lie in one place, so there is nothing to enclose; check the file's unit and contents"
    )]
    NoExtent,
    /// The caller had it stopped.
    #[error("the making of the cage was stopped")]
    Stopped,
    /// Too few vertices to enclose this model.
    #[error("a cage of at most {vertices} vertices cannot enclose this model; ask for at least {least}")]
    TooFewVertices {
        /// What was asked for.
        vertices: usize,
        /// What will do.
        least: usize,
    },
}
