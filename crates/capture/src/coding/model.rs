//! What groups of one model are coded and decoded with.

use super::error::CodingError;
use cager_codec::{CageBasis, Error, Hierarchy, MAX_POSITIONS, MAX_ROWS, Residual, decode_cages};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, ElementPlan};
use cager_core::decode::Decoder;
use cager_core::inversion::{BATCH, Solver};
use cager_geometry::mesh::Model;

/// What the numbers of groups mean: the basis of the model's cages, and the order of its points.
pub(crate) struct GroupSpace {
    basis: CageBasis,
    hierarchy: Hierarchy,
}

impl GroupSpace {
    /// For a rest pose and cage as a decoder reads them, and the elements that their coordinates are solved on, where these are a numerical solution.
    ///
    /// # Errors
    /// More rows than can be coded; coordinates that cannot be computed.
    pub(crate) fn new(
        system: &dyn CoordinateSystem,
        cage: &Cage,
        rest: &Model,
        plan: Option<&ElementPlan>,
    ) -> Result<Self, CodingError> {
        let rows = system.values(cage).unknowns();
        if rows > MAX_ROWS {
            return Err(CodingError::TooManyRows { rows, most: MAX_ROWS });
        }
        if rest.points.len() > MAX_POSITIONS {
            return Err(CodingError::TooManyPoints { points: rest.points.len(), most: MAX_POSITIONS });
        }
        let basis = CageBasis::of(system, cage, &rest.points, plan, None)?;
        let (basis, _) = basis.ok_or(CodingError::Uncountable { first: 0, last: 0 })?;
        let hierarchy = Hierarchy::new(&rest.faces, rest.points.len());
        Ok(Self { basis, hierarchy })
    }
}

/// Decodes groups of frames of one model.
pub struct GroupDecoder {
    pub(super) basis: CageBasis,
    pub(super) hierarchy: Hierarchy,
    decoder: Decoder,
}

impl GroupDecoder {
    /// For a rest pose and cage as a decoder reads them, and the solver prepared with them.
    ///
    /// # Errors
    /// More rows than can be coded; coordinates that cannot be computed.
    pub fn new(system: &dyn CoordinateSystem, cage: &Cage, rest: &Model, solver: &Solver) -> Result<Self, CodingError> {
        let space = GroupSpace::new(system, cage, rest, solver.preparation().plan.as_ref())?;
        Ok(Self::in_space(space, solver))
    }

    /// With a space that was found while the solver was prepared.
    pub(crate) fn in_space(space: GroupSpace, solver: &Solver) -> Self {
        let GroupSpace { basis, hierarchy } = space;
        Self { basis, hierarchy, decoder: solver.decoder().clone() }
    }

    /// With about one in `every` of the points, in whole patches, and their numbers.
    pub(super) fn part(&self, every: usize) -> (Self, Vec<u32>) {
        let (hierarchy, points) = self.hierarchy.part(every);
        (Self { basis: self.basis.clone(), hierarchy, decoder: self.decoder.of_points(&points) }, points)
    }

    pub(super) fn points(&self) -> usize {
        self.decoder.points()
    }

    /// The cages of a group.
    ///
    /// # Errors
    /// Damaged bytes.
    pub fn cages(&self, frames: usize, bytes: &[u8]) -> Result<Vec<Vec<f32>>, Error> {
        decode_cages(&self.basis, frames, bytes)
    }

    /// The positions that cages say.
    pub fn positions(&self, cages: &[Vec<f32>]) -> Vec<Vec<f32>> {
        let mut positions: Vec<Vec<f32>> = vec![Vec::new(); cages.len()];
        for (cages, positions) in cages.chunks(BATCH).zip(positions.chunks_mut(BATCH)) {
            let cages: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
            self.decoder.decode(&cages, positions);
        }
        positions
    }

    /// Products that are added up for a coordinate.
    pub(super) fn terms(&self) -> usize {
        self.decoder.columns()
    }

    /// See [`Decoder::largest_sum`].
    pub(super) fn largest_sum(&self, cages: &[Vec<f32>]) -> f64 {
        self.decoder.largest_sum(&cages.iter().map(Vec::as_slice).collect::<Vec<_>>())
    }

    /// Adds a group's residual to all its positions.
    ///
    /// # Errors
    /// Damaged bytes.
    pub fn add_residual(&self, bytes: &[u8], positions: &mut [Vec<f32>]) -> Result<(), Error> {
        Residual::decode(&self.hierarchy, positions.len(), bytes, usize::MAX).map(|residual| residual.add(0, positions))
    }
}
