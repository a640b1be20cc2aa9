//! The vertical axis.

use cager_geometry::mesh::{Point, bounds};
use cager_geometry::vector::sub;
use serde::Serialize;

/// An axis so much longer than the two others is the vertical one, whatever the file says.
const STANDING: f64 = 1.8;

/// The axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// The first coordinate.
    X,
    /// The second, as in most modelling programs.
    Y,
    /// The third.
    Z,
}

impl Up {
    /// A guess: y, unless the model stands along z.
    pub(crate) fn guess(points: &[Point]) -> Self {
        let (low, high) = bounds(points);
        let extent = sub(high, low);
        if extent[2] > STANDING * extent[0].max(extent[1]) { Self::Z } else { Self::Y }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tall_model_stands_along_z() {
        assert_eq!(Up::guess(&[[0.0; 3], [0.5, 0.5, 2.0]]), Up::Z);
        assert_eq!(Up::guess(&[[0.0; 3], [0.3, 1.0, 1.3]]), Up::Y);
    }
}
