//! Cages that are designed from few poses.
