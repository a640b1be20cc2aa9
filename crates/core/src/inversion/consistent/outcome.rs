//! How the inversion of a frame ended.

/// How the inversion of one frame ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The last step lowered E by less than the tolerance, or no further step lowered it.
    Converged,
    /// The maximum number of steps was taken, each of which lowered E.
    StepLimit,
    /// No step lowered E: the cage is that of the linear start.
    KeptStart,
}
