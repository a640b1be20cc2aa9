//! Coordinate systems by name.

use cager_core::coordinates::{CoordinateSystem, MeanValue};

/// The coordinate system with this name on the command line, in reports and in containers.
pub(crate) fn by_name(name: &str) -> Option<&'static dyn CoordinateSystem> {
    static MEAN_VALUE: MeanValue = MeanValue;
    let all: [&'static dyn CoordinateSystem; 1] = [&MEAN_VALUE];
    all.into_iter().find(|system| system.name() == name)
}
