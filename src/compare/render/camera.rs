//! Where pictures are taken from: the same for all pictures of a row, so that they can be compared.

use cager_core::mesh::Point;

/// Degrees of the view around the vertical axis and above the ground.
const TURN: f64 = 32.0;
const RISE: f64 = 14.0;
/// Space around what is fitted, as a fraction of it.
const MARGIN: f64 = 0.06;
/// An axis so much longer than the two others is the vertical one, whatever the file says.
const STANDING: f64 = 1.8;

/// The axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Up {
    /// The first coordinate.
    X,
    /// The second, as in most modelling programs.
    Y,
    /// The third.
    Z,
}

impl Up {
    /// A guess: y, unless the model stands along z.
    pub(crate) fn guess(points: &[Point]) -> Self {
        let (low, high) = cager_core::mesh::bounds(points);
        let extent = [0, 1, 2].map(|k| high[k] - low[k]);
        if extent[2] > STANDING * extent[0].max(extent[1]) { Self::Z } else { Self::Y }
    }

    /// The ground's two axes and the vertical one, right-handed.
    fn axes(self) -> [usize; 3] {
        match self {
            Self::X => [1, 2, 0],
            Self::Y => [2, 0, 1],
            Self::Z => [0, 1, 2],
        }
    }
}

/// An orthographic view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    /// Right, up and towards the viewer: orthonormal.
    axes: [Point; 3],
    centre: Point,
    /// Half of the picture's height in the scene's unit.
    half: f64,
}

impl Camera {
    /// Looks across the model's longer side, turned a little, at all of `points`, in a picture of this width over height.
    pub(crate) fn fitting(points: &[Point], rest: &[Point], up: Up, aspect: f64) -> Self {
        let [a, b, c] = up.axes();
        let (low, high) = cager_core::mesh::bounds(rest);
        // From the side that shows most of it.
        let from_a = high[b] - low[b] >= high[a] - low[a];
        let (sin, cos) = (if from_a { TURN } else { 90.0 - TURN }).to_radians().sin_cos();
        let (rise, level) = RISE.to_radians().sin_cos();
        let place = |p: f64, q: f64, r: f64| {
            let mut axis = [0.0; 3];
            (axis[a], axis[b], axis[c]) = (p, q, r);
            axis
        };
        let axes =
            [place(-sin, cos, 0.0), place(-cos * rise, -sin * rise, level), place(cos * level, sin * level, rise)];
        let (mut near, mut far) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in points {
            for k in 0..3 {
                let x = dot(axes[k], *point);
                (near[k], far[k]) = (near[k].min(x), far[k].max(x));
            }
        }
        let middle = [0, 1, 2].map(|k| 0.5 * (near[k] + far[k]));
        let centre = [0, 1, 2].map(|k| (0..3).map(|i| middle[i] * axes[i][k]).sum());
        let half = (0.5 * (far[1] - near[1])).max(0.5 * (far[0] - near[0]) / aspect) * (1.0 + 2.0 * MARGIN);
        Self { axes, centre, half: if half > 0.0 { half } else { 1.0 } }
    }

    /// Pixels from the left, pixels from above, and depth (larger is nearer) in pixels, in a picture of this size.
    pub(crate) fn project(&self, point: Point, [width, height]: [usize; 2]) -> Point {
        let from = [0, 1, 2].map(|k| point[k] - self.centre[k]);
        let scale = 0.5 * height as f64 / self.half;
        [
            0.5 * width as f64 + scale * dot(self.axes[0], from),
            0.5 * height as f64 - scale * dot(self.axes[1], from),
            scale * dot(self.axes[2], from),
        ]
    }

    /// A direction as the viewer sees it: right, up, towards the viewer.
    pub(crate) fn seen(&self, direction: Point) -> Point {
        self.axes.map(|axis| dot(axis, direction))
    }
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_fits_the_picture_whatever_points_up() {
        let points: Vec<Point> =
            (0..200).map(f64::from).map(|t: f64| [3.0 * t.sin(), 2.0 * (1.7 * t).cos(), 0.03 * t]).collect();
        for up in [Up::X, Up::Y, Up::Z] {
            for aspect in [0.5, 1.0, 2.0] {
                let camera = Camera::fitting(&points, &points, up, aspect);
                let size = [(400.0 * aspect) as usize, 400];
                for &p in &points {
                    let [x, y, _] = camera.project(p, size);
                    assert!((0.0..=size[0] as f64).contains(&x) && (0.0..=400.0).contains(&y), "{x} {y}");
                }
            }
        }
    }

    #[test]
    fn up_is_up_and_axes_are_orthonormal() {
        let points = [[0.0, 0.0, 0.0], [1.0, 2.0, 1.5]];
        for (up, k) in [(Up::X, 0), (Up::Y, 1), (Up::Z, 2)] {
            let camera = Camera::fitting(&points, &points, up, 1.0);
            let mut raised = points[0];
            raised[k] += 1.0;
            let (before, after) = (camera.project(points[0], [100, 100]), camera.project(raised, [100, 100]));
            assert!(after[1] < before[1] && (after[0] - before[0]).abs() < 1e-9);
            for i in 0..3 {
                for j in 0..3 {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((dot(camera.axes[i], camera.axes[j]) - expected).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn a_tall_model_stands_along_z() {
        assert_eq!(Up::guess(&[[0.0; 3], [0.5, 0.5, 2.0]]), Up::Z);
        assert_eq!(Up::guess(&[[0.0; 3], [0.3, 1.0, 1.3]]), Up::Y);
    }
}
