//! Whether every frame of a capture goes on as its rest pose and the frames before it; one that
//! does not is refused, or noted where the user goes on all the same.

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
    /// What a refusal ends with.
    hint: &'static str,
    noted: OnceLock<String>,
}

impl Belonging {
    /// `None` for a rest pose with too little to compare. `hint` ends the message of a refusal, as
    /// in [`Hints::mismatch`](crate::frames::Hints).
    pub fn new((path, rest): (&Path, &Model), goes_on: bool, hint: &'static str) -> Option<Arc<Self>> {
        let watch = Watch::new(rest)?;
        Some(Arc::new(Self { watch, rest: path.to_owned(), goes_on, hint, noted: OnceLock::new() }))
    }

    /// What was found of the first frame that departs, where reading went on.
    pub fn noted(&self) -> Option<&str> {
        self.noted.get().map(String::as_str)
    }

    fn refuse_or_note(&self, departure: Departure, path: PathBuf, number: f64) -> Result<(), Error> {
        let rest = self.rest.display();
        let what = format!("frame {number} does not look like one of a capture of {rest}: {departure}");
        if self.goes_on {
            let _ = self.noted.set(format!("{}: {what}", path.display()));
            return Ok(());
        }
        let advice = match departure {
            Departure::Order(_) | Departure::Faces => "export all from one program with the order of the points kept",
            Departure::Units(_) => "scale the frames alike",
            Departure::Mirrored(_) => "export all frames with the same axes, right-handed or left-handed",
        };
        Err(Error::Invalid { path, what: format!("{what}; {advice}{}", self.hint) })
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
    /// A frame much smaller than those before, its file and number; the next one decides.
    smaller: Option<(Departure, PathBuf, f64)>,
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

    /// Compares the next frame, number `number` in the file at `path`; what is found may be of the
    /// frame before. True where it departs after frames were skipped, which may depart as well.
    ///
    /// # Errors
    /// What was found, and what to do, where the user does not go on all the same.
    pub fn compare(
        &mut self,
        frame: &[Point],
        faces: Option<&Polygons>,
        path: &Path,
        number: f64,
    ) -> Result<bool, Error> {
        if self.belonging.noted().is_some() {
            return Ok(false);
        }
        let watch = &self.belonging.watch;
        let departure = self.progress.look(watch, frame, faces);
        let smaller = self.smaller.take().filter(|_| !self.progress.is_as_large_as_at_rest(watch));
        let (departure, path, number) = match (smaller, departure) {
            (Some(earlier), _) => earlier,
            (None, None) => return Ok(false),
            // Animators hide things for a frame by making them small.
            (None, Some(Departure::Units(ratio))) if ratio < 1.0 => {
                self.smaller = Some((Departure::Units(ratio), path.to_owned(), number));
                return Ok(false);
            }
            (None, Some(departure)) => (departure, path.to_owned(), number),
        };
        if self.has_skipped {
            return Ok(true);
        }
        self.belonging.refuse_or_note(departure, path, number).map(|()| false)
    }
}
