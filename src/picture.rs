//! A picture of a cage: the model in it, and beside that the cage itself as a solid.

use crate::compare::render::{Camera, Mesh, Png, Scene, Shade, Up};
use cager_core::mesh::{Point, TriMesh, bounds};

/// Height of the picture and most that it is wide, in pixels.
const HEIGHT: f64 = 900.0;
const WIDEST: f64 = 1.6;
const MODEL: [f32; 3] = [0.80, 0.81, 0.83];
const CAGE: [f32; 3] = [0.16, 0.42, 0.70];
const SOLID: [f32; 3] = [0.62, 0.72, 0.84];
const EDGES: [f32; 3] = [0.20, 0.26, 0.34];

/// Draws a model and its cage as a PNG file's bytes.
pub(crate) fn of_cage(model: &TriMesh, cage: &TriMesh, up: Option<Up>) -> Vec<u8> {
    let up = up.unwrap_or_else(|| Up::guess(&model.vertices));
    let both: Vec<Point> = model.vertices.iter().chain(&cage.vertices).copied().collect();
    let square = Camera::fitting(&both, &model.vertices, up, 1.0);
    let seen: Vec<Point> = both.iter().map(|p| square.project(*p, [1000, 1000])).collect();
    let (low, high) = bounds(&seen);
    let aspect = (high[0] - low[0]) / (high[1] - low[1]);
    let aspect = if aspect.is_finite() { aspect.clamp(0.5, WIDEST) } else { 1.0 };
    let (width, height) = ((HEIGHT * aspect) as usize, HEIGHT as usize);
    let camera = Camera::fitting(&both, &model.vertices, up, width as f64 / height as f64);
    let edges = edges(&cage.triangles);

    let mut inside = Scene::new(camera, width, height);
    inside.surface(Mesh { points: &model.vertices, triangles: &model.triangles }, Shade::Plain(MODEL), true);
    inside.lines(&cage.vertices, &edges, CAGE);
    let mut solid = Scene::new(camera, width, height);
    solid.surface(Mesh { points: &cage.vertices, triangles: &cage.triangles }, Shade::Plain(SOLID), false);
    solid.lines(&cage.vertices, &edges, EDGES);
    side_by_side([&inside.pixels(), &solid.pixels()], width, height).into_bytes()
}

fn edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let of = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| [a.min(b), a.max(b)]);
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(of).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Two pictures of one size in one, on white.
fn side_by_side(pictures: [&[[u8; 4]]; 2], width: usize, height: usize) -> Png {
    let mut pixels = Vec::with_capacity(2 * width * height);
    for y in 0..height {
        for picture in pictures {
            pixels.extend(picture[y * width..(y + 1) * width].iter().map(|&p| on_white(p)));
        }
    }
    Png::new(2 * width, height, &pixels)
}

fn on_white([r, g, b, opacity]: [u8; 4]) -> [u8; 4] {
    let blend = |c: u8| ((u32::from(c) * u32::from(opacity) + 255 * (255 - u32::from(opacity))) / 255) as u8;
    [blend(r), blend(g), blend(b), 255]
}
