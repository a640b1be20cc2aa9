//! Why a solver cannot be prepared, and what to do about it.

use crate::coordinates::CoordinatesError;
use crate::regularize::TermError;

/// Why a solver cannot be prepared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PrepareError {
    /// The caller cancelled it.
    #[error("the preparation was stopped")]
    Stopped,
    /// NaN or infinity in the rest pose.
    #[error("rest point {point} is not finite; export the rest pose again")]
    NotFinite {
        /// The point, counted from 0.
        point: usize,
    },
    /// The system is underdetermined.
    #[error(
        "the rest pose has {points} points, fewer than the {unknowns} unknowns of the cage; use {}a denser model",
        if *unknowns > 4 { "a coarser cage or " } else { "" }
    )]
    TooFewPoints {
        /// Number of points n.
        points: usize,
        /// Number of unknowns m.
        unknowns: usize,
    },
    /// All points coincide.
    #[error("all rest points are at the same place, so errors have no scale; check the rest pose")]
    NoExtent,
    /// Squared lengths overflow.
    #[error("the rest pose is too large to be measured; scale it down")]
    TooLarge,
    /// The coordinates do not fit into memory.
    #[error(
        "{points} points times {unknowns} unknowns need {gigabytes:.0} GB of memory; use a coarser cage or a lighter model"
    )]
    OutOfMemory {
        /// Number of points n.
        points: usize,
        /// Number of unknowns m.
        unknowns: usize,
        /// Memory that preparing needs.
        gigabytes: f64,
    },
    /// A point so far from the cage that its coordinates outweigh those of all others.
    #[error(
        "point {point} lies {distance:.1e} diagonals of the cage away from it; move the cage around the model or delete the point"
    )]
    TooFar {
        /// The point, counted from 0.
        point: usize,
        /// Distance from the first vertex of the cage over the diagonal of the cage.
        distance: f64,
    },
    /// More points of another model beside poles of the coordinates than can be bound to the capture's own model.
    #[error(
        "{points} points, {first} the first, lie beside poles of the cage's coordinates, and at most {most} can follow the capture's own model there; move the model to where the capture is, or encode the capture with an editable cage"
    )]
    TooManyBesidePoles {
        /// The first of them, counted from 0.
        first: usize,
        /// How many there are.
        points: usize,
        /// How many there may be.
        most: usize,
    },
    /// A point whose coordinates are dominated by rounding.
    #[error(
        "rest point {point} is not reproduced by the cage (off by {error:.1e} of its diagonal), as happens far outside it; move the cage around the model or delete the point"
    )]
    NotReproduced {
        /// The point, counted from 0.
        point: usize,
        /// Distance of `Φ C_R` from it over the smaller of the diagonals of model and cage.
        error: f64,
    },
    /// s > m.
    #[error("the spectrum threshold {spectrum} exceeds the {unknowns} unknowns of the cage; give at most {unknowns}")]
    SpectrumTooLarge {
        /// The threshold s.
        spectrum: usize,
        /// Number of unknowns m.
        unknowns: usize,
    },
    /// K < m or K > n.
    #[error(
        "{count} handles cannot be read: they have to be at least the {unknowns} unknowns of the cage and at most the {points} points of the model"
    )]
    HandleCount {
        /// The number K.
        count: usize,
        /// Number of unknowns m.
        unknowns: usize,
        /// Number of points n.
        points: usize,
    },
    /// The covariance of the handles does not fit into memory.
    #[error("interpolating between {count} handles needs {gigabytes:.0} GB of memory; read fewer, or all points")]
    HandlesOutOfMemory {
        /// The number K.
        count: usize,
        /// Memory that preparing needs.
        gigabytes: f64,
    },
    /// The regularisation term does not fit.
    #[error(transparent)]
    Term(#[from] TermError),
    /// λ is negative or not finite.
    #[error("the weight lambda is {lambda}; give a finite number of at least 0")]
    BadLambda {
        /// The weight λ.
        lambda: f64,
    },
    /// The coordinates do not exist.
    #[error(transparent)]
    Coordinates(#[from] CoordinatesError),
    /// A factorisation failed.
    #[error("the {what} did not succeed; check that the rest pose lies near its cage, in the same unit")]
    NoSolution {
        /// Which factorisation.
        what: &'static str,
    },
}

/// That a computation did not succeed.
pub(crate) fn failed(what: &'static str) -> PrepareError {
    PrepareError::NoSolution { what }
}
