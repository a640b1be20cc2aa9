//! What groups of one model are coded and decoded with.

use super::error::CodingError;
use crate::positions::decoded;
use cager_codec::{
    BasisRecord, CageBasis, Error, Hierarchy, MAX_POSITIONS, MAX_ROWS, Residual, basis_record, decode_cages,
};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, ElementPlan};
use cager_core::decode::Decoder;
use cager_core::inversion::Solver;
use cager_geometry::mesh::Model;
use std::sync::{Arc, Mutex, PoisonError};

/// What the numbers of groups mean: the basis of the model's cages, and the order of its points.
pub(crate) struct GroupSpace {
    basis: CageBasis,
    hierarchy: Hierarchy,
}

impl GroupSpace {
    /// For a rest pose and cage as a decoder reads them, and the elements of coordinates that are
    /// solved for.
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
    /// The basis of groups that are in another one.
    other: Mutex<Option<Arc<CageBasis>>>,
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
        Self { basis, hierarchy, decoder: solver.decoder().clone(), other: Mutex::default() }
    }

    /// With about one in `every` of the points, in whole patches, and their numbers.
    pub(super) fn part(&self, every: usize) -> (Self, Vec<u32>) {
        let (hierarchy, points) = self.hierarchy.part(every);
        let (basis, decoder) = (self.basis.clone(), self.decoder.of_points(&points));
        (Self { basis, hierarchy, decoder, other: Mutex::default() }, points)
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

    /// The same of groups that may be coded in another basis, which `other` computes.
    ///
    /// # Errors
    /// Damaged bytes; a basis that cannot be computed.
    pub fn cages_in(
        &self,
        frames: usize,
        bytes: &[u8],
        other: impl FnOnce(&BasisRecord) -> Option<CageBasis>,
    ) -> Result<Vec<Vec<f32>>, Error> {
        let record = basis_record(bytes)?;
        if &record == self.basis.record() {
            return self.cages(frames, bytes);
        }
        let mut kept = self.other.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.take().filter(|basis| basis.record() == &record);
        let basis = known.or_else(|| other(&record).map(Arc::new));
        let basis = basis.ok_or(Error::Damaged("the basis of a group of cages cannot be computed"))?;
        *kept = Some(Arc::clone(&basis));
        drop(kept);
        decode_cages(&basis, frames, bytes)
    }

    /// The positions that cages say.
    pub fn positions(&self, cages: &[Vec<f32>]) -> Vec<Vec<f32>> {
        decoded(&self.decoder, &cages.iter().map(Vec::as_slice).collect::<Vec<_>>())
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

#[cfg(test)]
mod tests {
    use super::*;
    use cager_codec::{AdjacentGroups, encode_cages};
    use cager_core::coordinates::MeanValue;
    use cager_core::inversion::SolverOptions;
    use cager_geometry::mesh::{Point, TriMesh};

    #[test]
    fn groups_of_earlier_programs_are_decoded_in_their_basis() {
        let vertices: Vec<Point> = vec![[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let cage = Cage::new(TriMesh { vertices, triangles }).unwrap();
        let points = (0..8).map(|k| [0.5, 0.6, 0.8].map(|x| x + 0.1 * f64::from(k % 3))).collect();
        let rest = Model { points, ..Model::default() };
        let solver = Solver::prepare(&MeanValue, &cage, &rest.points, SolverOptions::for_unknowns(4)).unwrap();
        let decoder = GroupDecoder::new(&MeanValue, &cage, &rest, &solver).unwrap();
        let basis = |record: &BasisRecord| CageBasis::of(&MeanValue, &cage, &rest.points, None, Some(record));
        let earlier = BasisRecord { rotated: false, rounding: None };
        let moved: Vec<f32> = cage.vertices().as_flattened().iter().map(|&x| 1.25 * x as f32 + 0.5).collect();
        let coded = encode_cages(&basis(&earlier).unwrap().unwrap().0, &[&moved], 1e-5, AdjacentGroups::default());
        let coded = coded.unwrap();
        assert!(decoder.cages(1, &coded).is_err());
        let other = |record: &BasisRecord| Some(basis(record).ok()??.0);
        for _ in 0..2 {
            let [cage] = decoder.cages_in(1, &coded, other).unwrap().try_into().unwrap();
            assert!(cage.iter().zip(&moved).all(|(a, b)| (a - b).abs() < 1e-3), "{cage:?}");
        }
        // The basis is kept, and this program's own groups need none.
        assert!(decoder.cages_in(1, &coded, |_| unreachable!()).is_ok());
        let own = encode_cages(&decoder.basis, &[&moved], 1e-5, AdjacentGroups::default()).unwrap();
        assert!(decoder.cages_in(1, &own, |_| unreachable!()).is_ok());
    }
}
