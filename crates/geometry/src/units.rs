//! What coordinates mean, their unit and upward axis, and the change from one meaning to another.

use crate::mesh::Point;
use std::fmt;

/// The axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// As in most formats.
    Y,
    /// As in Blender and 3ds Max.
    Z,
}

impl Up {
    /// The name of the axis, in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The other one of both.
    pub fn other(self) -> Self {
        match self {
            Self::Y => Self::Z,
            Self::Z => Self::Y,
        }
    }
}

/// What coordinates mean, as far as it is said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Units {
    /// The axis that points up.
    pub up: Option<Up>,
    /// The length of 1 in metres; see [`Self::is_length`].
    pub metres_per_unit: Option<f64>,
}

impl Units {
    /// Nothing is said.
    pub const UNKNOWN: Self = Self { up: None, metres_per_unit: None };
    /// Metres and Y up, as in glTF.
    pub const METRES: Self = Self::new(Up::Y, 1.0);

    /// Both are said.
    pub const fn new(up: Up, metres_per_unit: f64) -> Self {
        Self { up: Some(up), metres_per_unit: Some(metres_per_unit) }
    }

    /// Whether a number of metres can be a unit: from the size of an atom to a hundred light years.
    pub fn is_length(metres: f64) -> bool {
        (1e-12..=1e18).contains(&metres)
    }

    /// What is said here, or else there.
    pub fn or(self, other: Self) -> Self {
        Self { up: self.up.or(other.up), metres_per_unit: self.metres_per_unit.or(other.metres_per_unit) }
    }

    /// The change to another meaning. What one does not say is as the other has it.
    pub fn change_to(self, other: Self) -> Change {
        /// Less than what programs round a unit by.
        const SAME: f64 = 1e-5;
        let ratio = self.metres_per_unit.zip(other.metres_per_unit).map(|(from, to)| from / to);
        Change {
            scale: ratio.filter(|ratio| (ratio - 1.0).abs() > SAME).unwrap_or(1.0),
            turn_to: other.up.filter(|&up| self.up.is_some_and(|own| own != up)),
        }
    }
}

/// A change of coordinates. It leaves the origin where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// What coordinates are multiplied by.
    pub scale: f64,
    /// The axis that points up afterwards, where it is the other one before.
    pub turn_to: Option<Up>,
}

impl Change {
    /// Whether it changes nothing.
    pub fn is_none(&self) -> bool {
        self.scale == 1.0 && self.turn_to.is_none()
    }

    /// The point in the other coordinates.
    pub fn apply(&self, point: Point) -> Point {
        let [x, y, z] = if self.scale == 1.0 { point } else { point.map(|x| self.scale * x) };
        match self.turn_to {
            Some(Up::Y) => [x, z, -y],
            Some(Up::Z) => [x, -z, y],
            None => [x, y, z],
        }
    }

    /// All points in the other coordinates.
    pub fn apply_to(&self, points: &mut [Point]) {
        if !self.is_none() {
            points.iter_mut().for_each(|point| *point = self.apply(*point));
        }
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scale: f64 = format!("{:.4e}", self.scale).parse().unwrap_or(self.scale);
        let scaled = (self.scale != 1.0).then(|| format!("scaled by {scale}"));
        let turned = self.turn_to.map(|up| format!("turned to {} up", up.name().to_uppercase()));
        match (scaled, turned) {
            (Some(scaled), Some(turned)) => write!(f, "{scaled} and {turned}"),
            (scaled, turned) => f.write_str(&scaled.or(turned).unwrap_or_else(|| "left as they are".to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_there_and_back_is_none() {
        let (centimetres, metres) = (Units::new(Up::Z, 0.01), Units::METRES);
        let there = centimetres.change_to(metres);
        assert_eq!(there.apply([100.0, 200.0, 300.0]), [1.0, 3.0, -2.0]);
        assert_eq!(metres.change_to(centimetres).apply([1.0, 3.0, -2.0]), [100.0, 200.0, 300.0]);
        assert!(centimetres.change_to(centimetres).is_none());
        assert_eq!(there.to_string(), "scaled by 0.01 and turned to Y up");
        let inches = Units { metres_per_unit: Some(0.0254), up: None };
        assert_eq!(metres.change_to(inches).to_string(), "scaled by 39.37");
    }

    #[test]
    fn what_is_not_said_changes_nothing() {
        let unit = Units { metres_per_unit: Some(0.01), up: None };
        for (from, to) in [(Units::UNKNOWN, Units::METRES), (Units::new(Up::Z, 0.01), Units::UNKNOWN), (unit, unit)] {
            assert!(from.change_to(to).is_none(), "{from:?} {to:?}");
        }
        assert_eq!(unit.or(Units::METRES), Units::new(Up::Y, 0.01));
        // Single precision of a hundredth.
        let rounded = Units { metres_per_unit: Some(f64::from(0.01_f32)), up: None };
        assert!(rounded.change_to(unit).is_none());
        assert!([0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300].iter().all(|&metres| !Units::is_length(metres)));
    }
}
