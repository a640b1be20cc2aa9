//! Coordinates far away from the origin.
