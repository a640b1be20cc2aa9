//! Layers of edits: what is added to vertices of the cages of some frames, beside frames that stay as they are.

use super::reader::ContainerReader;
use super::section::{Entry, SectionHeader};
use super::{Error, tag};
use crate::le::{self, u32_at};
use std::io::{Read, Seek};
use std::ops::Range;

/// Layers of a file, at the most.
pub const MAX_LAYERS: usize = 256;
/// Bytes of a layer's name, at the most.
pub const MAX_LAYER_NAME: usize = 256;

/// Switched off.
const OFF: u32 = 1;

/// One change of the cages: what is added to some of their vertices in each of some frames that follow each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EditLayer {
    /// What the user calls it; may be empty.
    pub name: String,
    /// Whether it is applied.
    pub is_on: bool,
    /// The first frame that it concerns.
    pub first: u32,
    /// The vertices that it moves, ascending.
    pub vertices: Vec<u32>,
    /// For each frame from `first` on, for each of the vertices, what is added to x, y and z.
    pub changes: Vec<f32>,
}

impl EditLayer {
    /// The layer that makes `new` cages of `old` ones, of as many frames: nothing where they are the same. Only the first rows, as many as `new` has, are
    /// compared. See [`LayerBuilder`].
    pub fn between(old: &[Vec<f32>], new: &[Vec<f32>], name: &str) -> Option<Self> {
        let mut builder = LayerBuilder::default();
        for (frame, (old, new)) in old.iter().zip(new).enumerate() {
            builder.add(frame, old, new);
        }
        builder.finish(name)
    }

    /// The frames that it concerns.
    pub fn frames(&self) -> Range<usize> {
        let first = self.first as usize;
        first..first + self.changes.len() / (3 * self.vertices.len()).max(1)
    }

    /// Moves the cage of a frame, rows × 3, whether or not the layer is on.
    pub fn apply(&self, frame: usize, rows: &mut [f32]) {
        let mut sums: Vec<f64> = rows.iter().map(|&x| x.into()).collect();
        self.add_to(frame, &mut sums);
        rows.iter_mut().zip(sums).for_each(|(row, sum)| *row = sum as f32);
    }

    /// Adds the changes of a frame to its rows.
    fn add_to(&self, frame: usize, rows: &mut [f64]) {
        let size = 3 * self.vertices.len();
        let Some(place) = frame.checked_sub(self.first as usize) else { return };
        let Some(changes) = self.changes.get(place * size..(place + 1) * size) else { return };
        for (&vertex, change) in self.vertices.iter().zip(changes.as_chunks::<3>().0) {
            for (row, &x) in rows.iter_mut().skip(3 * vertex as usize).zip(change) {
                *row += f64::from(x);
            }
        }
    }

    /// What a section of it decodes to.
    pub fn to_bytes(&self) -> Vec<u8> {
        let flags = if self.is_on { 0 } else { OFF };
        let words = [flags, self.vertices.len() as u32].into_iter().chain(self.vertices.iter().copied());
        let mut out: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
        out.extend(self.changes.iter().flat_map(|x| x.to_le_bytes()));
        out.extend_from_slice(self.name.as_bytes());
        out
    }

    /// Of what a section of these frames decodes to.
    fn from_bytes(raw: &[u8], (first, count): (u32, u32), rows: u64) -> Result<Self, &'static str> {
        let size = "a layer of edits does not have the size that its counts give it";
        let Some((head, rest)) = raw.split_at_checked(8) else { return Err(size) };
        let (flags, vertices) = (u32_at(head, 0), u32_at(head, 4) as usize);
        if flags & !OFF != 0 {
            return Err("a layer of edits has flags that this program does not know");
        }
        let bytes = vertices.checked_mul(12).and_then(|n| n.checked_mul(count as usize));
        let split = rest.split_at_checked(vertices.saturating_mul(4));
        let split = split.and_then(|(list, rest)| Some((list, rest.split_at_checked(bytes?)?)));
        let (Some((list, (changes, name))), true) = (split, vertices > 0 && count > 0) else { return Err(size) };
        if name.len() > MAX_LAYER_NAME {
            return Err(size);
        }
        let name = std::str::from_utf8(name).map_err(|_| "the name of a layer of edits is not UTF-8")?;
        let layer = Self {
            name: name.to_owned(),
            is_on: flags & OFF == 0,
            first,
            vertices: le::u32_values(list).collect(),
            changes: le::f32_values(changes).collect(),
        };
        layer.check(rows).map(|()| layer)
    }

    /// Whether it says what can be applied to frames of so many rows that are vertices.
    pub(super) fn check(&self, rows: u64) -> Result<(), &'static str> {
        let size = 3 * self.vertices.len();
        if size == 0 || self.changes.is_empty() || !self.changes.len().is_multiple_of(size) {
            return Err("a layer of edits has not one change for each vertex in each frame");
        }
        if self.name.len() > MAX_LAYER_NAME {
            return Err("the name of a layer of edits has more than 256 bytes; give a shorter one");
        }
        if self.vertices.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err("the vertices of a layer of edits do not ascend");
        }
        if self.vertices.last().is_some_and(|&last| u64::from(last) >= rows) {
            return Err("a layer of edits names a vertex that the cage does not have");
        }
        if self.changes.iter().any(|x| !x.is_finite()) {
            return Err("a layer of edits has a change that is not finite");
        }
        Ok(())
    }
}

