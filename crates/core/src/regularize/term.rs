//! Regularisation terms `λ‖Δ (C − C₀)‖²`: a matrix Δ and a reference cage C₀.

use crate::cage::Cage;
use faer::Mat;

/// The cage `C₀` in `λ‖Δ C − Δ C₀‖²`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// Zero: `Δ C` itself is penalised.
    Origin,
    /// The rest pose's; adds a constant to every cage.
    RestCage,
    /// The previous frame's, and the rest pose's for the first frame. Frames then depend on their predecessors and have to be
    /// inverted in order.
    PreviousCage,
}

/// A regularisation term `λ‖Δ (C − C₀)‖²`.
pub trait Term: Sync {
    /// Δ for a cage of which this many rows are unknown, rows × unknowns. Where there are more unknowns than vertices, those
    /// after the vertices are one direction per face.
    ///
    /// # Errors
    /// A term that does not fit the cage.
    fn delta(&self, cage: &Cage, unknowns: usize) -> Result<Mat<f64>, TermError>;

    /// The cage `C₀`.
    fn reference(&self) -> Reference;
}

/// Why a term cannot be used with a cage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TermError {
    /// The columns of a matrix are not the cage's unknowns.
    #[error("the regularisation matrix has {columns} columns, but the cage has {}; give one column per unknown, in its order", expected(*.vertices, *.unknowns))]
    Columns {
        /// Columns of the matrix.
        columns: usize,
        /// Vertices of the cage v.
        vertices: usize,
        /// Unknowns m.
        unknowns: usize,
    },
    /// None was given.
    #[error("the regularizer matrix needs a matrix; give one")]
    Missing,
}

fn expected(vertices: usize, unknowns: usize) -> String {
    if vertices == unknowns {
        return format!("{vertices} vertices");
    }
    format!("{vertices} vertices, or {unknowns} unknowns with the normals of its faces")
}
