//! A template in the cage of its rig: coordinates of vertices and samples, derivatives by the cage.

use crate::people::rig::{CAGE_VERTICES, QUADS, Rig, extent, owner};
use crate::points::{cage_values, plain, points_in};
use crate::registration::{Observation, SurfacePoint, sample_surface};
use cager_core::cage::{Cage, CageError};
use cager_core::coordinates::{CoordinateSystem, CoordinatesError, DependentNormals, Derivative};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3};

/// Unknowns of a cage: three for each vertex.
pub(super) const CAGE_UNKNOWNS: usize = 3 * CAGE_VERTICES;

/// A template and its rig, prepared for fitting.
pub struct PersonModel {
    rig: Rig,
    cage: Cage,
    normals: Option<DependentNormals>,
    /// Coordinates of the vertices.
    phi: Mat<f64>,
    /// Those of the samples, then of two edges at each that span its tangent plane, in columns.
    samples: Mat<f64>,
    /// Of each sample, the quad that it follows most.
    parts: Vec<usize>,
    height: f64,
    diagonal: f64,
}

/// Why a template cannot be fitted by a rig.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The rig's cage is no cage.
    #[error("the rig's cage is not valid: {0}")]
    Cage(#[from] CageError),
    /// The template has points for which the coordinates are not defined.
    #[error("the template has no coordinates in the rig's cage: {0}")]
    Coordinates(#[from] CoordinatesError),
    /// Points outside the cage.
    #[error(
        "{outside} of {points} points of the template lie outside the rig's cage; place the rig anew with `cager rig`"
    )]
    Outside {
        /// Points outside.
        outside: usize,
        /// All points.
        points: usize,
    },
    /// Nothing to draw samples from.
    #[error("the template has no faces with an area")]
    NoSurface,
}

/// Share of the points that may lie outside the cage, since a few at the fingers do no harm.
const OUTSIDE: f64 = 0.01;

