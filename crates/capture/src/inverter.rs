//! Cages of frames in memory, without a file.

use crate::positions::{decoded, not_single, points};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_core::inversion::{PrepareError, Rows, Solver, SolverOptions};
use cager_geometry::mesh::Point;

/// Positions that an [`Inverter`] cannot take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvertError {
    /// Points or vertices of another number than it was prepared for.
    #[error("frame {frame} has {found} positions where there are {expected}; give all of them, in their order")]
    Length {
        /// Which of the frames that were given, from 0.
        frame: usize,
        /// Positions that were given.
        found: usize,
        /// Positions that there are.
        expected: usize,
    },
    /// A coordinate that single precision does not hold.
    #[error("frame {frame}: position {position} is not finite, or too large for single precision")]
    NotFinite {
        /// Which of the frames that were given, from 0.
        frame: usize,
        /// Which of its positions, from 0.
        position: usize,
    },
}

/// Finds the cages of any poses of a model, prepared once for its rest pose and cage.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let demo = cager_demo::Capture::new(&cager_demo::Options { points: 400, frames: 4, cage_vertices: 42 });
/// # let (rest, cage) = (demo.rest.clone(), cager_core::cage::Cage::new(demo.cage.clone())?);
/// let inverter = cager_capture::Inverter::new(&rest.points, &cage)?;
/// let moved: Vec<[f64; 3]> = rest.points.iter().map(|[x, y, z]| [x + 0.1, *y, *z]).collect();
/// let cage_of_frame = inverter.cage(&moved)?;
/// let positions = inverter.positions(&cage_of_frame)?;
/// assert!((positions[0][0] - moved[0][0]).abs() < 1e-5);
/// # Ok(())
/// # }
/// ```
pub struct Inverter {
    solver: Solver,
}

impl Inverter {
    /// With mean value coordinates and the usual solver.
    ///
    /// # Errors
    /// A rest pose and a cage that cannot be used together.
    pub fn new(rest: &[Point], cage: &Cage) -> Result<Self, PrepareError> {
        Self::with_coordinates(rest, cage, &MeanValue)
    }

    /// With other coordinates, as [`Encode::coordinates`](crate::Encode::coordinates) takes them,
    /// and the usual solver. Cages of [`Green::Free`](crate::Green::Free) have the normals of the
    /// faces after the vertices.
    ///
    /// # Errors
    /// A rest pose and a cage that cannot be used together, or not with these coordinates.
    pub fn with_coordinates(rest: &[Point], cage: &Cage, system: &dyn CoordinateSystem) -> Result<Self, PrepareError> {
        let options = SolverOptions::for_unknowns(system.values(cage).unknowns());
        Ok(Self { solver: Solver::prepare(system, cage, rest, options)? })
    }

    /// The vertices of the cage that follows these positions of the model's points most closely.
    ///
    /// # Errors
    /// See [`InvertError`].
    pub fn cage(&self, positions: &[Point]) -> Result<Vec<Point>, InvertError> {
        Ok(self.cages(&[positions])?.swap_remove(0))
    }

    /// The cages of any number of frames; those of many at once take less time than one by one.
    ///
    /// # Errors
    /// See [`InvertError`].
    pub fn cages<F: AsRef<[Point]>>(&self, frames: &[F]) -> Result<Vec<Vec<Point>>, InvertError> {
        for (frame, positions) in frames.iter().enumerate() {
            check(frame, positions.as_ref(), self.solver.decoder().points())?;
        }
        let flat: Vec<&[f64]> = frames.iter().map(|frame| frame.as_ref().as_flattened()).collect();
        let inverted = self.solver.invert(Rows::All, None, &flat);
        Ok(inverted.iter().map(|inverted| points(&inverted.cage)).collect())
    }

    /// Where a cage takes the points of the model.
    ///
    /// # Errors
    /// See [`InvertError`].
    pub fn positions(&self, cage: &[Point]) -> Result<Vec<Point>, InvertError> {
        check(0, cage, self.solver.decoder().unknowns())?;
        let single: Vec<f32> = cage.as_flattened().iter().map(|&x| x as f32).collect();
        Ok(points(&decoded(self.solver.decoder(), &[&single])[0]))
    }
}

fn check(frame: usize, given: &[Point], expected: usize) -> Result<(), InvertError> {
    if given.len() != expected {
        return Err(InvertError::Length { frame, found: given.len(), expected });
    }
    match not_single(given) {
        Some(position) => Err(InvertError::NotFinite { frame, position }),
        None => Ok(()),
    }
}
