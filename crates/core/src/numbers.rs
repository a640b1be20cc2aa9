//! Numbers in what is stored.

use serde::{Deserialize, Deserializer};

/// Reads a number that is not finite: JSON has none, and `null` stands for it.
///
/// # Errors
/// Those of the deserializer.
pub fn number_or_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    if deserializer.is_human_readable() {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
    } else {
        f64::deserialize(deserializer)
    }
}