impl PersonModel {
    /// Computes the coordinates of a template, and of so many samples drawn from its surface.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn new(
        template: &TriMesh,
        rig: &Rig,
        system: &dyn CoordinateSystem,
        samples: usize,
    ) -> Result<Self, ModelError> {
        let cage = Cage::new(rig.cage())?;
        let coordinates = system.coordinates(&cage, &template.vertices, None)?;
        let points = template.vertices.len();
        if coordinates.outside.len() as f64 > OUTSIDE * points as f64 {
            return Err(ModelError::Outside { outside: coordinates.outside.len(), points });
        }
        let drawn = sample_surface(&template.vertices, &template.triangles, samples, 0);
        if drawn.is_empty() {
            return Err(ModelError::NoSurface);
        }
        let columns = coordinates.phi.ncols();
        let (count, phi) = (drawn.len(), &coordinates.phi);
        let mut at_samples = zeros(columns, 3 * count);
        for (s, SurfacePoint { face, weights }) in drawn.into_iter().enumerate() {
            let [a, b, c] = template.triangles[face as usize].map(|v| v as usize);
            for j in 0..columns {
                let (pa, pb, pc) = (phi[(a, j)], phi[(b, j)], phi[(c, j)]);
                at_samples[(j, s)] = weights[0] * pa + weights[1] * pb + weights[2] * pc;
                at_samples[(j, count + s)] = pb - pa;
                at_samples[(j, 2 * count + s)] = pc - pa;
            }
        }
        let parts = (0..count).map(|s| part(&at_samples.col_as_slice(s)[..CAGE_VERTICES])).collect();
        Ok(Self {
            parts,
            normals: system.values(&cage).dependent_normals,
            cage,
            rig: rig.clone(),
            phi: coordinates.phi,
            samples: at_samples,
            height: extent(&template.vertices, rig.up),
            diagonal: diagonal(&template.vertices),
        })
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The cage at rest.
    pub fn cage(&self) -> &Cage {
        &self.cage
    }

    /// Extent of the template along the rig's up axis.
    pub fn height(&self) -> f64 {
        self.height
    }

    /// Diagonal of the template's bounding box.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// The template under a cage with these vertices.
    pub fn deformed(&self, vertices: &[Point]) -> Vec<Point> {
        points_in(self.phi.as_ref(), cage_values(self.normals.as_ref(), vertices).as_ref())
    }

    /// Number of samples.
    pub(super) fn sample_count(&self) -> usize {
        self.samples.ncols() / 3
    }

    /// The quad that a sample follows most.
    pub(super) fn part(&self, sample: usize) -> usize {
        self.parts[sample]
    }

    /// One sample in so many under a cage.
    pub(super) fn sampled(&self, vertices: &[Point], thin: usize) -> Observation {
        if thin == 1 {
            return self.positioned(self.samples.transpose(), vertices);
        }
        self.sampled_at(vertices, &(0..self.sample_count()).step_by(thin).collect::<Vec<_>>())
    }

    /// Some samples under a cage.
    pub(super) fn sampled_at(&self, vertices: &[Point], samples: &[usize]) -> Observation {
        let (all, count) = (self.sample_count(), samples.len().max(1));
        let some = Mat::from_fn(self.samples.nrows(), 3 * samples.len(), |j, i| {
            self.samples[(j, i / count * all + samples[i % count])]
        });
        self.positioned(some.transpose(), vertices)
    }

    /// Samples under a cage, by coordinates of positions and of two tangent edges at each.
    fn positioned(&self, coordinates: MatRef<'_, f64>, vertices: &[Point]) -> Observation {
        let rows: Vec<DVec3> = points_in(coordinates, cage_values(self.normals.as_ref(), vertices).as_ref());
        let count = rows.len() / 3;
        let normal = |i: usize| rows[count + i].cross(rows[2 * count + i]).normalize_or_zero().to_array();
        Observation { points: plain(&rows[..count]), normals: (0..count).map(normal).collect() }
    }

    /// Derivatives of the positions of samples by the vertices of a cage, at that cage.
    pub(super) fn derivative(&self, vertices: &[Point]) -> SampleDerivative<'_> {
        let faces = self.normals.as_ref().map_or_else(Vec::new, |normals| {
            let of_face = |([a, b, c], [by_u, by_v]): (&[u32; 3], Derivative)| {
                // A normal's derivative by its edges, transposed to take a direction back to them.
                let back = [by_u, by_v].map(|rows| DMat3::from_cols_array_2d(&rows));
                ([*a as usize, *b as usize, *c as usize], back)
            };
            normals.faces().iter().zip(normals.derivatives(vertices)).map(of_face).collect()
        });
        SampleDerivative { model: self, faces }
    }
}

/// See [`PersonModel::derivative`].
pub(super) struct SampleDerivative<'a> {
    model: &'a PersonModel,
    faces: Vec<([usize; 3], [DMat3; 2])>,
}

impl SampleDerivative<'_> {
    /// Derivative of `direction · position` of a sample by the vertices: 3 × 86 numbers.
    pub(super) fn row(&self, sample: usize, direction: DVec3, out: &mut [f64]) {
        let column = self.model.samples.col_as_slice(sample);
        let (phi, psi) = column.split_at(CAGE_VERTICES);
        let mut by = [DVec3::ZERO; CAGE_VERTICES];
        by.iter_mut().zip(phi).for_each(|(by, &weight)| *by = direction * weight);
        for (([a, b, c], back), &weight) in self.faces.iter().zip(psi) {
            let along = direction * weight;
            let (by_b, by_c) = (back[0] * along, back[1] * along);
            by[*b] += by_b;
            by[*c] += by_c;
            by[*a] -= by_b + by_c;
        }
        out.chunks_exact_mut(3).zip(&by).for_each(|(out, by)| out.copy_from_slice(&by.to_array()));
    }
}

/// The quad whose vertices a point with these coordinates follows most.
fn part(coordinates: &[f64]) -> usize {
    let mut sums = [0.0; QUADS];
    coordinates.iter().enumerate().for_each(|(v, weight)| sums[owner(v)] += weight);
    (0..QUADS).max_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0)
}
