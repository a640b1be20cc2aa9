//! Coordinate systems by name.

use cager_core::coordinates::{CoordinateSystem, Green, Harmonic, MeanValue};

/// Every coordinate system, the usual one first.
pub(crate) const ALL: [&dyn CoordinateSystem; 4] = [&MeanValue, &Harmonic, &Green::Consistent, &Green::Free];

/// The coordinate system with this name on the command line, in reports and in containers.
pub(crate) fn by_name(name: &str) -> Option<&'static dyn CoordinateSystem> {
    ALL.into_iter().find(|system| system.name() == name)
}
