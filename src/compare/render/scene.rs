//! Surfaces, cages and handles before a camera.

use super::camera::Camera;
use super::canvas::{Canvas, Corner, SAMPLES};
use super::colour::Rgb;
use super::png::Png;
use cager_core::mesh::Point;

/// Direction of the light as the viewer sees it: right, up, towards the viewer.
const LIGHT: Point = [-0.38, 0.52, 0.765];
/// Brightness of what the light does not reach.
const SHADE: f64 = 0.52;
/// Width of lines and radius of a point cloud's points, in pixels.
const LINE: f64 = 0.9;
const POINT: f64 = 1.6;
/// Opacity of lines behind a surface.
const BEHIND: f32 = 0.13;

/// A mesh to be drawn; without triangles, a point cloud.
#[derive(Clone, Copy)]
pub(crate) struct Mesh<'a> {
    /// Points.
    pub(crate) points: &'a [Point],
    /// Triangles.
    pub(crate) triangles: &'a [[u32; 3]],
}

/// Colour of a surface.
#[derive(Clone, Copy)]
pub(crate) enum Shade<'a> {
    /// The same everywhere.
    Plain(Rgb),
    /// One per point.
    PerPoint(&'a [Rgb]),
}

/// A picture in the making.
pub(crate) struct Scene {
    canvas: Canvas,
    camera: Camera,
}

impl Scene {
    /// An empty one, in pixels.
    pub(crate) fn new(camera: Camera, width: usize, height: usize) -> Self {
        Self { canvas: Canvas::new(width, height), camera }
    }

    /// Adds a surface, its faces flat or smooth.
    pub(crate) fn surface(&mut self, mesh: Mesh<'_>, shade: Shade<'_>, smooth: bool) {
        let places = self.places(mesh.points);
        let colour = |i: usize| match shade {
            Shade::Plain(colour) => colour,
            Shade::PerPoint(colours) => colours[i],
        };
        if mesh.triangles.is_empty() {
            for (i, place) in places.iter().enumerate() {
                self.canvas.disc(*place, colour(i), POINT * SAMPLES as f64, 0.0);
            }
            return;
        }
        let normals: Vec<Point> = mesh.triangles.iter().map(|t| normal(t.map(|i| mesh.points[i as usize]))).collect();
        let mut of_points = vec![[0.0; 3]; mesh.points.len()];
        for (triangle, normal) in mesh.triangles.iter().zip(&normals) {
            for &i in triangle {
                for k in 0..3 {
                    of_points[i as usize][k] += normal[k];
                }
            }
        }
        for (triangle, flat) in mesh.triangles.iter().zip(&normals) {
            self.canvas.triangle(triangle.map(|i| {
                let i = i as usize;
                let bright = self.brightness(if smooth { of_points[i] } else { *flat });
                Corner { place: places[i], colour: colour(i).map(|c| c * bright) }
            }));
        }
    }

    /// Adds lines, faint where a surface hides them.
    pub(crate) fn lines(&mut self, points: &[Point], edges: &[[u32; 2]], colour: Rgb) {
        let places = self.places(points);
        // Lines of a surface lie on it, and rounding decides who is nearer.
        let slack = 2.0 * SAMPLES as f64;
        for edge in edges {
            let [a, b] = edge.map(|i| places[i as usize]);
            self.canvas.line(a, b, colour, LINE * SAMPLES as f64, slack, BEHIND);
        }
    }

    /// Adds a disc of this radius in pixels, before the surface it lies on; where `through`, before all others too.
    pub(crate) fn dot(&mut self, point: Point, colour: Rgb, radius: f64, through: bool) {
        let radius = radius * SAMPLES as f64;
        let place = self.camera.project(point, self.canvas.size());
        self.canvas.disc(place, colour, radius, if through { 1e6 } else { 2.0 * radius });
    }

    /// The picture.
    pub(crate) fn png(&self) -> Png {
        self.canvas.png()
    }

    /// Its pixels, rows from above, red, green, blue and opacity.
    pub(crate) fn pixels(&self) -> Vec<[u8; 4]> {
        self.canvas.pixels()
    }

    fn places(&self, points: &[Point]) -> Vec<Point> {
        points.iter().map(|p| self.camera.project(*p, self.canvas.size())).collect()
    }

    /// Of a surface with this normal, whichever of its sides is seen.
    fn brightness(&self, normal: Point) -> f32 {
        let seen = self.camera.seen(normal);
        let length = (seen[0] * seen[0] + seen[1] * seen[1] + seen[2] * seen[2]).sqrt();
        if length == 0.0 || !length.is_finite() {
            return SHADE as f32;
        }
        let facing = if seen[2] < 0.0 { -1.0 } else { 1.0 };
        let lit = facing * (0..3).map(|k| seen[k] * LIGHT[k]).sum::<f64>() / length;
        (SHADE + (1.0 - SHADE) * lit.max(0.0)) as f32
    }
}

/// Twice the area along the normal.
fn normal([a, b, c]: [Point; 3]) -> Point {
    let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

#[cfg(test)]
mod tests {
    use super::super::camera::Up;
    use super::*;

    #[test]
    fn a_box_looks_like_itself_from_its_own_points() {
        let corners: Vec<Point> = (0..8).map(|i| [0, 1, 2].map(|k| f64::from(i >> k & 1))).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        let camera = Camera::fitting(&corners, &corners, Up::Z, 1.0);
        let picture = |mesh: Mesh<'_>, smooth| {
            let mut scene = Scene::new(camera, 60, 60);
            scene.surface(mesh, Shade::Plain([0.8, 0.8, 0.8]), smooth);
            scene.png().data_url()
        };
        let whole = Mesh { points: &corners, triangles: &triangles };
        let turned: Vec<[u32; 3]> = triangles.iter().map(|t| [t[0], t[2], t[1]]).collect();
        // Faces are seen from both sides.
        assert_eq!(picture(whole, false), picture(Mesh { triangles: &turned, ..whole }, false));
        assert_ne!(picture(whole, false), picture(whole, true));
        assert_ne!(picture(whole, false), picture(Mesh { triangles: &[], ..whole }, false));
    }
}
