//! Meshes as plain data.

mod ears;

use crate::surface::Surface;
pub use crate::vector::Point;
use crate::vector::{cross, dot, norm, sub};
use glam::DVec3;
use std::collections::HashMap;

/// Polygonal faces of any arity over some list of points.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Polygons {
    /// Number of corners of each face.
    arities: Vec<u32>,
    /// Corners of all faces, back to back.
    indices: Vec<u32>,
}

impl Polygons {
    /// No faces.
    pub fn new() -> Self {
        Self::default()
    }

    /// Faces of three corners each.
    pub fn of_triangles(triangles: &[[u32; 3]]) -> Self {
        Self { arities: vec![3; triangles.len()], indices: triangles.as_flattened().to_vec() }
    }

    /// Appends one face.
    pub fn push(&mut self, face: &[u32]) {
        self.arities.push(face.len() as u32);
        self.indices.extend_from_slice(face);
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.arities.len()
    }

    /// Whether there are no faces: a point cloud.
    pub fn is_empty(&self) -> bool {
        self.arities.is_empty()
    }

    /// Number of corners of each face.
    pub fn arities(&self) -> &[u32] {
        &self.arities
    }

    /// Corners of all faces, back to back.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// The faces, each as a slice of point indices.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let mut rest = self.indices.as_slice();
        self.arities.iter().map(move |&arity| {
            let (face, tail) = rest.split_at(arity as usize);
            rest = tail;
            face
        })
    }

    /// The same faces of points with other names.
    ///
    /// # Panics
    /// Where a point has none.
    pub fn renamed(&self, names: &[u32]) -> Self {
        Self {
            arities: self.arities.clone(),
            indices: self.indices.iter().map(|&point| names[point as usize]).collect(),
        }
    }

    /// For every triangle of [`Self::triangulated`], the face it came from.
    pub fn polygon_of_triangle(&self) -> Vec<u32> {
        let faces = self.arities.iter().enumerate();
        faces.flat_map(|(face, &arity)| std::iter::repeat_n(face as u32, (arity as usize).saturating_sub(2))).collect()
    }

    /// The faces as a fan of triangles each; see [`Model::triangles`].
    pub fn triangulated(&self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        for face in self.iter() {
            for k in 2..face.len() {
                triangles.push([face[0], face[k - 1], face[k]]);
            }
        }
        triangles
    }
}

/// A model: points, with faces where there are any. A point cloud is a model without faces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Positions of the points.
    pub points: Vec<Point>,
    /// Polygonal faces, kept as they were read.
    pub faces: Polygons,
    /// Colours of the points, red, green and blue in sRGB; empty where there are none.
    pub colors: Vec<[u8; 3]>,
    /// Normals of the points of a cloud, as they were read; otherwise empty.
    pub normals: Vec<Point>,
    /// What lies on the faces; empty where the file says nothing but points and faces.
    pub surface: Surface,
}

/// A triangle mesh: the form a cage has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Positions of the vertices.
    pub vertices: Vec<Point>,
    /// Counter-clockwise triangles.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// The same surface with the orientation of every face reversed.
    #[must_use]
    pub fn flipped(mut self) -> Self {
        for triangle in &mut self.triangles {
            triangle.swap(1, 2);
        }
        self
    }
}

impl From<&Model> for TriMesh {
    /// Polygons become [`Model::triangles`].
    fn from(model: &Model) -> Self {
        Self { vertices: model.points.clone(), triangles: model.triangles() }
    }
}

impl Model {
    /// The faces as triangles, in the order of [`Polygons::polygon_of_triangle`]: fans of convex
    /// faces, and concave ones as they lie.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        self.faces.iter().for_each(|face| ears::triangulate(face, &self.points, &mut triangles));
        triangles
    }
}

impl From<TriMesh> for Model {
    fn from(mesh: TriMesh) -> Self {
        Self { points: mesh.vertices, faces: Polygons::of_triangles(&mesh.triangles), ..Self::default() }
    }
}

/// Lower and upper corner of the bounding box; both zero for no points.
pub fn bounds(points: &[Point]) -> (Point, Point) {
    let Some(&first) = points.first() else { return ([0.0; 3], [0.0; 3]) };
    points.iter().fold((first, first), |(mut low, mut high), p| {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
        (low, high)
    })
}

/// Length of the bounding box's diagonal: the unit of every error in a report.
pub fn diagonal(points: &[Point]) -> f64 {
    let (low, high) = bounds(points);
    norm(sub(high, low))
}

/// Of each vertex the sum of the triangles' normals around it, each as long as twice the area.
pub fn vertex_normals<P: Into<DVec3>>(vertices: usize, at: impl Fn(u32) -> P, triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; vertices];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| at(v).into());
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|&v| normals[v as usize] += normal);
    }
    normals
}

/// The first vertex at each one's place: scans double vertices along the seams of their textures.
pub fn welded(vertices: &[Point]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(vertices.len());
    // 0 and −0 are one place.
    let key = |p: &Point| p.map(|x| (x + 0.0).to_bits());
    vertices.iter().enumerate().map(|(k, p)| *first.entry(key(p)).or_insert(k as u32)).collect()
}

/// Winding number of a closed triangle mesh around `x`: 1 inside, 0 outside.
pub fn winding_number(vertices: &[Point], triangles: &[[u32; 3]], x: Point) -> f64 {
    let mut angle = 0.0;
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| sub(vertices[v as usize], x));
        let (la, lb, lc) = (norm(a), norm(b), norm(c));
        let volume = dot(a, cross(b, c));
        angle += 2.0 * volume.atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
    }
    angle / (4.0 * std::f64::consts::PI)
}

/// Distance from `x` to the nearest point of a triangle mesh.
pub fn distance_to_surface(vertices: &[Point], triangles: &[[u32; 3]], x: Point) -> f64 {
    triangles
        .iter()
        .map(|t| distance2_to_triangle(t.map(|v| vertices[v as usize]), x))
        .fold(f64::INFINITY, f64::min)
        .sqrt()
}

/// Squared distance from `x` to a triangle.
pub fn distance2_to_triangle([a, b, c]: [Point; 3], x: Point) -> f64 {
    let (u, v, w) = (sub(b, a), sub(c, a), sub(x, a));
    let n = cross(u, v);
    let n2 = dot(n, n);
    let (beta, gamma) = (dot(cross(w, v), n), dot(cross(u, w), n));
    if n2 > 0.0 && beta >= 0.0 && gamma >= 0.0 && beta + gamma <= n2 {
        return dot(w, n).powi(2) / n2;
    }
    [(a, b), (b, c), (c, a)].into_iter().map(|(p, q)| distance2_to_segment(p, q, x)).fold(f64::INFINITY, f64::min)
}

fn distance2_to_segment(p: Point, q: Point, x: Point) -> f64 {
    let (e, w) = (sub(q, p), sub(x, p));
    let t = (dot(w, e) / dot(e, e).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let r = [w[0] - t * e[0], w[1] - t * e[1], w[2] - t * e[2]];
    dot(r, r)
}
