//! Reading layers of edits, and frames as they change them.

use super::edits::EditLayer;
use super::reader::ContainerReader;
use super::section::Entry;
use super::{Error, tag};
use std::io::{Read, Seek};
use std::ops::Range;

impl<R: Read + Seek> ContainerReader<R> {
    /// The layers of edits, in the order in which they are applied.
    pub fn layers(&mut self) -> Result<&[EditLayer], Error> {
        if self.layers.all.is_none() {
            let mut all = Vec::new();
            for layer in self.each_layer() {
                match layer {
                    Ok(layer) => all.push(layer),
                    Err(Error::Corrupt { .. }) if self.layers.passes_over_damage => self.layers.lost += 1,
                    Err(error) => return Err(error),
                }
            }
            self.layers.all = Some(all);
        }
        Ok(self.layers.all.as_deref().unwrap_or_default())
    }

    /// Each layer of edits, or what is wrong with it.
    pub fn each_layer(&mut self) -> Vec<Result<EditLayer, Error>> {
        let entries: Vec<Entry> = self.sections_of(tag::EDIT).collect();
        entries.into_iter().map(|entry| self.layer(entry)).collect()
    }

    fn layer(&mut self, entry: Entry) -> Result<EditLayer, Error> {
        let raw = self.raw(entry)?;
        EditLayer::from_bytes(&raw, (entry.header.first, entry.header.count), self.vertex_rows())
            .map_err(|what| Error::corrupt(entry.offset, what))
    }

    /// Passes over layers that cannot be read, and counts them, instead of refusing every frame.
    #[must_use]
    pub fn passing_over_damaged_layers(mut self) -> Self {
        self.layers.passes_over_damage = true;
        self
    }

    /// How many layers cannot be read and are not applied; known once a frame was read.
    pub fn lost_layers(&self) -> usize {
        self.layers.lost
    }

    /// Applies one more layer to what is read from now on; the file stays as it is.
    ///
    /// # Errors
    /// A layer that does not fit the file, damage.
    pub fn push_layer(&mut self, layer: EditLayer) -> Result<(), Error> {
        self.check_layer(&layer)?;
        self.layers()?;
        self.layers.all.get_or_insert_default().push(layer);
        Ok(())
    }

    /// Whether a layer can be applied to the frames.
    pub(super) fn check_layer(&self, layer: &EditLayer) -> Result<(), Error> {
        layer.check(self.vertex_rows()).map_err(|what| Error::Invalid(what.to_owned()))
    }

    /// Rows of a frame that are vertices of the cage.
    fn vertex_rows(&self) -> u64 {
        self.header.cage_vertices.min(u64::from(self.header.rows_per_frame))
    }

    /// Whether each frame is changed by a layer that is on.
    pub(super) fn edited_frames(&mut self) -> Result<Vec<bool>, Error> {
        let mut edited = vec![false; self.frames];
        let frames = self.frames;
        for layer in self.layers()?.iter().filter(|layer| layer.is_on) {
            let Range { start, end } = layer.frames();
            edited[start.min(frames)..end.min(frames)].fill(true);
        }
        Ok(edited)
    }

    /// Applies the layers that are on to the rows of a frame.
    pub(super) fn apply_layers(&mut self, frame: usize, rows: &mut [f32]) -> Result<(), Error> {
        let concerns = |layer: &&EditLayer| layer.is_on && layer.frames().contains(&frame);
        let mut layers = self.layers()?.iter().filter(concerns).peekable();
        if layers.peek().is_none() {
            return Ok(());
        }
        EditLayer::apply_all(layers, frame, rows);
        if rows.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        let offset = self.sections_of(tag::EDIT).next().map_or(0, |entry| entry.offset);
        Err(Error::corrupt(offset, format!("the edited cage of frame {frame} is not finite")))
    }
}
