//! Frames that are refused for where they lie: in other units or another order of bytes than the rest pose, or shifted.

use cager_geometry::mesh::{Point, bounds};

/// How many diagonals of the rest pose the middle point of a capture's first frame may lie from it: later frames travel, the first one
/// begins where the rest pose is.
const MAX_AT_FIRST: f64 = 100.0;
/// The same for any point of any frame: farther ones are no positions.
const MAX_DIAGONALS: f64 = 1e5;

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

    /// Why a frame is refused, if it lies too far away. `frame` is its number, `what` names its rows (`point` or `handle`), and `positions` has three
    /// coordinates for each row.
    pub(crate) fn refusal(&self, frame: u64, is_first: bool, what: &str, positions: &[f64]) -> Option<String> {
        self.refusal_of(frame, is_first, what, positions.as_chunks().0.iter().copied())
    }

    /// As [`Self::refusal`], of little-endian `f32`.
    pub(crate) fn refusal_of_bytes(&self, frame: u64, is_first: bool, what: &str, bytes: &[u8]) -> Option<String> {
        let points = bytes.as_chunks::<4>().0.as_chunks::<3>().0;
        let points = points.iter().map(|point| point.map(|number| f64::from(f32::from_le_bytes(number))));
        self.refusal_of(frame, is_first, what, points)
    }

    fn refusal_of(
        &self,
        frame: u64,
        is_first: bool,
        what: &str,
        points: impl Iterator<Item = Point> + Clone,
    ) -> Option<String> {
        let squared = |p: Point| p.iter().zip(self.centre).map(|(x, c)| (x - c).powi(2)).sum::<f64>();
        let in_diagonals = |squared: f64| squared.sqrt() / self.diagonal;
        let farthest = points.clone().map(squared).fold(0.0, f64::max);
        let far = if in_diagonals(farthest) > MAX_DIAGONALS {
            let row = points.clone().position(|p| squared(p) == farthest).unwrap_or(0);
            format!("{what} {row} lies {} diagonals of the rest pose away from it", shown(in_diagonals(farthest)))
        } else if is_first && in_diagonals(farthest) > MAX_AT_FIRST {
            let mut all: Vec<f64> = points.map(squared).collect();
            let middle = all.len() / 2;
            let (_, median, _) = all.select_nth_unstable_by(middle, f64::total_cmp);
            let diagonals = Some(in_diagonals(*median)).filter(|&diagonals| diagonals > MAX_AT_FIRST)?;
            format!("its first frame lies {} diagonals of the rest pose away from it", shown(diagonals))
        } else {
            return None;
        };
        Some(format!(
            "frame {frame}: {far}; send little-endian f32 in the units of the rest pose, and a rest pose that is where the capture begins"
        ))
    }
}

fn shown(diagonals: f64) -> String {
    if diagonals < 1e6 { format!("{diagonals:.0}") } else { format!("{diagonals:.1e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_capture_begins_near_its_rest_pose_and_travels_on_from_there() {
        let rest = [[1.0, 0.0, 0.0], [1.5, 0.0, 0.0], [2.0, 0.0, 0.0]];
        let reach = Reach::around(&rest, 1.0);
        let moved = |by: f64| rest.map(|[x, y, z]| [x + by, y, z]);
        assert_eq!(reach.refusal(0, true, "point", moved(99.0).as_flattened()), None);
        assert_eq!(reach.refusal(9, false, "point", moved(5000.0).as_flattened()), None);
        let said = reach.refusal(0, true, "point", moved(300.0).as_flattened()).expect("too far");
        assert!(said.starts_with("frame 0: its first frame lies 300 diagonals"), "{said}");
        // One stray point is no reason.
        let stray = [rest[0], rest[1], [0.0, 300.0, 0.0]];
        assert_eq!(reach.refusal(0, true, "point", stray.as_flattened()), None);
        let said = reach.refusal(7, false, "point", [rest[0], [0.0, 1e30, 0.0]].as_flattened()).expect("too far");
        assert!(said.starts_with("frame 7: point 1 lies 1.0e30 diagonals"), "{said}");
        assert!(reach.refusal(7, false, "point", [rest[0], [0.0, f64::MAX, 0.0]].as_flattened()).is_some());
    }
}
