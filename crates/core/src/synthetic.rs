//! A procedural capture: a dancer in a pleated dress, with a cage that fits.
//!
//! Every horizontal slice of the body is star-shaped about a spine, and the cage is a grid over height and angle about that
//! same spine. That makes "inside" a comparison of two radii, and rules out self-intersections of the cage for any radii.

use std::f64::consts::TAU;

use cager_geometry::mesh::{Model, Point, Polygons, TriMesh};

mod shell;

use shell::{Grid, fitted_cage};

/// Height of the figure; all other lengths here are in the same unit.
const HEIGHT: f64 = 2.0;
/// Half-width of the figure by height, both as fractions: hem, waist, shoulders, neck, head.
const SILHOUETTE: [(f64, f64); 12] = [
    (0.00, 0.310),
    (0.08, 0.305),
    (0.18, 0.240),
    (0.32, 0.165),
    (0.46, 0.100),
    (0.53, 0.088),
    (0.63, 0.108),
    (0.72, 0.118),
    (0.79, 0.075),
    (0.84, 0.054),
    (0.92, 0.080),
    (1.00, 0.078),
];

/// Sizes of a synthetic capture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Points of the model, met within 3 % (at least 200 are made).
    pub points: usize,
    /// Frames, one loop of the motion (at least 1).
    pub frames: usize,
    /// Vertices of the cage, met within 10 % (at least 32 are made).
    pub cage_vertices: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { points: 20_000, frames: 120, cage_vertices: 330 }
    }
}

/// A synthetic capture: rest pose, cage, and frames that are computed when asked for.
#[derive(Clone, Debug)]
pub struct Capture {
    /// The figure at rest: quads, and triangles around the two poles.
    pub rest: Model,
    /// The cage at rest: closed, outward oriented, every point of the figure strictly inside.
    pub cage: TriMesh,
    frames: usize,
}

impl Capture {
    /// Builds the rest pose and its cage; the same options give the same capture.
    pub fn new(options: &Options) -> Self {
        let rest = figure(options.points.max(200));
        let cage = fitted_cage(&rest.points, options.cage_vertices.max(32));
        Self { rest, cage, frames: options.frames.max(1) }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Replaces `out` with the positions of frame `t` as x y z x y z …; `t` wraps around, since the motion loops.
    pub fn frame(&self, t: usize, out: &mut Vec<f64>) {
        let motion = Motion::at(t, self.frames);
        out.clear();
        out.reserve(3 * self.rest.points.len());
        for &point in &self.rest.points {
            out.extend_from_slice(&motion.posed(motion.rippled(point)));
        }
    }

    /// The cage moved as the figure moves in frame `t`, but for the ripples of the cloth, which are too fine for a cage.
    pub fn deformed_cage(&self, t: usize) -> Vec<Point> {
        let motion = Motion::at(t, self.frames);
        self.cage.vertices.iter().map(|&vertex| motion.posed(vertex)).collect()
    }
}

/// The motion at one moment of the loop.
struct Motion {
    /// Phase of the loop in radians.
    phase: f64,
    stretch: f64,
    /// Curvature of the spine and the horizontal direction it bends towards.
    curvature: f64,
    towards: [f64; 2],
}

impl Motion {
    fn at(t: usize, frames: usize) -> Self {
        let phase = TAU * (t % frames) as f64 / frames as f64;
        let heading = 0.6 + 0.9 * phase.cos();
        Self {
            phase,
            stretch: 1.0 + 0.09 * (2.0 * phase).sin(),
            curvature: 0.45 * phase.sin(),
            towards: [heading.cos(), heading.sin()],
        }
    }

    /// Waves that run around and up the dress, shorter than a cage edge.
    fn rippled(&self, [x, y, z]: Point) -> Point {
        let h = z / HEIGHT;
        let [cx, cy] = spine(z);
        let (dx, dy) = (x - cx, y - cy);
        let angle = dy.atan2(dx);
        let fade = (1.0 - h).max(0.0).powi(2);
        let wave = (13.0 * angle - 3.0 * self.phase + 9.0 * h).sin()
            + 0.6 * (19.0 * angle + 2.0 * self.phase - 31.0 * h).sin();
        // Relative to the radius, so that the waves fade to nothing at the pole instead of tearing it.
        let scale = 1.0 + 0.02 * fade * wave;
        [cx + scale * dx, cy + scale * dy, z]
    }

