//! Numbers of reports that may be none.

use serde::{Deserialize, Deserializer};

/// Reads a number that may be none: JSON writes `null` for NaN and infinities.
pub fn number_or_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    if deserializer.is_human_readable() {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
    } else {
        f64::deserialize(deserializer)
    }
}
