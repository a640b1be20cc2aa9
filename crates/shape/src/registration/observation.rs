//! A surface as it was seen once: points with outward normals, from a mesh or a cloud, checked.

use cager_geometry::mesh::diagonal;
use cager_geometry::vector::{Point, dot, mean, sub};
use glam::DVec3;

use super::normals::{estimated_normals, plane_normal};
use super::orientation::{Oriented, oriented};
use super::sampling::sample_surface;
use crate::points::area_vector;

/// Points of a surface with outward unit normals. Nothing corresponds between observations.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// The points.
    pub points: Vec<Point>,
    /// Their unit normals.
    pub normals: Vec<Point>,
}

/// How many points an observation has, and which.
#[derive(Clone, Copy, Debug)]
pub struct ObservationOptions {
    /// Points that are drawn of a mesh, and kept of a cloud at the most.
    pub points: usize,
    /// What they are drawn by.
    pub seed: u64,
}

impl Default for ObservationOptions {
    fn default() -> Self {
        Self { points: 15_000, seed: 0 }
    }
}

/// What was done to an observation before it was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ObservationNotes {
    /// All normals pointed inwards, and were turned.
    pub turned: bool,
    /// Faces that were turned, since they ran against their neighbours.
    pub turned_faces: usize,
    /// Normals were estimated from neighbouring points.
    pub estimated_normals: bool,
    /// The area of the surface; none for a cloud.
    pub area: Option<f64>,
}

/// Why a surface cannot be an observation.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ObservationError {
    /// Fewer points than a surface has: how many there are.
    #[error("has {0} points; a surface needs at least {MIN_POINTS}")]
    TooFewPoints(usize),
    /// A coordinate is NaN or infinite: the first such point.
    #[error("has a coordinate that is NaN or infinite at vertex {0}; repair or remove it")]
    NotFinite(usize),
    /// Coordinates that cannot be calculated with, or points that all but coincide: the extent.
    #[error("reaches {0:e} units; scale it to something between 1e-20 and 1e20")]
    Extreme(f64),
    /// All faces are points or lines, or none is left.
    #[error("has faces, but none of them has an area; export the mesh again")]
    NoArea,
    /// All points lie on a line or in one place.
    #[error("has points on one line only; a surface cannot be told from them")]
    Line,
    /// Normals that are zero or not finite: the first such point.
    #[error("has no normal at vertex {0}; write normals for all points, or for none")]
    NoNormal(usize),
}

/// The least number of points of an observation.
const MIN_POINTS: usize = 10;
/// Coordinates beyond, or extents below one over it, are no length of anything.
const MAX_EXTENT: f64 = 1e20;

impl Observation {
    /// [`Self::of_mesh`], or [`Self::of_cloud`] where there are no triangles.
    ///
    /// # Errors
    /// See [`ObservationError`].
    pub fn of_surface(
        vertices: &[Point],
        triangles: &[[u32; 3]],
        normals: &[Point],
        options: &ObservationOptions,
    ) -> Result<(Self, ObservationNotes), ObservationError> {
        if triangles.is_empty() {
            Self::of_cloud(vertices, normals, options)
        } else {
            Self::of_mesh(vertices, triangles, options)
        }
    }

    /// Points drawn of a triangle mesh, even by area. Faces that run against their neighbours are
    /// turned, and all where they face inwards; vertices at one place are one for that.
    ///
    /// # Errors
    /// See [`ObservationError`].
    pub fn of_mesh(
        vertices: &[Point],
        triangles: &[[u32; 3]],
        options: &ObservationOptions,
    ) -> Result<(Self, ObservationNotes), ObservationError> {
        check_points(vertices)?;
        let Oriented { triangles, turned_faces, turned } = oriented(vertices, triangles);
        let drawn = sample_surface(vertices, &triangles, options.points, options.seed);
        if drawn.is_empty() {
            return Err(ObservationError::NoArea);
        }
        let normal = |triangle: &[u32; 3]| area_vector(triangle.map(|v| vertices[v as usize]));
        let observation = Self {
            points: drawn.iter().map(|sample| sample.at(vertices, &triangles)).collect(),
            normals: drawn.iter().map(|s| normal(&triangles[s.face as usize]).normalize_or_zero().to_array()).collect(),
        };
        let area = triangles.iter().map(|triangle| 0.5 * normal(triangle).length()).sum();
        Ok((observation, ObservationNotes { turned, turned_faces, area: Some(area), ..ObservationNotes::default() }))
    }

    /// Points kept of a cloud, with given or, without any, estimated normals, turned outwards.
    ///
    /// # Errors
    /// See [`ObservationError`].
    ///
    /// # Panics
    /// With another number of normals than of points.
    pub fn of_cloud(
        points: &[Point],
        normals: &[Point],
        options: &ObservationOptions,
    ) -> Result<(Self, ObservationNotes), ObservationError> {
        check_points(points)?;
        assert!(normals.is_empty() || normals.len() == points.len(), "a normal for each point or none");
        let mut kept: Vec<u32> = (0..points.len() as u32).collect();
        if kept.len() > options.points {
            fastrand::Rng::with_seed(options.seed).shuffle(&mut kept);
            kept.truncate(options.points);
            kept.sort_unstable();
        }
        let estimated = normals.is_empty();
        let mut kept_normals = if estimated {
            estimated_normals(points, &kept).ok_or(ObservationError::Line)?
        } else {
            let unit = |&k: &u32| {
                let normal = DVec3::from(normals[k as usize]);
                normal.try_normalize().map(|n| n.to_array()).ok_or(ObservationError::NoNormal(k as usize))
            };
            kept.iter().map(unit).collect::<Result<_, _>>()?
        };
        let points: Vec<Point> = kept.iter().map(|&k| points[k as usize]).collect();
        if plane_normal(&points) == [0.0; 3] {
            return Err(ObservationError::Line);
        }
        let turned = points_inwards(&points, &kept_normals);
        if turned {
            kept_normals.iter_mut().for_each(|n| *n = n.map(|x| -x));
        }
        let notes =
            ObservationNotes { turned: turned && !estimated, estimated_normals: estimated, ..Default::default() };
        Ok((Self { points, normals: kept_normals }, notes))
    }
}

fn check_points(points: &[Point]) -> Result<(), ObservationError> {
    if points.len() < MIN_POINTS {
        return Err(ObservationError::TooFewPoints(points.len()));
    }
    if let Some(vertex) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(ObservationError::NotFinite(vertex));
    }
    let largest = points.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let extent = diagonal(points);
    if largest > MAX_EXTENT {
        Err(ObservationError::Extreme(largest))
    } else if extent > 0.0 && extent < 1.0 / MAX_EXTENT {
        Err(ObservationError::Extreme(extent))
    } else {
        Ok(())
    }
}

/// By `Σ (p − centre) · n`, which over a closed surface has the sign of the volume.
fn points_inwards(points: &[Point], normals: &[Point]) -> bool {
    let center = mean(points);
    points.iter().zip(normals).map(|(&p, &n)| dot(sub(p, center), n)).sum::<f64>() < 0.0
}
