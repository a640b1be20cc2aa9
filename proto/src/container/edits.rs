//! Layers of edits: what is added to the cages of some frames, which stay as they are.

use crate::le::{f32s, value_at, values};
use std::ops::Range;

/// Layers of a file, at the most.
pub const MAX_LAYERS: usize = 256;
/// Bytes of a layer's name, at the most.
pub const MAX_LAYER_NAME: usize = 256;

/// Switched off.
const OFF: u32 = 1;

/// What is added to some vertices of the cages in consecutive frames.
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
    /// The frames that it concerns.
    pub fn frames(&self) -> Range<usize> {
        let first = self.first as usize;
        first..first + self.changes.len() / (3 * self.vertices.len()).max(1)
    }

    /// Moves the cage of a frame, rows × 3, whether or not the layer is on.
    pub fn apply(&self, frame: usize, rows: &mut [f32]) {
        Self::apply_all([self].into_iter(), frame, rows);
    }

    /// Moves the cage of a frame, rows × 3, by each of these layers.
    pub(super) fn apply_all<'a>(layers: impl Iterator<Item = &'a Self>, frame: usize, rows: &mut [f32]) {
        let mut sums: Vec<f64> = rows.iter().map(|&x| x.into()).collect();
        layers.for_each(|layer| layer.add_to(frame, &mut sums));
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
    pub(super) fn from_bytes(raw: &[u8], (first, count): (u32, u32), rows: u64) -> Result<Self, &'static str> {
        let size = "a layer of edits does not have the size that its counts give it";
        let Some((head, rest)) = raw.split_at_checked(8) else { return Err(size) };
        let (flags, vertices) = (value_at(head, 0, u32::from_le_bytes), value_at(head, 4, u32::from_le_bytes) as usize);
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
            vertices: values(list, u32::from_le_bytes).collect(),
            changes: f32s(changes),
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

/// Makes a layer of edited cages: from the first changed frame to the last, of all vertices that
/// change in any. Coordinates within four units in the last place are the same.
#[derive(Debug, Default)]
pub struct LayerBuilder {
    /// Frame, vertex and what is added, in the order of frames and vertices.
    found: Vec<(u32, u32, [f32; 3])>,
}

impl LayerBuilder {
    /// Compares a frame after all others; `old` may have more rows. Whether the cage changed.
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
    pub(super) all: Option<Vec<EditLayer>>,
    /// How many layers of a damaged file could not be read and are passed over.
    pub(super) lost: usize,
    pub(super) passes_over_damage: bool,
    /// Whether the file ends before its table of contents.
    pub(super) is_cut: bool,
}
