//! Meshes from the gradients of their triangles: one sparse factorisation, then a solve a pose.

use crate::points::welded;
use cager_geometry::linalg::{SparseCholesky, SparsePattern};
use cager_geometry::mesh::TriMesh;
use cager_geometry::topology::UnionFind;
use faer::Mat;
use glam::{DMat3, DVec3};

use crate::deformation::gradients::flatness;
use crate::deformation::rows::Rows;
use crate::deformation::ties::{Tie, ties};
use crate::error::MeshError;
use crate::points::{area_vector, mean, row_points, vectors};

/// Finds vertices whose triangles are turned and stretched as asked, in least squares by area (the
/// Poisson equation of deformation transfer, Botsch et al. 2006). Vertices at one place stay
/// together; parts that no edge connects are carried by the nearest points of others.
pub struct Poisson {
    rest: Vec<DVec3>,
    rows: Rows,
    triangles: Vec<Element>,
    ties: Vec<Tie>,
    /// Of each tie, at rest.
    offsets: Vec<DVec3>,
    tie_weight: f64,
    factor: SparseCholesky,
}

/// A triangle with an area.
struct Element {
    triangle: u32,
    rows: [u32; 3],
    /// Gradients of the hat functions, times the area.
    divergence: [DVec3; 3],
}

/// The height of a triangle over its longest edge: flatter ones count less.
const THIN: f64 = 1e-6;
/// Weight of a tie, over the mean of the diagonal.
const TIE_WEIGHT: f64 = 0.1;

impl Poisson {
    /// Of a mesh at rest.
    ///
    /// # Errors
    /// A mesh without any triangle that has an area, or with a coordinate that is not finite.
    pub fn new(rest: &TriMesh) -> Result<Self, MeshError> {
        Self::joined(rest, Rows::new(&welded(&rest.vertices)))
    }

    /// As [`Self::new`], with vertices that stay together.
    pub(crate) fn joined(rest: &TriMesh, rows: Rows) -> Result<Self, MeshError> {
        if let Some(vertex) = rest.vertices.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(MeshError::NotFinite(vertex));
        }
        let vertices = vectors(&rest.vertices);
        let mut triangles = Vec::with_capacity(rest.triangles.len());
        let (mut places, mut values) = (Vec::new(), Vec::new());
        let mut parts = UnionFind::new(rows.count());
        let mut triangle_at = vec![None; rows.count()];
        for (t, triangle) in rest.triangles.iter().enumerate() {
            let corners = triangle.map(|v| vertices[v as usize]);
            let Some(flatness) = flatness(corners) else { continue };
            let sides: [DVec3; 3] = std::array::from_fn(|i| corners[(i + 2) % 3] - corners[(i + 1) % 3]);
            let normal = area_vector(corners);
            let area = normal.length();
            let weight = 0.5 * area * (flatness / THIN).min(1.0);
            let hats = sides.map(|side| normal.cross(side) / (area * area));
            let rows = rows.of(*triangle);
            for i in 0..3 {
                for j in 0..=i {
                    places.push((rows[i], rows[j]));
                    values.push(weight * hats[i].dot(hats[j]));
                }
                parts.join(rows[i], rows[(i + 1) % 3]);
                triangle_at[rows[i] as usize].get_or_insert(t as u32);
            }
            triangles.push(Element { triangle: t as u32, rows, divergence: hats.map(|hat| weight * hat) });
        }
        if triangles.is_empty() {
            return Err(MeshError::NoArea);
        }
        let diagonal: f64 = places.iter().zip(&values).filter(|((i, j), _)| i == j).map(|(_, value)| value).sum();
        let mean = diagonal / rows.count() as f64;
        let tie_weight = TIE_WEIGHT * mean;
        let at = rows.gathered(&vertices);
        let ties = ties(&at, &parts.numbered().0, &triangle_at);
        for &Tie { rows: [a, b], .. } in &ties {
            places.extend([(a, a), (b, b), (a, b)]);
            values.extend([tie_weight, tie_weight, -tie_weight]);
        }
        // What the gradients leave open: a translation.
        places.push((triangles[0].rows[0], triangles[0].rows[0]));
        values.push(mean);
        let factor = SparsePattern::new(rows.count(), &places).and_then(|pattern| pattern.factor(&values));
        let factor = factor.ok_or(MeshError::Degenerate)?;
        let offsets = offsets(&ties, &at);
        Ok(Self { rest: vertices, rows, triangles, ties, offsets, tie_weight, factor })
    }

    /// The pose whose gradients are nearest to these, one a triangle; the mean is as at rest.
    pub fn solve(&self, gradients: &[DMat3]) -> Vec<DVec3> {
        let turned = |(tie, rest): (&Tie, &DVec3)| gradients[tie.triangle as usize] * *rest;
        let offsets: Vec<DVec3> = self.ties.iter().zip(&self.offsets).map(turned).collect();
        self.solve_tied(gradients, &offsets)
    }

    /// As [`Self::solve`], with the offset that is wanted of each tie.
    pub(crate) fn solve_tied(&self, gradients: &[DMat3], offsets: &[DVec3]) -> Vec<DVec3> {
        // Solved for displacements, so that gradients of one give the pose at rest exactly.
        let mut pull = Mat::<f64>::zeros(self.factor.rows(), 3);
        let mut add = |row: u32, force: DVec3| (0..3).for_each(|k| pull[(row as usize, k)] += force[k]);
        for element in &self.triangles {
            let change = gradients[element.triangle as usize] - DMat3::IDENTITY;
            (0..3).for_each(|i| add(element.rows[i], change * element.divergence[i]));
        }
        for ((tie, wanted), rest) in self.ties.iter().zip(offsets).zip(&self.offsets) {
            let force = self.tie_weight * (*wanted - *rest);
            add(tie.rows[0], force);
            add(tie.rows[1], -force);
        }
        self.factor.solve(&mut pull);
        let moved = self.rows.spread(&row_points(pull.as_ref()));
        let mean = mean(&moved);
        moved.iter().zip(&self.rest).map(|(d, p)| *p + (*d - mean)).collect()
    }

    /// The vertices at rest.
    pub fn rest(&self) -> &[DVec3] {
        &self.rest
    }

    /// Which vertices stay together.
    pub(crate) fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Ties between parts.
    pub(crate) fn ties(&self) -> &[Tie] {
        &self.ties
    }
}

/// From the row that carries to the one that is carried.
pub(crate) fn offsets(ties: &[Tie], at: &[DVec3]) -> Vec<DVec3> {
    ties.iter().map(|&Tie { rows: [a, b], .. }| at[a as usize] - at[b as usize]).collect()
}
