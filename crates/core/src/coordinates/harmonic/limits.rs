//! How many elements there may be, and of which degrees.

/// Elements that refining may make, unless there are half as many at first: the time grows with their cube.
pub(super) const MAX_ELEMENTS: usize = 2500;

/// Elements up to which all have so many low degrees: the equations of low unknowns are dense.
pub(super) const LOW_DEGREES: [(usize, usize); 3] = [(1300, 2), (3000, 1), (10_000, 0)];

/// Least degree that refining gives an element.
pub(super) const MIN_DEGREE: usize = 3;
