//! Coordinate systems by name, and what is chosen where nothing is said.

use cager_core::coordinates::{CoordinateSystem, Green, Harmonic, MeanValue};
use cager_core::inversion::SolverOptions;

/// Every coordinate system, the usual one first.
pub(crate) const ALL: [&dyn CoordinateSystem; 4] = [&MeanValue, &Harmonic, &Green::Consistent, &Green::Free];

/// The coordinate system with this name on the command line, in reports and in containers.
pub(crate) fn by_name(name: &str) -> Option<&'static dyn CoordinateSystem> {
    ALL.into_iter().find(|system| system.name() == name)
}

/// The spectrum threshold where none is given: the paper's 20; less for a cage of which it would smooth the greater part.
pub(crate) fn default_spectrum(unknowns: usize) -> usize {
    let usual = SolverOptions::default().spectrum;
    if unknowns >= 2 * usual { usual } else { unknowns / 4 }
}
