//! The unit and the upward axis of coordinates, where a file says them.

/// The axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// As in most formats.
    Y,
    /// As in Blender and 3ds Max.
    Z,
}

/// What the coordinates of a file mean. Readers give them as they are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// The axis that points up.
    pub up: Up,
    /// The length of 1 in metres; positive.
    pub metres_per_unit: f64,
}