/// Makes a layer of edited cages, frame by frame. A coordinate that is another by at most four units in the last place of the larger of both counts as the
/// same. The layer reaches from the first frame with another coordinate to the last one, and has the vertices with another one in any of these.
#[derive(Debug, Default)]
pub struct LayerBuilder {
    /// Frame, vertex and what is added, in the order of frames and vertices.
    found: Vec<(u32, u32, [f32; 3])>,
}

impl LayerBuilder {
    /// Compares a frame, which comes after all others; `old` may have more rows. Whether the cage is another.
    pub fn add(&mut self, frame: usize, old: &[f32], new: &[f32]) -> bool {
        let before = self.found.len();
        for (vertex, (old, new)) in old.as_chunks::<3>().0.iter().zip(new.as_chunks::<3>().0).enumerate() {
            let change = [0, 1, 2].map(|k| change(old[k], new[k]));
            if change != [0.0; 3] {
                self.found.push((frame as u32, vertex as u32, change));
            }
        }
        self.found.len() > before
    }

    /// The layer, switched on; nothing where all cages are the same.
    pub fn finish(self, name: &str) -> Option<EditLayer> {
        let (first, last) = (self.found.first()?.0, self.found.last()?.0);
        let mut vertices: Vec<u32> = self.found.iter().map(|&(_, vertex, _)| vertex).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut changes = vec![0.0; 3 * vertices.len() * ((last - first) as usize + 1)];
        for (frame, vertex, change) in self.found {
            let place = (frame - first) as usize * vertices.len() + vertices.partition_point(|&v| v < vertex);
            changes[3 * place..3 * place + 3].copy_from_slice(&change);
        }
        Some(EditLayer { name: name.to_owned(), is_on: true, first, vertices, changes })
    }
}

/// What is added to make a coordinate another; 0 where both count as the same.
fn change(old: f32, new: f32) -> f32 {
    let difference = f64::from(new) - f64::from(old);
    let larger = old.abs().max(new.abs());
    let exponent = ((larger.to_bits() >> 23) as i32).max(1) - 127;
    if difference.abs() <= 4.0 * 2f64.powi(exponent - 23) { 0.0 } else { difference as f32 }
}

/// The layers of a file, once they were read.
#[derive(Default)]
pub(super) struct Layers {
    all: Option<Vec<EditLayer>>,
    /// How many could not be read and are passed over, as of a damaged file that is read as far as it goes.
    pub(super) lost: usize,
    pub(super) passes_over_damage: bool,
    /// Whether the file ends before its table of contents.
    pub(super) is_cut: bool,
}

impl<R: Read + Seek> ContainerReader<R> {
    /// The layers of edits, in the order in which they are applied.
    ///
    /// # Errors
    /// Damage.
    pub fn layers(&mut self) -> Result<&[EditLayer], Error> {
        if self.layers.all.is_none() {
            let entries: Vec<Entry> = self.sections_of(tag::EDIT).collect();
            let mut all = Vec::with_capacity(entries.len());
            for entry in entries {
                match self.layer(entry) {
                    Ok(layer) => all.push(layer),
                    Err(Error::Corrupt { .. }) if self.layers.passes_over_damage => self.layers.lost += 1,
                    Err(error) => return Err(error),
                }
            }
            self.layers.all = Some(all);
        }
        Ok(self.layers.all.as_deref().unwrap_or_default())
    }

    /// Each layer of edits, or what is wrong with it, so that the others can be told from one that is damaged.
    pub fn each_layer(&mut self) -> Vec<Result<EditLayer, Error>> {
        let entries: Vec<Entry> = self.sections_of(tag::EDIT).collect();
        entries.into_iter().map(|entry| self.layer(entry)).collect()
    }

    /// Lets layers that cannot be read be passed over, and counted, instead of refusing every frame.
    #[must_use]
    pub fn passing_over_damaged_layers(mut self) -> Self {
        self.layers.passes_over_damage = true;
        self
    }

    /// How many layers of a damaged file cannot be read and are not applied; known once a frame was read.
    pub fn lost_layers(&self) -> usize {
        self.layers.lost
    }

    /// Applies one more layer to what is read from now on; the file stays as it is.
    ///
    /// # Errors
    /// A layer that does not fit the file, damage.
    pub fn push_layer(&mut self, layer: EditLayer) -> Result<(), Error> {
        let fits = layer.check(self.vertex_rows());
        fits.map_err(|what| Error::Invalid(what.to_owned()))?;
        self.layers()?;
        self.layers.all.get_or_insert_default().push(layer);
        Ok(())
    }

    /// Rows of a frame that are vertices of the cage.
    pub(super) fn vertex_rows(&self) -> u64 {
        self.header.cage_vertices.min(u64::from(self.header.rows_per_frame))
    }

    fn layer(&mut self, entry: Entry) -> Result<EditLayer, Error> {
        let SectionHeader { first, count, .. } = entry.header;
        let raw = self.raw(entry)?;
        EditLayer::from_bytes(&raw, (first, count), self.vertex_rows())
            .map_err(|what| Error::corrupt(entry.offset, what))
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
        let mut sums: Vec<f64> = rows.iter().map(|&x| x.into()).collect();
        layers.for_each(|layer| layer.add_to(frame, &mut sums));
        for (row, sum) in rows.iter_mut().zip(sums) {
            *row = sum as f32;
        }
        if rows.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        let offset = self.sections_of(tag::EDIT).next().map_or(0, |entry| entry.offset);
        Err(Error::corrupt(offset, format!("the edited cage of frame {frame} is not finite")))
    }
}
