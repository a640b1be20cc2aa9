//! Why a motion cannot be moved, or a shape not be found.

use crate::registration::{MeasuredSurface, ObservationError, RegistrationError};
use cager_core::coordinates::CoordinatesError;
use cager_core::inversion::PrepareError;

/// Why a mesh cannot be solved on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// A coordinate is NaN or infinite: the first such vertex.
    #[error("has a coordinate that is NaN or infinite at vertex {0}; repair or remove it")]
    NotFinite(usize),
    /// No triangle has an area.
    #[error("has no triangle with an area; a mesh with faces is needed")]
    NoArea,
    /// Nothing can be solved.
    #[error("has triangles too thin to calculate with; remesh it")]
    Degenerate,
}

/// Why a motion cannot be moved onto a model.
#[derive(Debug, thiserror::Error)]
pub enum TransferError {
    /// The source cannot be used.
    #[error("the source {0}")]
    Source(MeshError),
    /// The target cannot be used.
    #[error("the target {0}")]
    Target(MeshError),
    /// The target is no surface.
    #[error("the target {0}")]
    TargetSurface(#[from] ObservationError),
    /// The source's surface cannot be seen.
    #[error("the source {0}")]
    SourceSurface(ObservationError),
    /// The source and its cage do not fit each other.
    #[error("the source and its cage do not go together: {0}")]
    Registration(#[from] RegistrationError),
    /// A cage in which a model has no coordinates.
    #[error("the {whose} cannot be put into the cage: {error}")]
    Coordinates {
        /// Source or target.
        whose: &'static str,
        /// Why not.
        error: CoordinatesError,
    },
    /// Points outside a cage whose coordinates end there.
    #[error(
        "{count} points of the {whose} lie outside the cage, where these coordinates are not defined; take a larger cage or mean value coordinates"
    )]
    Outside {
        /// Source or target.
        whose: &'static str,
        /// How many.
        count: usize,
    },
    /// A frame of other points than the rest pose.
    #[error("the source's frame {frame} has {points} points, its rest pose {expected}")]
    FramePoints {
        /// The frame.
        frame: usize,
        /// Its points.
        points: usize,
        /// Those of the rest pose.
        expected: usize,
    },
    /// A vertex pair that names a vertex that there is not.
    #[error(
        "pair {pair} names vertex {vertex} of the {whose}, which has {points} (all counted from 0); correct or remove it"
    )]
    Pair {
        /// The pair.
        pair: usize,
        /// Source or target.
        whose: &'static str,
        /// The vertex.
        vertex: u32,
        /// Vertices there are.
        points: usize,
    },
    /// NaN or infinity in a frame.
    #[error("the source's frame {frame} has a coordinate that is NaN or infinite at point {point}")]
    FrameNotFinite {
        /// The frame.
        frame: usize,
        /// The first such point.
        point: usize,
    },
    /// Two alignments that fit as well as each other; whether the axis that points up was given.
    #[error("{}", ambiguous(*.0))]
    Ambiguous(bool),
    /// The registration ended far from the target.
    #[error(
        "the source cannot be laid onto the target: {}; align them by hand, or take another source",
        unreached(*score, *limit)
    )]
    OutOfReach {
        /// In percent, 5 at the most; NaN where the registration came to nothing.
        score: f64,
        /// The most that is taken, in percent.
        limit: f64,
    },
    /// A cage that the source's points do not determine.
    #[error(
        "the source's points determine {rank} of the {unknowns} directions of the public cage; take a coarser cage"
    )]
    Rank {
        /// Directions that they determine.
        rank: usize,
        /// All of them.
        unknowns: usize,
    },
    /// No public cage can be made.
    #[error("no public cage can be made: {0}")]
    PublicCage(#[from] cager_cages::EncloseError),
    /// The source's cage is not valid once the source is aligned.
    #[error("the source's cage cannot be used: {0}")]
    SourceCage(cager_core::cage::CageError),
    /// It was told to stop.
    #[error("the transfer was stopped")]
    Stopped,
    /// The source does not determine the public cage well enough to be inverted.
    #[error("the source cannot be expressed by the public cage: {0}")]
    Inversion(PrepareError),
}

/// Why there is no shape between poses.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// The mesh cannot be solved on.
    #[error("the model {0}")]
    Mesh(#[from] MeshError),
    /// Fewer than two poses: how many there are.
    #[error("there {}; shapes between poses need two or more", if *.0 == 1 { "is only one pose" } else { "are no poses" })]
    TooFewPoses(usize),
    /// A pose of other points.
    #[error("pose {pose} has {points} points, the model {expected}")]
    OtherPoints {
        /// The pose.
        pose: usize,
        /// Its points.
        points: usize,
        /// Those of the model.
        expected: usize,
    },
    /// NaN or infinity in a pose.
    #[error("pose {pose} has a coordinate that is NaN or infinite at point {point}")]
    NotFinite {
        /// The pose.
        pose: usize,
        /// The first such point.
        point: usize,
    },
    /// Another number of weights than of poses.
    #[error("there {} for {poses} poses; give one for each", counted(*weights))]
    OtherWeights {
        /// Weights.
        weights: usize,
        /// Poses.
        poses: usize,
    },
    /// NaN or infinity as a weight: the pose.
    #[error("the weight of pose {0} is NaN or infinite; give a number")]
    Weight(usize),
    /// Weights that are not a share of the whole each: their sum.
    #[error("the weights sum to {0}, not to 1")]
    Sum(f64),
    /// Coordinates of something else than the vertices of the cage.
    #[error(
        "the coordinates have {columns} columns, the cage {vertices} vertices; take coordinates of vertices alone, such as mean value coordinates"
    )]
    Columns {
        /// Columns.
        columns: usize,
        /// Vertices.
        vertices: usize,
    },
    /// A cage that the points do not determine.
    #[error("the model's {rank} points cannot determine the {unknowns} vertices of the cage; take a coarser cage")]
    Rank {
        /// Points.
        rank: usize,
        /// Vertices.
        unknowns: usize,
    },
}

/// Scores above this share of the greatest one are mostly of distances that were cut off.
const CUT_OFF: f64 = 0.8;

fn ambiguous(up: bool) -> &'static str {
    if up {
        "source and target can be aligned in two ways that fit equally well, two headings about the axis up; take them as they stand, or give the alignment or pairs"
    } else {
        "source and target can be aligned in two ways that fit equally well; say which axis is up, take them as they stand, or give the alignment or pairs"
    }
}

fn unreached(score: f64, limit: f64) -> String {
    if score.is_nan() {
        return "the fit gave no finite numbers".to_owned();
    }
    let least = if score > CUT_OFF * 100.0 * MeasuredSurface::MAX_DISTANCE { "at least " } else { "" };
    format!("the surfaces stay {least}{score:.2} % of the target's size apart, more than {limit:.2} %")
}

fn counted(weights: usize) -> String {
    if weights == 1 { "is 1 weight".to_owned() } else { format!("are {weights} weights") }
}
