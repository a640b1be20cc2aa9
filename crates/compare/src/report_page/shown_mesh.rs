//! Model and cage as a page draws them; large models are thinned.

use super::Up;
use super::numbers::{Box3, Quantised, floats, indices};
use cager_geometry::mesh::{Point, TriMesh, bounds, diagonal};
use serde::Serialize;
use std::collections::{HashMap, HashSet};

/// Attempts at a size of cells that leaves few enough points.
const ATTEMPTS: usize = 24;

/// A model at rest, with all its points or, of a large one, some of them.
#[derive(Debug, Serialize)]
pub struct ShownMesh {
    /// Points that the model has.
    of: usize,
    /// Diagonal of its bounding box.
    diagonal: f64,
    up: Up,
    points: Quantised,
    triangles: String,
    /// Numbers of the points that are shown, ascending.
    #[serde(skip)]
    shown: Vec<u32>,
}

impl ShownMesh {
    /// Shows at most about `most` points: of a larger model one for each cell of a grid, that
    /// nearest to the cell's middle, and the triangles between different cells (vertex clustering,
    /// Rossignac and Borrel 1993).
    pub fn new(mesh: &TriMesh, up: Option<Up>, most: usize) -> Self {
        let (shown, triangles) = match mesh.vertices.len() {
            all if all <= most => ((0..all as u32).collect(), mesh.triangles.clone()),
            _ => clustered(mesh, most),
        };
        let points: Vec<Point> = shown.iter().map(|&i| mesh.vertices[i as usize]).collect();
        Self {
            of: mesh.vertices.len(),
            diagonal: diagonal(&mesh.vertices),
            up: up.unwrap_or_else(|| Up::guess(&mesh.vertices)),
            points: Quantised::new(&points, 16, Box3::around(&points, 0.0)),
            triangles: indices(triangles.into_iter().flatten(), shown.len()),
            shown,
        }
    }

    /// Of all points of the model, x y z each, those that are shown.
    pub fn pick<T: Copy + Into<f64>>(&self, coordinates: &[T]) -> Vec<Point> {
        let all = coordinates.as_chunks::<3>().0;
        self.shown.iter().map(|&i| all[i as usize].map(Into::into)).collect()
    }
}

/// A cage at rest, with all its vertices.
#[derive(Debug, Serialize)]
pub struct ShownCage {
    vertices: String,
    triangles: String,
}

impl ShownCage {
    /// All of a cage.
    pub fn new(cage: &TriMesh) -> Self {
        Self {
            vertices: floats(cage.vertices.iter().flatten().copied()),
            triangles: indices(cage.triangles.iter().flatten().copied(), cage.vertices.len()),
        }
    }
}

type Cell = [i32; 3];

/// Numbers of the points shown, ascending, and triangles between them, numbered anew.
fn clustered(mesh: &TriMesh, most: usize) -> (Vec<u32>, Vec<[u32; 3]>) {
    let (low, high) = bounds(&mesh.vertices);
    let longest = (0..3).map(|k| high[k] - low[k]).fold(f64::MIN_POSITIVE, f64::max);
    let cell = |p: &Point, edge: f64| -> Cell { [0, 1, 2].map(|k| ((p[k] - low[k]) / edge) as i32) };
    let occupied = |edge: f64| mesh.vertices.iter().map(|p| cell(p, edge)).collect::<HashSet<Cell>>().len();
    // Cells of a surface grow in number with the square of their size's inverse.
    let mut edge = longest / (most as f64 / 4.0).sqrt();
    for _ in 0..ATTEMPTS {
        let found = occupied(edge) as f64 / most as f64;
        if (0.85..=1.0).contains(&found) {
            break;
        }
        edge *= (found / 0.93).sqrt().clamp(0.25, 4.0);
    }
    while occupied(edge) > most {
        edge *= 1.1;
    }
    let away = |p: &Point| -> f64 { (0..3).map(|k| ((p[k] - low[k]) / edge).fract() - 0.5).map(|x| x * x).sum() };
    let mut nearest: HashMap<Cell, u32> = HashMap::new();
    for (i, p) in mesh.vertices.iter().enumerate() {
        let known = nearest.entry(cell(p, edge)).or_insert(i as u32);
        if away(p) < away(&mesh.vertices[*known as usize]) {
            *known = i as u32;
        }
    }
    let mut shown: Vec<u32> = nearest.values().copied().collect();
    shown.sort_unstable();
    let place: HashMap<u32, u32> = shown.iter().zip(0..).map(|(&i, place)| (i, place)).collect();
    let corner = |i: u32| place[&nearest[&cell(&mesh.vertices[i as usize], edge)]];
    let mut known = HashSet::new();
    let mut triangles = Vec::new();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(corner);
        let mut sorted = [a, b, c];
        sorted.sort_unstable();
        if a != b && b != c && c != a && known.insert(sorted) {
            triangles.push([a, b, c]);
        }
    }
    (shown, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_demo::{Capture, Options};

    #[test]
    fn a_large_model_keeps_its_shape_with_few_points() {
        let capture = Capture::new(&Options { points: 40_000, frames: 1, cage_vertices: 40 });
        let mesh = TriMesh::from(&capture.rest);
        let (shown, triangles) = clustered(&mesh, 2_000);
        assert!((1_500..=2_000).contains(&shown.len()), "{} points", shown.len());
        assert!(triangles.len() > 2 * shown.len() - shown.len() / 4, "{} triangles", triangles.len());
        assert!(triangles.iter().flatten().all(|&i| (i as usize) < shown.len()));
        let small: Vec<Point> = shown.iter().map(|&i| mesh.vertices[i as usize]).collect();
        assert!(diagonal(&small) > 0.97 * diagonal(&mesh.vertices));
        assert_eq!(clustered(&mesh, 2_000), (shown, triangles));
    }

    #[test]
    fn models_without_extent_or_faces_are_shown_too() {
        let point = TriMesh { vertices: vec![[1.0, 2.0, 3.0]; 500], triangles: Vec::new() };
        assert_eq!(clustered(&point, 100).0.len(), 1);
        let few = ShownMesh::new(&point, None, 1_000);
        assert_eq!((few.pick(&[0.5f32; 1_500]).len(), few.triangles.as_str()), (500, ""));
    }
}
