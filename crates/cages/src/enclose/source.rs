//! A model for enclosing: centred, with unit diagonal, and loose points as degenerate triangles.

use super::gap_offset::Offset;
use super::options::EncloseError;
use cager_geometry::mesh::{Model, Point, bounds, diagonal};
use cager_geometry::spatial::Surface;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashSet;

/// About so many points are tested while a cage is simplified; larger models are subsampled.
const CHECKED_POINTS: usize = 60_000;

/// The model in a frame of reference where it is centred and its diagonal is one.
#[derive(Debug)]
pub(super) struct NormalizedModel {
    /// All points of the model.
    pub(super) points: Vec<DVec3>,
    /// Faces as triangles, points without a face as triangles with one corner three times.
    pub(super) surface: Surface,
    /// Whether faces have free edges.
    pub(super) open: bool,
    /// Points on large faces, which stay inside too.
    on_faces: Vec<DVec3>,
    /// Offset of the first cage that is tried.
    spacing: f64,
    center: DVec3,
    scale: f64,
}

impl NormalizedModel {
    pub(super) fn new(model: &Model, spacing: f64) -> Result<Self, EncloseError> {
        let (low, high, scale) = extent(&model.points)?;
        let center = 0.5 * low + 0.5 * high;
        let points: Vec<DVec3> = model.points.iter().map(|&p| (DVec3::from(p) - center) / scale).collect();
        let mut triangles = triangles(model);
        let open = has_free_edges(&triangles);
        let mut used = vec![false; points.len()];
        triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
        let on_faces = on_faces(&points, &triangles, spacing);
        triangles.extend((0..points.len() as u32).filter(|&v| !used[v as usize]).map(|v| [v; 3]));
        let surface = Surface::new(points.clone(), triangles);
        Ok(Self { points, surface, open, on_faces, spacing, center, scale })
    }

    /// Points checked while a cage is simplified, with the distance to the cage that keeps the
    /// whole model at `clearance`.
    pub(super) fn samples(&self, offset: &Offset, clearance: impl Fn(DVec3) -> f64) -> (Vec<DVec3>, Vec<f64>) {
        let (mut points, radii) = thin(&self.points, self.spacing, offset);
        let mut clearances: Vec<f64> = points.iter().zip(radii).map(|(&p, radius)| clearance(p) + radius).collect();
        points.extend(&self.on_faces);
        clearances.extend(self.on_faces.iter().map(|&p| clearance(p)));
        (points, clearances)
    }

    /// Back in the model's own frame of reference.
    pub(super) fn restored(&self, p: DVec3) -> [f64; 3] {
        (self.center + self.scale * p).to_array()
    }
}

/// The faces of a model as triangles, but those with corners that there are not.
pub(crate) fn triangles(model: &Model) -> Vec<[u32; 3]> {
    let exists = |t: &[u32; 3]| t.iter().all(|&v| (v as usize) < model.points.len());
    model.faces.triangulated().into_iter().filter(exists).collect()
}

/// Points on the large faces of a model, which are to stay inside too; `spacing` is in its unit.
pub(super) fn points_on_faces(model: &Model, spacing: f64) -> Vec<Point> {
    let points: Vec<DVec3> = model.points.iter().map(|&p| p.into()).collect();
    on_faces(&points, &triangles(model), spacing).into_iter().map(Into::into).collect()
}

fn on_faces(points: &[DVec3], triangles: &[[u32; 3]], spacing: f64) -> Vec<DVec3> {
    let surface_area = triangles.iter().map(|t| area(t.map(|v| points[v as usize]))).sum::<f64>();
    let spacing = (2.5 * spacing).max((surface_area / 10_000.0).sqrt());
    let mut found = Vec::new();
    for t in triangles {
        sample_face(t.map(|v| points[v as usize]), spacing, &mut found);
    }
    // Of slivers there are many more than their area needs.
    if found.len() > CHECKED_POINTS {
        let mut seen = HashSet::new();
        found.retain(|p| seen.insert((2.0 * p / spacing).floor().to_array().map(|x| x as i64)));
    }
    found
}

/// Refuses points with coordinates that are not finite.
pub(crate) fn check_finite(points: &[Point]) -> Result<(), EncloseError> {
    match points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        Some(point) => Err(EncloseError::NotFinite(point)),
        None => Ok(()),
    }
}

/// Corners and diagonal of the bounding box; refuses no points, and points in one place.
pub(crate) fn extent(points: &[Point]) -> Result<(DVec3, DVec3, f64), EncloseError> {
    if points.is_empty() {
        return Err(EncloseError::Empty);
    }
    let (low, high) = bounds(points);
    let (low, high) = (DVec3::from(low), DVec3::from(high));
    let extent = diagonal(points);
    if !extent.is_finite() || extent <= 1e-12 * low.abs().max(high.abs()).max_element() {
        return Err(EncloseError::NoExtent);
    }
    Ok((low, high, extent))
}

/// Area of a triangle.
pub(super) fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// One point a voxel, of many, and how far points may be that it stands for. Voxels are smaller
/// near gaps.
fn thin(points: &[DVec3], spacing: f64, offset: &Offset) -> (Vec<DVec3>, Vec<f64>) {
    if points.len() <= CHECKED_POINTS {
        return (points.to_vec(), vec![0.0; points.len()]);
    }
    let halvings: Vec<i32> = points.par_iter().map(|&p| (offset.largest / offset.at(p)).log2().ceil() as i32).collect();
    let mut seen = HashSet::new();
    let mut kept = (Vec::new(), Vec::new());
    for (&p, halvings) in points.iter().zip(halvings) {
        let voxel = 0.2 * spacing * 0.5_f64.powi(halvings);
        if seen.insert((halvings, (p / voxel).floor().to_array().map(|x| x as i64))) {
            kept.0.push(p);
            kept.1.push(voxel * 3.0_f64.sqrt());
        }
    }
    kept
}

/// Points on a face that is large beside the spacing, so that it stays inside too.
fn sample_face([a, b, c]: [DVec3; 3], spacing: f64, samples: &mut Vec<DVec3>) {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let n = ((longest / spacing).ceil() as u32).min(400);
    for i in 0..=n {
        for j in 0..=n - i {
            let corner = (i == 0 && (j == 0 || j == n)) || i == n;
            if !corner {
                let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                samples.push(a + s * (b - a) + t * (c - a));
            }
        }
    }
}

/// Whether some edge is not run along as often in one direction as in the other.
fn has_free_edges(triangles: &[[u32; 3]]) -> bool {
    let mut edges: Vec<(u32, u32, i32)> = triangles
        .iter()
        .flat_map(|t| (0..3).map(|k| (t[k], t[(k + 1) % 3])))
        .filter(|(a, b)| a != b)
        .map(|(a, b)| (a.min(b), a.max(b), if a < b { 1 } else { -1 }))
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).any(|same| same.iter().map(|e| e.2).sum::<i32>() != 0)
}
