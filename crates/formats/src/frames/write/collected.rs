//! Formats that are written once all frames are known, which are in memory until then.

use cager_geometry::surface::Surface;
use cager_geometry::units::Change;

use super::output::{Announced, Output};
use crate::dropped::phrases_of;
use crate::error::{Error, Fault};

/// Bytes that frames may have.
pub(super) const MOST_BYTES: usize = 1 << 30;

/// A file or folder of all frames.
pub(super) trait Collection: Send {
    /// Writes all frames; gives what the user should know of them.
    fn write(&mut self, announced: &Announced, frames: &[f32]) -> Result<Option<String>, Error>;

    /// What of a surface has no place, where most of it has.
    fn lost_of_surface(&self) -> Option<&[String]> {
        None
    }

    fn commit(self) -> Result<(), Error>;
}

pub(super) struct Collected<C> {
    output: C,
    /// To metres with Y up.
    change: Change,
    frames: Vec<f32>,
    notes: Vec<String>,
}

impl<C: Collection> Collected<C> {
    /// `note` is what the user should know of the output before any frame.
    pub(super) fn new(output: C, change: Change, note: Option<String>) -> Self {
        Self { output, change, frames: Vec::new(), notes: note.into_iter().collect() }
    }
}

impl<C: Collection> Output for Collected<C> {
    fn write(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error> {
        if self.change.is_none() {
            self.frames.extend_from_slice(positions);
        } else {
            let changed = |point: &[f32; 3]| self.change.apply(point.map(f64::from)).map(|x| x as f32);
            self.frames.extend(positions.as_chunks().0.iter().flat_map(changed));
        }
        if announced.written + 1 == announced.frames {
            match self.output.write(announced, &self.frames) {
                Ok(note) => self.notes.extend(note),
                // What was not written is not counted, so that nothing is finished.
                Err(error) => {
                    self.frames.truncate(self.frames.len() - positions.len());
                    return Err(error);
                }
            }
        }
        Ok(())
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn keeps_surface(&self) -> bool {
        self.output.lost_of_surface().is_some()
    }

    fn lost(&self, surface: &Surface) -> Vec<String> {
        self.output.lost_of_surface().map_or_else(|| phrases_of(surface, false), <[String]>::to_vec)
    }

    fn finish(self: Box<Self>, _: &Announced) -> Result<(), Error> {
        self.output.commit()
    }
}

/// Refuses more frames than memory has room for; `bytes` are those that they need as `form`.
pub(super) fn check_room(announced: &Announced, bytes: usize, form: &str) -> Result<(), Fault> {
    if bytes <= MOST_BYTES {
        return Ok(());
    }
    let Announced { points, frames, .. } = announced;
    Err(Fault::unsupported(format!(
        "cannot hold {frames} frames of {points} points as {form}; take fewer of them (--range), or write .usdc or .abc"
    )))
}
