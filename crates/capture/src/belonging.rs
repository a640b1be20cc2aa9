//! Whether every frame of a capture goes on as its rest pose and the frames before it: a frame that does not is refused as it is read, or
//! noted where the user goes on all the same.

use crate::mismatch::watch::{Departure, Progress, Watch};
use cager_formats::Error;
use cager_geometry::mesh::{Model, Point, Polygons};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// What the frames of a capture are compared with.
#[derive(Debug)]
pub struct Belonging {
    watch: Watch,
    /// The file of the rest pose.
    rest: PathBuf,
    /// Whether frames that depart are read all the same.
    goes_on: bool,
    noted: OnceLock<String>,
}

impl Belonging {
    /// `None` for a rest pose with too little to compare.
    pub fn new((path, rest): (&Path, &Model), goes_on: bool) -> Option<Arc<Self>> {
        let watch = Watch::new(rest)?;
        Some(Arc::new(Self { watch, rest: path.to_owned(), goes_on, noted: OnceLock::new() }))
    }

    /// What was found of the first frame that departs, where reading went on.
    pub fn noted(&self) -> Option<&str> {
        self.noted.get().map(String::as_str)
    }

    /// Whether any of some frames in their order looks as if it departed.
    pub fn suspects(&self, frames: &[Vec<f64>]) -> bool {
        let mut progress = Progress::default();
        frames.iter().any(|frame| progress.look(&self.watch, frame.as_chunks().0, None).is_some())
    }
}

/// One pass over the frames.
pub struct Pass {
    belonging: Arc<Belonging>,
    progress: Progress,
    has_skipped: bool,
    /// A frame that is much smaller than those before; the next one decides.
    smaller: Option<Finding>,
}

impl Pass {
    /// Of the frames from the first.
    pub fn new(belonging: Arc<Belonging>) -> Self {
        Self { belonging, progress: Progress::default(), has_skipped: false, smaller: None }
    }

    /// Notes that the next frame is skipped.
    pub fn skipped(&mut self) {
        self.has_skipped = true;
    }

    /// Whether frames were skipped.
    pub fn has_skipped(&self) -> bool {
        self.has_skipped
    }

    /// Compares the next frame, number `number` in the file at `path`; what is found may be of the frame before.
    pub fn compare(&mut self, frame: &[Point], faces: Option<&Polygons>, path: &Path, number: f64) -> Option<Finding> {
        if self.belonging.noted().is_some() {
            return None;
        }
        let watch = &self.belonging.watch;
        let departure = self.progress.look(watch, frame, faces);
        let smaller = self.smaller.take().filter(|_| !self.progress.is_as_large_as_at_rest(watch));
        if smaller.is_some() {
            return smaller;
        }
        let departure = departure?;
        let found = Finding { belonging: self.belonging.clone(), departure, path: path.to_owned(), number };
        // Animators hide things for a frame by making them small.
        if matches!(departure, Departure::Units(ratio) if ratio < 1.0) {
            self.smaller = Some(found);
            return None;
        }
        Some(found)
    }
}

/// A frame that departs.
pub struct Finding {
    belonging: Arc<Belonging>,
    departure: Departure,
    path: PathBuf,
    number: f64,
}

impl Finding {
    /// Notes it where the user goes on all the same.
    ///
    /// # Errors
    /// What was found, and what to do, where the user does not.
    pub fn refuse_or_note(self) -> Result<(), Error> {
        let Self { belonging, departure, path, number } = self;
        let what =
            format!("frame {number} does not look like one of a capture of {}: {departure}", belonging.rest.display());
        if belonging.goes_on {
            let _ = belonging.noted.set(format!("{}: {what}", path.display()));
            return Ok(());
        }
        let advice = match departure {
            Departure::Order(_) | Departure::Faces => "export all from one program with the order of the points kept",
            Departure::Units(_) => "scale the frames alike",
            Departure::Mirrored(_) => "export all frames with the same axes, right-handed or left-handed",
        };
        Err(Error::Invalid { path, what: format!("{what}; {advice}, or pass --force to go on") })
    }
}
