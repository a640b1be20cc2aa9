//! The numbers of a file: positions, corners, times and weights, and what vertices have beside these.

use std::io::{self, Write};

use super::stored::Stored;
use super::{Morphs, Piece, Scene};
use crate::error::Fault;

/// Vertices that corners of two bytes count; the last number has a meaning of its own.
const FEW: usize = 65_535;

/// Where the middle of the stored positions is.
pub(super) fn place(stored: &Stored, scene: &Scene) -> [f64; 3] {
    std::array::from_fn(|k| f64::from(stored.centre[k]) + scene.origin[k])
}

impl Morphs<'_> {
    pub(super) fn write_numbers(&self, out: &mut impl Write) -> io::Result<()> {
        self.write_positions(out)?;
        self.write_corners(out)?;
        let mut animation = self.scene.times.iter().chain(&self.components.weights);
        animation.try_for_each(|x| out.write_all(&x.to_le_bytes()))?;
        self.write_others(out)
    }

    /// Refuses what the lengths in the file cannot count.
    pub(super) fn check(&self) -> Result<(), Fault> {
        // What is described beside the numbers takes far less than this.
        const OTHER: usize = 1 << 24;
        if self.lengths().iter().sum::<usize>() > u32::MAX as usize - OTHER {
            return Err(Fault::unsupported(
                "cannot hold more than 4 GiB; take fewer morph targets (--targets), or write .usdc or .abc",
            ));
        }
        Ok(())
    }

    /// Bytes of a position: whole numbers are filled up to whole words.
    pub(super) fn stride(&self) -> usize {
        if self.components.stored.is_float { 12 } else { 8 }
    }

    pub(super) fn corner_size(&self) -> usize {
        if self.scene.pieces.iter().all(|piece| piece.vertices.len() <= FEW) { 2 } else { 4 }
    }

    /// Of positions, corners, times and weights, normals, what else vertices have, and what shows
    /// and hides.
    pub(super) fn lengths(&self) -> [usize; 6] {
        let (parts, pieces) = (self.components.stored.parts(), &self.scene.pieces);
        let vertices =
            |is_one: fn(&&Piece) -> bool| pieces.iter().filter(is_one).map(|piece| piece.vertices.len()).sum::<usize>();
        let triangles = pieces.iter().flat_map(|piece| &piece.primitives).map(|(_, triangles)| triangles.len());
        let corners = (3 * triangles.sum::<usize>() * self.corner_size()).next_multiple_of(4);
        let other = |piece: &Piece| piece.vertices.len() * (8 * piece.uv_sets.len() + 16 * piece.color_sets.len());
        let keys = pieces.iter().map(|piece| 16 * self.switches(piece).len());
        [
            parts * vertices(|_| true) * self.stride(),
            corners,
            4 * (self.scene.times.len() + self.components.weights.len()),
            12 * parts * vertices(|piece| piece.normals.is_some()),
            pieces.iter().map(other).sum(),
            keys.sum(),
        ]
    }

    /// Frames from which on a mesh is shown or not; none where it always is.
    pub(super) fn switches(&self, piece: &Piece) -> Vec<(usize, bool)> {
        let Some(shown) = piece.shown.as_ref().filter(|_| !self.scene.times.is_empty()) else { return Vec::new() };
        let is_shown = |frame: usize| shown.iter().any(|range| range.contains(&(frame as u32)));
        let all = (0..self.scene.times.len()).map(|frame| (frame, is_shown(frame)));
        let mut switches: Vec<(usize, bool)> = all.collect();
        switches.dedup_by_key(|(_, is_shown)| *is_shown);
        switches
    }

    fn write_positions(&self, out: &mut impl Write) -> io::Result<()> {
        let stored = &self.components.stored;
        for piece in &self.scene.pieces {
            for part in 0..stored.parts() {
                for &point in &piece.vertices {
                    let [x, y, z] = stored.at(part, point);
                    if stored.is_float {
                        out.write_all([x, y, z].map(f32::to_le_bytes).as_flattened())?;
                    } else {
                        out.write_all([x, y, z, 0.0].map(|x| (x as i16).to_le_bytes()).as_flattened())?;
                    }
                }
            }
        }
        Ok(())
    }

    fn write_corners(&self, out: &mut impl Write) -> io::Result<()> {
        let (primitives, small) =
            (self.scene.pieces.iter().flat_map(|piece| &piece.primitives), self.corner_size() == 2);
        let mut count = 0;
        for corner in primitives.flat_map(|(_, triangles)| triangles.as_flattened()) {
            let bytes = corner.to_le_bytes();
            out.write_all(if small { &bytes[..2] } else { &bytes })?;
            count += 1;
        }
        if small && count % 2 == 1 {
            out.write_all(&[0; 2])?;
        }
        Ok(())
    }

    /// Normals of vertices, what else they have, and scales that show and hide meshes behind their
    /// times.
    fn write_others(&self, out: &mut impl Write) -> io::Result<()> {
        let mut write = |numbers: &[f32]| numbers.iter().try_for_each(|x| out.write_all(&x.to_le_bytes()));
        let parts = self.components.stored.parts();
        let (all, mut first) = (self.normals.len() / parts, 0);
        for normals in self.scene.pieces.iter().filter_map(|piece| piece.normals.as_ref()) {
            for part in 0..parts {
                let of_part = &self.normals[part * all + first..];
                normals.of_vertices.iter().try_for_each(|&k| write(&of_part[k as usize]))?;
            }
            first += normals.count(self.components.stored.points());
        }
        for piece in &self.scene.pieces {
            piece.uv_sets.iter().try_for_each(|set| write(set.as_flattened()))?;
            piece.color_sets.iter().try_for_each(|set| write(set.as_flattened()))?;
        }
        for piece in &self.scene.pieces {
            let switches = self.switches(piece);
            switches.iter().try_for_each(|&(frame, _)| write(&[self.scene.times[frame]]))?;
            let scale = |is_shown: bool| if is_shown { self.components.stored.step } else { 0.0 };
            switches.iter().try_for_each(|&(_, is_shown)| write(&[scale(is_shown); 3]))?;
        }
        Ok(())
    }
}