    /// The large motion: a smooth map of space, so a cage can follow it.
    fn posed(&self, [x, y, z]: Point) -> Point {
        let h = z / HEIGHT;
        // The dress follows the hips late and swings out.
        let hem = (1.0 - h) * (1.0 - h);
        let turn = 0.55 * (self.phase - 1.1 * (1.0 - h)).sin();
        let flare = (1.0 + 0.14 * hem * (2.0 * self.phase - 0.8).sin()) / self.stretch.sqrt();
        let (sin, cos) = turn.sin_cos();
        let (x, y) = (flare * (cos * x - sin * y), flare * (sin * x + cos * y));
        let z = self.stretch * z;
        // Sway: a wave that travels up the spine.
        let x = x + 0.07 * (self.phase - 4.0 * h).sin();
        let y = y + 0.05 * (2.0 * self.phase - 3.0 * h).cos();
        self.curved([x, y, z])
    }

    /// Bends the vertical axis into a circular arc, heights becoming arc lengths.
    fn curved(&self, [x, y, z]: Point) -> Point {
        let [dx, dy] = self.towards;
        let (along, across) = (dx * x + dy * y, dx * y - dy * x);
        let angle = self.curvature * z;
        let (sin, cos) = angle.sin_cos();
        // (1 - cos) / curvature and sin / curvature without dividing by a curvature of zero.
        let half = sinc(0.5 * angle);
        let along = along * cos + 0.5 * z * angle * half * half;
        let up = z * sinc(angle) - (dx * x + dy * y) * sin;
        [dx * along - dy * across, dy * along + dx * across, up]
    }
}

fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-9 { 1.0 } else { x.sin() / x }
}

/// Horizontal position of the spine, the centre of the slice at height `z`: she stands on one leg.
fn spine(z: f64) -> [f64; 2] {
    let h = z / HEIGHT;
    [0.07 * (4.6 * h).sin(), 0.05 * (3.4 * h + 0.5).sin()]
}

/// Mean radius of the slice at height `z`, zero at the poles.
fn mean_radius(z: f64) -> f64 {
    let h = (z / HEIGHT).clamp(0.0, 1.0);
    // Elliptic caps close the silhouette with a horizontal tangent plane.
    let cap = |depth: f64| (1.0 - (1.0 - depth).max(0.0).powi(2)).max(0.0).sqrt();
    HEIGHT * silhouette(h) * cap(h / 0.10) * cap((1.0 - h) / 0.08)
}

/// Outward normal of the silhouette at height `z`: its horizontal and its vertical part.
fn silhouette_normal(z: f64) -> [f64; 2] {
    let step = 1e-4 * HEIGHT;
    let rise = mean_radius(z + step) - mean_radius(z - step);
    let length = rise.hypot(2.0 * step);
    [2.0 * step / length, -rise / length]
}

/// Moves a point of the figure along the silhouette's normal.
fn pushed_out([x, y, z]: Point, distance: f64) -> Point {
    let [cx, cy] = spine(z);
    let (dx, dy) = (x - cx, y - cy);
    let [out, up] = silhouette_normal(z);
    let scale = distance * out / dx.hypot(dy).max(1e-12);
    [x + scale * dx, y + scale * dy, z + distance * up]
}

/// Cubic Hermite interpolation of [`SILHOUETTE`].
fn silhouette(h: f64) -> f64 {
    let last = SILHOUETTE.len() - 1;
    let slope = |k: usize| {
        let (a, b) = (SILHOUETTE[k.saturating_sub(1)], SILHOUETTE[(k + 1).min(last)]);
        (b.1 - a.1) / (b.0 - a.0)
    };
    let k = SILHOUETTE[1..last].iter().take_while(|knot| knot.0 <= h).count();
    let ((h0, r0), (h1, r1)) = (SILHOUETTE[k], SILHOUETTE[k + 1]);
    let (width, s) = (h1 - h0, (h - h0) / (h1 - h0));
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * r0
        + (3.0 * s2 - 2.0 * s3) * r1
        + width * ((s3 - 2.0 * s2 + s) * slope(k) + (s3 - s2) * slope(k + 1))
}

