//! Detection of cages that miss their model because of different units, axes or position.

use cager_geometry::mesh::{Model, Point, TriMesh, bounds};
use cager_geometry::spatial::outside;
use std::fmt;

/// Points that candidates are judged by.
const SAMPLE: usize = 400;

/// A flat model's cage may be as thick as twice this part of its longest side.
const THICKNESS: f64 = 0.1;

/// Ratios of common units of length: powers of ten, inches, feet.
const UNITS: [f64; 13] =
    [1.0, 10.0, 0.1, 100.0, 0.01, 1000.0, 0.001, 2.54, 1.0 / 2.54, 25.4, 0.0254, 0.3048, 1.0 / 0.3048];

/// A change of the cage after which it would enclose the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Factor on all coordinates.
    pub scale: f64,
    /// Axes to turn: `"y and z"` where up is another axis, otherwise none.
    pub axes: Option<&'static str>,
    /// Move after that, in units of the model.
    pub shift: [f64; 3],
}

/// A change of axes.
type Turn = fn(Point) -> Point;

/// The smallest change of units, axes and position after which nine of ten points are inside.
pub fn alignment(mesh: &TriMesh, model: &Model) -> Option<Alignment> {
    let stride = model.points.len().div_ceil(SAMPLE).max(1);
    let sample: Vec<Point> = model.points.iter().step_by(stride).copied().collect();
    let (low, high) = bounds(&model.points);
    let turns: [(Option<&'static str>, Turn); 3] =
        [(None, |p| p), (Some("y and z"), |[x, y, z]| [x, z, -y]), (Some("y and z"), |[x, y, z]| [x, -z, y])];
    for moved in [false, true] {
        for (axes, turn) in turns {
            for scale in UNITS {
                let mut changed = mesh.clone();
                changed.vertices.iter_mut().for_each(|p| *p = turn(*p).map(|x| scale * x));
                let (cage_low, cage_high) = bounds(&changed.vertices);
                let shift: Point = std::array::from_fn(|k| {
                    if moved { 0.5 * (low[k] + high[k] - cage_low[k] - cage_high[k]) } else { 0.0 }
                });
                changed.vertices.iter_mut().for_each(|p| *p = std::array::from_fn(|k| p[k] + shift[k]));
                // A much larger cage would enclose the model by chance; flat ones are thicker.
                let size = |k: usize| high[k] - low[k];
                let least = THICKNESS * (0..3).map(size).fold(0.0, f64::max);
                let fits = (0..3).all(|k| cage_high[k] - cage_low[k] < 2.0 * size(k).max(least));
                if fits && 10 * outside(&changed, &sample).len() <= sample.len() {
                    return Some(Alignment { scale, axes, shift });
                }
            }
        }
    }
    None
}

impl fmt::Display for Alignment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut changes = Vec::new();
        if self.scale != 1.0 {
            changes.push(format!("scaled by {:.4}", self.scale));
        }
        if let Some(axes) = self.axes {
            changes.push(format!("turned so that {axes} change places"));
        }
        if self.shift != [0.0; 3] {
            let [x, y, z] = self.shift;
            changes.push(format!("moved by ({x:.4}, {y:.4}, {z:.4})"));
        }
        write!(
            f,
            "the cage would enclose the model if it were {}; check the units and axes of both files",
            changes.join(" and ")
        )
    }
}
