//! Cages of frames in memory, one by one.

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_core::inversion::{PrepareError, Rows, Solver, SolverOptions};
use cager_geometry::mesh::Point;

/// Points or vertices of another number than those that an [`Inverter`] was prepared for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{found} positions where there are {expected}; give all of them, in their order")]
pub struct LengthError {
    /// Positions that were given.
    pub found: usize,
    /// Positions that there are.
    pub expected: usize,
}

/// Finds the cage of any pose of a model, prepared once for its rest pose and cage.
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
        let unknowns = MeanValue.values(cage).unknowns();
        let solver = Solver::prepare(&MeanValue, cage, rest, SolverOptions::for_unknowns(unknowns))?;
        Ok(Self { solver })
    }

    /// The vertices of the cage that follows these positions of the model's points most closely.
    ///
    /// # Errors
    /// Another number of points.
    pub fn cage(&self, positions: &[Point]) -> Result<Vec<Point>, LengthError> {
        check(positions, self.solver.decoder().points())?;
        let inverted = self.solver.invert(Rows::All, None, &[positions.as_flattened()]);
        Ok(points(&inverted[0].cage))
    }

    /// Where a cage takes the points of the model.
    ///
    /// # Errors
    /// Another number of vertices.
    pub fn positions(&self, cage: &[Point]) -> Result<Vec<Point>, LengthError> {
        check(cage, self.solver.decoder().unknowns())?;
        let single: Vec<f32> = cage.as_flattened().iter().map(|&x| x as f32).collect();
        let mut positions = [Vec::new()];
        self.solver.decoder().decode(&[&single], &mut positions);
        Ok(points(&positions[0]))
    }
}

fn check(given: &[Point], expected: usize) -> Result<(), LengthError> {
    let found = given.len();
    if found == expected { Ok(()) } else { Err(LengthError { found, expected }) }
}

/// Positions in single precision, three coordinates each, as points.
pub(crate) fn points(single: &[f32]) -> Vec<Point> {
    single.as_chunks().0.iter().map(|point: &[f32; 3]| point.map(f64::from)).collect()
}
