//! Frame rate and frame numbers given by the user, which override those of the files.

/// Overrides; `None` keeps the value of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timing {
    /// Frames per second.
    pub fps: Option<f64>,
    /// Number of the first frame.
    pub start: Option<f64>,
}

impl Timing {
    /// Shifts frame numbers so that they begin with `start`.
    pub fn numbers(&self, mut found: Vec<f64>) -> Vec<f64> {
        if let (Some(start), Some(&first)) = (self.start, found.first()) {
            found.iter_mut().for_each(|number| *number += start - first);
        }
        found
    }
}
