//! The section `unit`: what the positions of a container mean.

use super::Error;
use crate::le::value_at;
use cager_geometry::units::{Units, Up};

/// Metres of one unit as f64, 0 where they are not known; and the upward axis.
pub(super) const UNITS_BYTES: usize = 9;

/// The content of the section; none where nothing is known.
pub(super) fn to_bytes(units: Units) -> Option<[u8; UNITS_BYTES]> {
    let mut bytes = [0; UNITS_BYTES];
    bytes[..8].copy_from_slice(&units.metres_per_unit.unwrap_or(0.0).to_le_bytes());
    bytes[8] = match units.up {
        None => 0,
        Some(Up::Y) => 1,
        Some(Up::Z) => 2,
    };
    (units != Units::UNKNOWN).then_some(bytes)
}

/// What the content says of a section at this offset.
pub(super) fn from_bytes(bytes: &[u8], offset: u64) -> Result<Units, Error> {
    let metres = value_at(bytes, 0, f64::from_le_bytes);
    let metres_per_unit = (metres != 0.0).then_some(metres);
    if metres_per_unit.is_some_and(|metres| !Units::is_length(metres)) {
        return Err(Error::corrupt(offset, format!("a unit of {metres} metres")));
    }
    let up = match bytes[8] {
        0 => None,
        1 => Some(Up::Y),
        2 => Some(Up::Z),
        other => return Err(Error::corrupt(offset, format!("no axis has the number {other}"))),
    };
    Ok(Units { up, metres_per_unit })
}
