//! Frame rate and frame numbers that a user gives in place of those that files tell.

/// What is given; the rest is as it was found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timing {
    /// Frames per second.
    pub fps: Option<f64>,
    /// Number of the first frame.
    pub start: Option<f64>,
}

impl Timing {
    /// The numbers found, moved so that they begin with the one that is given.
    pub fn numbers(&self, mut found: Vec<f64>) -> Vec<f64> {
        if let (Some(start), Some(&first)) = (self.start, found.first()) {
            found.iter_mut().for_each(|number| *number += start - first);
        }
        found
    }
}
