//! Detail that a coarse cage loses: differential coordinates turned by local rotations (the second
//! paper, Eq. 5).

use std::collections::BTreeMap;

use crate::points::welded;
use cager_geometry::linalg::{SparseCholesky, SparsePattern, nearest_rotation};
use cager_geometry::mesh::{Point, TriMesh};
use faer::Mat;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::deformation::gradients::flatness;
use crate::deformation::graph::edge_growth;
use crate::deformation::rows::Rows;
use crate::error::MeshError;
use crate::points::{outer, row_points, vectors};

/// Brings the detail of a rest pose to poses of it: `min ‖L x − R δ‖² + ω² ‖x − x₁‖²`, `δ = L x₀`.
pub struct Detail {
    rows: Rows,
    /// Of the rows.
    rest: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Neighbours and their share, by row.
    neighbours: Vec<Vec<(u32, f64)>>,
    differences: Vec<DVec3>,
    factor: SparseCholesky,
}

/// How closely a pose is kept, ω.
const HOLD: f64 = 0.03;
const ITERATIONS: usize = 3;
/// Cotangents are kept within these.
const COTANGENTS: [f64; 2] = [0.02, 10.0];

impl Detail {
    /// Of a rest pose. Vertices at the same place stay together.
    ///
    /// # Errors
    /// A mesh that cannot be solved on.
    pub fn new(rest: &TriMesh) -> Result<Self, MeshError> {
        if let Some(vertex) = rest.vertices.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(MeshError::NotFinite(vertex));
        }
        let rows = Rows::new(&welded(&rest.vertices));
        let vertices = rows.gathered(&vectors(&rest.vertices));
        let triangles: Vec<[u32; 3]> = rest.triangles.iter().map(|&t| rows.of(t)).collect();
        if triangles.iter().all(|t| flatness(t.map(|v| vertices[v as usize])).is_none()) {
            return Err(MeshError::NoArea);
        }
        let neighbours = shares(&vertices, &triangles);
        let (mut places, mut values) = (Vec::new(), Vec::new());
        for (i, list) in neighbours.iter().enumerate() {
            places.push((i as u32, i as u32));
            values.push(HOLD * HOLD);
            let row: Vec<(u32, f64)> = if list.is_empty() {
                Vec::new()
            } else {
                std::iter::once((i as u32, 1.0)).chain(list.iter().map(|&(j, w)| (j, -w))).collect()
            };
            for (a, &(j, x)) in row.iter().enumerate() {
                for &(k, y) in &row[..=a] {
                    places.push((j, k));
                    values.push(x * y);
                }
            }
        }
        let factor = SparsePattern::new(vertices.len(), &places).and_then(|pattern| pattern.factor(&values));
        let factor = factor.ok_or(MeshError::Degenerate)?;
        let differences = laplacian(&neighbours, &vertices);
        Ok(Self { rows, rest: vertices, triangles, neighbours, differences, factor })
    }

    /// The pose with the detail of the rest pose.
    ///
    /// # Panics
    /// Where it has another number of points.
    pub fn add(&self, pose: &[Point]) -> Vec<Point> {
        assert_eq!(pose.len(), self.rows.vertices(), "as many points as at rest");
        let given = vectors(pose);
        let rough = self.rows.gathered(&given);
        let now = laplacian(&self.neighbours, &rough);
        let growth = edge_growth(&self.rest, &rough, &self.triangles);
        let mut shape = rough.clone();
        for _ in 0..ITERATIONS {
            let missing: Vec<DVec3> = (0..rough.len())
                .into_par_iter()
                .with_min_len(256)
                .map(|i| growth * (self.rotation(&shape, i) * self.differences[i]) - now[i])
                .collect();
            let mut change = Mat::<f64>::zeros(rough.len(), 3);
            for (i, list) in self.neighbours.iter().enumerate() {
                let mut add = |j: usize, x: DVec3| (0..3).for_each(|k| change[(j, k)] += x[k]);
                if !list.is_empty() {
                    add(i, missing[i]);
                }
                list.iter().for_each(|&(j, w)| add(j as usize, -w * missing[i]));
            }
            self.factor.solve(&mut change);
            shape = rough.iter().zip(row_points::<DVec3>(change.as_ref())).map(|(p, by)| *p + by).collect();
        }
        let moved: Vec<DVec3> = shape.iter().zip(&rough).map(|(to, from)| *to - *from).collect();
        given.iter().zip(self.rows.spread(&moved)).map(|(p, by)| (*p + by).to_array()).collect()
    }

    /// The rotation of a vertex's surroundings.
    fn rotation(&self, pose: &[DVec3], i: usize) -> DMat3 {
        let sum = self.neighbours[i].iter().fold(DMat3::ZERO, |sum, &(j, w)| {
            let (d, e) = (w * (pose[j as usize] - pose[i]), self.rest[j as usize] - self.rest[i]);
            sum + outer(d, e)
        });
        nearest_rotation(sum)
    }
}

/// `L x`: each vertex less the weighted mean of its neighbours; zero without any.
fn laplacian(neighbours: &[Vec<(u32, f64)>], x: &[DVec3]) -> Vec<DVec3> {
    let of = |(i, list): (usize, &Vec<(u32, f64)>)| list.iter().map(|&(j, w)| w * (x[i] - x[j as usize])).sum();
    neighbours.iter().enumerate().map(of).collect()
}

/// Neighbours along edges and their shares by cotangents (Pinkall and Polthier 1993).
fn shares(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Vec<(u32, f64)>> {
    let mut weights: Vec<BTreeMap<u32, f64>> = vec![BTreeMap::new(); vertices.len()];
    for triangle in triangles {
        for i in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|k| triangle[(i + k) % 3]);
            let (u, v) = (vertices[a as usize] - vertices[c as usize], vertices[b as usize] - vertices[c as usize]);
            let cotangent = u.dot(v) / u.cross(v).length().max(f64::MIN_POSITIVE);
            let weight = cotangent.clamp(COTANGENTS[0], COTANGENTS[1]);
            if a != b {
                *weights[a as usize].entry(b).or_default() += weight;
                *weights[b as usize].entry(a).or_default() += weight;
            }
        }
    }
    let share = |list: BTreeMap<u32, f64>| {
        let total: f64 = list.values().sum();
        list.into_iter().map(|(j, w)| (j, w / total)).collect()
    };
    weights.into_iter().map(share).collect()
}
