//! Which texel a point of a frame has: a row for each frame, and where points are more than a row
//! has, the rest in a block of rows below.

use crate::error::Fault;

/// Texels that images of all graphics cards may be wide and high.
const LARGEST: usize = 8192;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) points: usize,
    pub(super) frames: usize,
    pub(super) width: usize,
    /// Blocks of rows, each of one row a frame.
    pub(super) blocks: usize,
}

impl Layout {
    pub(super) fn of(points: usize, frames: usize) -> Result<Self, Fault> {
        let blocks = points.div_ceil(LARGEST);
        if blocks.saturating_mul(frames) > LARGEST {
            let most = LARGEST / blocks;
            return Err(Fault::unsupported(format!(
                "cannot hold {frames} frames of {points} points in an image of {LARGEST} × {LARGEST} texels; take \
                 {most} frames at the most (--range), or write .usdc or .abc"
            )));
        }
        Ok(Self { points, frames, width: points.div_ceil(blocks), blocks })
    }

    pub(super) fn height(&self) -> usize {
        self.blocks * self.frames
    }

    /// Points and the frame of each row.
    pub(super) fn rows(&self) -> impl Iterator<Item = (std::ops::Range<usize>, usize)> {
        let Self { points, frames, width, .. } = *self;
        (0..self.height()).map(move |row| {
            let first = row / frames * width;
            (first..(first + width).min(points), row % frames)
        })
    }

    /// The middle of a point's texel in the first frame, as fractions from the upper left corner.
    pub(super) fn place(&self, point: usize) -> [f32; 2] {
        let (column, row) = (point % self.width, point / self.width * self.frames);
        let middle = |texel: usize, all: usize| ((texel as f64 + 0.5) / all as f64) as f32;
        [middle(column, self.width), middle(row, self.height())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_of_every_frame_has_a_texel_of_its_own() {
        for (points, frames) in [(5, 3), (8192, 4), (8193, 2), (20_164, 60)] {
            let layout = Layout::of(points, frames).unwrap();
            assert!(layout.width <= LARGEST && layout.height() <= LARGEST);
            let rows: Vec<_> = layout.rows().collect();
            assert_eq!(rows.iter().map(|(points, _)| points.len()).sum::<usize>(), points * frames);
            for point in [0, 1, points / 2, points - 1] {
                let [u, v] = layout.place(point).map(f64::from);
                let (column, row) = ((u * layout.width as f64) as usize, (v * layout.height() as f64) as usize);
                assert_eq!((rows[row].0.start + column, rows[row].1), (point, 0));
                assert_eq!(rows[row + frames - 1], (rows[row].0.clone(), frames - 1));
            }
        }
        assert!(Layout::of(20_164, 8192 / 3 + 1).is_err());
    }
}
