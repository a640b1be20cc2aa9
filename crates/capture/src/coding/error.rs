//! Why frames cannot be coded as asked for.

use cager_core::coordinates::CoordinatesError;
use std::fmt;

/// The position that is farthest from the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Farthest {
    /// From 0.
    pub frame: usize,
    /// From 0.
    pub point: usize,
    /// Its largest coordinate, in diagonals of the rest pose.
    pub diagonals: f64,
}

impl fmt::Display for Farthest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            ", as point {} of frame {} is {:.0} diagonals of the rest pose away from the origin (check whether that is its place)",
            self.point, self.frame, self.diagonals
        )
    }
}

/// Why frames cannot be coded as asked for.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CodingError {
    /// Below what single precision can hold.
    #[error(
        "an error of {asked:.1e} of the diagonal is below what positions in single precision can hold here{}; {}",
        farthest.map(|far| far.to_string()).unwrap_or_default(),
        match farthest {
            _ if *least >= 1.0 => "check these frames, whose positions are very far from the origin".to_owned(),
            Some(_) => format!("ask for at least {least:.1e}, or move the capture closer to the origin"),
            None => format!("ask for at least {least:.1e}"),
        }
    )]
    BelowPrecision {
        /// Asked for.
        asked: f64,
        /// Smallest possible.
        least: f64,
        /// What it follows from.
        farthest: Option<Farthest>,
    },
    /// Too little room.
    #[error("{asked} bytes are too few for this capture and cage: allow at least {least}, or take a smaller cage")]
    TooSmall {
        /// Asked for.
        asked: u64,
        /// About the smallest that is met.
        least: u64,
    },
    /// Numbers that cannot be counted in steps.
    #[error(
        "frames {first} to {last} cannot be coded: positions are not finite, or so far apart that no step counts them; encode without a target for error, size or quality"
    )]
    Uncountable {
        /// First frame of the group, from 0.
        first: usize,
        /// Last one.
        last: usize,
    },
    /// Coordinates of the points that the basis of the cages is made from.
    #[error(transparent)]
    Coordinates(#[from] CoordinatesError),
    /// A model with very many points.
    #[error(
        "models of {points} points cannot be coded, only up to {most}; encode without a target for error, size or quality, or take a part of the model"
    )]
    TooManyPoints {
        /// Points.
        points: usize,
        /// Most that can be.
        most: usize,
    },
    /// A cage with very many vertices.
    #[error(
        "cages of {rows} rows cannot be coded, only up to {most}; encode without a target for error, size or quality, or take a smaller cage"
    )]
    TooManyRows {
        /// Rows of a frame.
        rows: usize,
        /// Most that can be.
        most: usize,
    },
}