/// Radius of the figure at height `z` and angle `v` about the spine.
fn radius(z: f64, v: f64) -> f64 {
    let h = (z / HEIGHT).clamp(0.0, 1.0);
    let bump = |centre: f64, width: f64| (-((h - centre) / width).powi(2)).exp();
    let pleats =
        0.24 * (1.0 - h / 0.5).max(0.0).powf(1.3) * ((5.0 * v + 5.5 * h).cos() + 0.25 * (10.0 * v + 11.0 * h).cos());
    let shoulders = 0.34 * bump(0.70, 0.09) * (2.0 * v).cos();
    let train = 0.16 * bump(0.12, 0.25) * (v - 4.2).cos();
    mean_radius(z) * (1.0 + pleats + shoulders + train)
}

/// Position at height `z`, angle `v` and distance `r` from the spine.
fn place(centre: [f64; 2], r: f64, v: f64, z: f64) -> Point {
    [centre[0] + r * v.cos(), centre[1] + r * v.sin(), z]
}

fn figure(points: usize) -> Model {
    let grid = Grid::near(points, 1.15);
    let heights = heights(grid.rings);
    let mut positions = Vec::with_capacity(grid.len());
    positions.push(place(spine(0.0), 0.0, 0.0, 0.0));
    for &z in &heights {
        positions.extend((0..grid.columns).map(|j| place(spine(z), radius(z, grid.angle(j)), grid.angle(j), z)));
    }
    positions.push(place(spine(HEIGHT), 0.0, 0.0, HEIGHT));
    let mut faces = Polygons::new();
    for k in 0..=grid.rings {
        for j in 0..grid.columns {
            let [a, b, c, d] = grid.cell(k, j);
            match k {
                0 => faces.push(&[a, c, d]),
                _ if k == grid.rings => faces.push(&[a, b, c]),
                _ => faces.push(&[a, b, c, d]),
            }
        }
    }
    Model { points: positions, faces, ..Model::default() }
}

