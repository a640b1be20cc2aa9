//! Frames that lie farther from the rest pose than captures travel: in other units, in another order of bytes, or no positions at all.

use cager_core::mesh::{Point, bounds};

/// How many diagonals of the rest pose a point may lie from it. Captures travel some, frames that are none hundreds at once.
const MOST_DIAGONALS: f64 = 100.0;

/// Where the points of a capture's frames may lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    centre: Point,
    diagonal: f64,
}

impl Reach {
    /// Around the middle of these points; `diagonal` is that of the rest pose.
    pub(crate) fn around(points: &[Point], diagonal: f64) -> Self {
        let (low, high) = bounds(points);
        Self { centre: std::array::from_fn(|k| (low[k] + high[k]) / 2.0), diagonal }
    }

    /// The point of a frame that lies farthest away, if that is too far: its index, and how many diagonals away it is.
    pub(crate) fn beyond(&self, points: impl Iterator<Item = Point> + Clone) -> Option<(usize, f64)> {
        let squared = |p: Point| p.iter().zip(self.centre).map(|(x, c)| (x - c).powi(2)).sum::<f64>();
        let farthest = points.clone().map(squared).fold(0.0, f64::max);
        let diagonals = farthest.sqrt() / self.diagonal;
        let mut points = points;
        (diagonals > MOST_DIAGONALS).then(|| (points.position(|p| squared(p) == farthest).unwrap_or(0), diagonals))
    }
}

/// What is wrong with such a frame: its `what`, such as a point, `row` lies so many diagonals away.
pub(crate) fn too_far(frame: impl std::fmt::Display, what: &str, row: usize, diagonals: f64) -> String {
    let distance = if diagonals < 1e6 { format!("{diagonals:.0}") } else { format!("{diagonals:.1e}") };
    format!(
        "frame {frame}: {what} {row} lies {distance} diagonals of the rest pose away from it, and {MOST_DIAGONALS} are the most; send little-endian f32 in the units of the rest pose, and a capture that travels so far nearer to it"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_may_travel_but_not_hundreds_of_diagonals() {
        let rest = [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let reach = Reach::around(&rest, 1.0);
        let moved = |by: f64| rest.map(|[x, y, z]| [x + by, y, z]);
        assert_eq!(reach.beyond(moved(99.0).into_iter()), None);
        let (row, diagonals) = reach.beyond(moved(300.0).into_iter()).expect("too far");
        assert!((row, diagonals) == (1, 300.5), "{row} {diagonals}");
        assert!(reach.beyond([[1.5, 0.0, 0.0], [0.0, f64::MAX, 0.0]].into_iter()).is_some());
    }
}
