//! Why a solver cannot be prepared, and what to do about it.

use crate::coordinates::CoordinatesError;
use crate::regularize::TermError;

/// Why a solver cannot be prepared; points are counted from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum PrepareError {
    /// The caller cancelled it.
    #[error("the preparation was stopped")]
    Stopped,
    #[error("rest point {point} is not finite; export the rest pose again")]
    NotFinite { point: usize },
    /// The system is underdetermined.
    #[error(
        "the rest pose has {points} points, fewer than the {unknowns} unknowns of the cage; use {}a denser model",
        if *unknowns > 4 { "a coarser cage or " } else { "" }
    )]
    TooFewPoints { points: usize, unknowns: usize },
    #[error("all rest points are at the same place, so errors have no scale; check the rest pose")]
    NoExtent,
    /// Squared lengths overflow.
    #[error("the rest pose is too large to be measured; scale it down")]
    TooLarge,
    /// The coordinates do not fit into memory.
    #[error(
        "{points} points times {unknowns} unknowns need {gigabytes:.0} GB of memory; use a coarser cage or a lighter model"
    )]
    OutOfMemory { points: usize, unknowns: usize, gigabytes: f64 },
    /// Its coordinates outweigh those of all others; measured from the cage's first vertex.
    #[error(
        "point {point} lies {distance:.1e} diagonals of the cage away from it; move the cage around the model or delete the point"
    )]
    TooFar { point: usize, distance: f64 },
    /// More points of another model beside poles than can be bound to the capture's own model.
    #[error(
        "{points} points, {first} the first, lie beside poles of the cage's coordinates, and at most {most} can follow the capture's own model there; move the model to where the capture is, or encode the capture with an editable cage"
    )]
    TooManyBesidePoles { first: usize, points: usize, most: usize },
    /// Rounding dominates: `Φ C_R` misses the point, over the smaller diagonal of model and cage.
    #[error(
        "rest point {point} is not reproduced by the cage (off by {error:.1e} of its diagonal), as happens far outside it; move the cage around the model or delete the point"
    )]
    NotReproduced { point: usize, error: f64 },
    #[error("the spectrum threshold {spectrum} exceeds the {unknowns} unknowns of the cage; give at most {unknowns}")]
    SpectrumTooLarge { spectrum: usize, unknowns: usize },
    #[error(
        "{count} handles cannot be read: they have to be at least the {unknowns} unknowns of the cage and at most the {points} points of the model"
    )]
    HandleCount { count: usize, unknowns: usize, points: usize },
    /// The covariance of the handles does not fit into memory.
    #[error("interpolating between {count} handles needs {gigabytes:.0} GB of memory; read fewer, or all points")]
    HandlesOutOfMemory { count: usize, gigabytes: f64 },
    #[error(transparent)]
    Term(#[from] TermError),
    #[error("the weight lambda is {lambda}; give a finite number of at least 0")]
    BadLambda { lambda: f64 },
    #[error(transparent)]
    Coordinates(#[from] CoordinatesError),
    /// A factorisation failed.
    #[error("the {what} did not succeed; check that the rest pose lies near its cage, in the same unit")]
    NoSolution { what: &'static str },
}

/// That a computation did not succeed.
pub(crate) fn failed(what: &'static str) -> PrepareError {
    PrepareError::NoSolution { what }
}
