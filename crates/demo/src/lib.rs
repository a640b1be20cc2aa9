//! A procedural capture: a dancer in a pleated dress, with a cage that fits.
//!
//! Every horizontal slice of the body is star-shaped about a spine, and the cage is a grid over
//! height and angle about that same spine. That makes "inside" a comparison of two radii, and rules
//! out self-intersections of the cage for any radii.

use std::f64::consts::TAU;

use cager_geometry::mesh::{Model, Point, TriMesh};

mod figure;
mod shell;

use figure::{HEIGHT, sinc, spine};
use shell::{figure, fitted_cage};

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

    /// Replaces `out` with the positions of frame `t` as x y z x y z …; `t` wraps around.
    pub fn frame(&self, t: usize, out: &mut Vec<f64>) {
        let motion = Motion::at(t, self.frames);
        out.clear();
        out.reserve(3 * self.rest.points.len());
        for &point in &self.rest.points {
            out.extend_from_slice(&motion.posed(motion.rippled(point)));
        }
    }

    /// The cage moved as the figure moves in frame `t`, but for the ripples of the cloth.
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
        // Relative to the radius, so that the waves fade at the pole instead of tearing it.
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

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::shell::Grid;
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

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