/// Heights of `rings` slices, evenly spaced along the silhouette, poles not included.
fn heights(rings: usize) -> Vec<f64> {
    const STEPS: usize = 4096;
    // Steps crowd towards the poles, where the radius changes fastest.
    let height = |i: usize| 0.5 * HEIGHT * (1.0 - (0.5 * TAU * i as f64 / STEPS as f64).cos());
    let mut lengths = vec![0.0; STEPS + 1];
    for i in 1..=STEPS {
        let step = (mean_radius(height(i)) - mean_radius(height(i - 1))).hypot(height(i) - height(i - 1));
        lengths[i] = lengths[i - 1] + step;
    }
    (1..=rings)
        .map(|k| {
            let target = lengths[STEPS] * k as f64 / (rings + 1) as f64;
            let i = lengths.partition_point(|&length| length < target).clamp(1, STEPS);
            let s = (target - lengths[i - 1]) / (lengths[i] - lengths[i - 1]);
            height(i - 1) + s * (height(i) - height(i - 1))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use cager_geometry::mesh::winding_number;
    use cager_geometry::vector::{cross, dot, sub};

    fn capture(points: usize, cage_vertices: usize) -> Capture {
        Capture::new(&Options { points, frames: 12, cage_vertices })
    }

    #[test]
    fn any_size_is_met_within_its_tolerance() {
        for points in [200, 333, 500, 997, 20_000, 1_000_000] {
            let made = figure(points).points.len();
            assert!(made.abs_diff(points) * 100 <= 3 * points, "{made} points for {points}");
        }
        for vertices in [32, 47, 60, 61, 89, 330, 348, 2_000] {
            let made = Grid::near(vertices, 0.7).len();
            assert!(made.abs_diff(vertices) * 10 <= vertices, "{made} vertices for {vertices}");
        }
    }

    #[test]
    fn every_point_lies_strictly_inside_the_cage() {
        for (points, vertices) in [(500, 60), (20_000, 330), (4_000, 2_000), (500, 2_000), (200, 32)] {
            let capture = capture(points, vertices);
            for &point in &capture.rest.points {
                let winding = winding_number(&capture.cage.vertices, &capture.cage.triangles, point);
                assert!((winding - 1.0).abs() < 1e-9, "{point:?} has winding number {winding}");
            }
        }
    }

    #[test]
    fn cage_is_a_closed_oriented_sphere() {
        for vertices in [32, 60, 330, 2_000] {
            let cage = capture(500, vertices).cage;
            let mut edges = HashMap::new();
            for &[a, b, c] in &cage.triangles {
                for edge in [(a, b), (b, c), (c, a)] {
                    assert!(edges.insert(edge, ()).is_none(), "edge {edge:?} is used twice in one direction");
                }
            }
            assert!(edges.keys().all(|&(a, b)| edges.contains_key(&(b, a))));
            assert_eq!(cage.vertices.len() + cage.triangles.len(), edges.len() / 2 + 2);
        }
    }

    #[test]
    fn cage_does_not_intersect_itself() {
        let cage = capture(2_000, 330).cage;
        let at = |i: u32| cage.vertices[i as usize];
        let side = |p: Point, q: Point, r: Point, s: Point| dot(sub(q, p), cross(sub(r, p), sub(s, p)));
        for triangle in &cage.triangles {
            let [a, b, c] = triangle.map(at);
            for other in &cage.triangles {
                for (i, j) in [(other[0], other[1]), (other[1], other[2]), (other[2], other[0])] {
                    if i < j && !triangle.contains(&i) && !triangle.contains(&j) {
                        let (p, q) = (at(i), at(j));
                        let crosses = side(p, a, b, c) * side(q, a, b, c) < 0.0;
                        let turns = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
                        let through = turns.iter().all(|&t| t > 0.0) || turns.iter().all(|&t| t < 0.0);
                        assert!(!(crosses && through), "edge {i} {j} passes through {triangle:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn model_keeps_its_quads_and_is_oriented_outward() {
        let rest = capture(500, 60).rest;
        assert!(rest.faces.arities().iter().filter(|&&arity| arity == 4).count() > 400);
        let triangles = rest.faces.triangulated();
        assert_eq!(triangles.len(), 2 * rest.points.len() - 4);
        let mesh = TriMesh { vertices: rest.points, triangles };
        let heart = [spine(1.2)[0], spine(1.2)[1], 1.2];
        assert!((winding_number(&mesh.vertices, &mesh.triangles, heart) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn motion_loops_smoothly() {
        let capture = Capture::new(&Options { points: 500, frames: 120, cage_vertices: 60 });
        let (mut now, mut next) = (Vec::new(), Vec::new());
        for t in 0..120 {
            capture.frame(t, &mut now);
            capture.frame(t + 1, &mut next);
            assert_eq!(now.len(), 3 * capture.rest.points.len());
            let step = now.iter().zip(&next).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(step > 0.0 && step < 0.05 * HEIGHT, "frame {t} jumps by {step}");
        }
        capture.frame(0, &mut now);
        assert_eq!(now, next);
    }

    #[test]
    fn deformed_cage_follows_the_figure() {
        let capture = capture(2_000, 330);
        let mut frame = Vec::new();
        for t in 0..capture.frames() {
            capture.frame(t, &mut frame);
            let cage = TriMesh { vertices: capture.deformed_cage(t), triangles: capture.cage.triangles.clone() };
            // Ripples may cut through the cage in places; the body as a whole may not leave it.
            let inside = frame
                .chunks_exact(3)
                .filter(|p| winding_number(&cage.vertices, &cage.triangles, [p[0], p[1], p[2]]) > 0.5)
                .count();
            assert!(inside * 100 >= 98 * capture.rest.points.len(), "{inside} points inside in frame {t}");
        }
    }
}
