//! A large model by fewer points: one of each voxel, with the faces left between them.

use crate::enclose::triangles;
use cager_geometry::mesh::{Model, Polygons, bounds, diagonal};
use cager_geometry::vector::sub;
use rustc_hash::{FxHashMap, FxHashSet};

/// Models of more points are thinned, to about so many.
const LARGE: usize = 30_000;
const KEPT: usize = 20_000;
/// Voxels of the first size along the diagonal, and how many sizes are tried.
const FIRST_VOXELS: f64 = 250.0;
const SIZES: usize = 4;

/// What stands for a large model.
pub(crate) struct Thinned {
    /// Points of the model, ascending.
    pub(crate) points: Vec<u32>,
    /// For each point of the model, the place of the one that stands for it.
    places: Vec<u32>,
}

impl Thinned {
    /// Of a model with finite points and an extent; `None` where it has few enough points.
    pub(crate) fn of(model: &Model) -> Option<Self> {
        let voxels = Voxels::of(model)?;
        let mut order: Vec<u32> = (0..voxels.nearest.len() as u32).collect();
        order.sort_unstable_by_key(|&voxel| voxels.nearest[voxel as usize].1);
        let mut place = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&voxel, k)| place[voxel as usize] = k);
        let points = order.iter().map(|&voxel| voxels.nearest[voxel as usize].1).collect();
        Some(Self { points, places: voxels.of.iter().map(|&voxel| place[voxel as usize]).collect() })
    }

    /// These points, and the faces with corners in three voxels, as often as several become one, so
    /// that closed surfaces stay closed. What is thinner than a voxel stays as triangles with one
    /// corner twice.
    pub(crate) fn model(&self, model: &Model) -> Model {
        let mut faces = Polygons::new();
        let (mut sides, mut edges) = (FxHashSet::default(), Vec::new());
        for [a, b, c] in triangles(model).into_iter().map(|t| t.map(|v| self.places[v as usize])) {
            if a != b && b != c && c != a {
                faces.push(&[a, b, c]);
                sides.extend([[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]));
            } else if a != b || b != c {
                let other = if a == b { c } else { b };
                edges.push([a.min(other), a.max(other)]);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        edges.iter().filter(|edge| !sides.contains(*edge)).for_each(|&[a, b]| faces.push(&[a, b, b]));
        let points = self.points.iter().map(|&p| model.points[p as usize]).collect();
        Model { points, faces, ..Model::default() }
    }
}

/// The voxels that points are in.
struct Voxels {
    /// That of each point.
    of: Vec<u32>,
    /// The point nearest to the middle of each, after its squared distance from there.
    nearest: Vec<(f64, u32)>,
}

impl Voxels {
    fn of(model: &Model) -> Option<Self> {
        if model.points.len() <= LARGE {
            return None;
        }
        let mut side = diagonal(&model.points) / FIRST_VOXELS;
        for _ in 1..SIZES {
            let found = Self::of_size(model, side);
            let many = found.nearest.len() as f64 / KEPT as f64;
            if (0.8..1.25).contains(&many) {
                return Some(found);
            }
            // Points are on surfaces: of twice the size, a quarter as many voxels hold any.
            side *= many.sqrt();
        }
        Some(Self::of_size(model, side))
    }

    fn of_size(model: &Model, side: f64) -> Self {
        let (low, _) = bounds(&model.points);
        let mut found = Self { of: Vec::with_capacity(model.points.len()), nearest: Vec::new() };
        let mut numbers = FxHashMap::default();
        for (&p, i) in model.points.iter().zip(0..) {
            let inside = sub(p, low).map(|x| x / side);
            let cell = inside.map(f64::floor);
            let away2 = inside.iter().zip(cell).map(|(x, low)| (x - low - 0.5).powi(2)).sum();
            let voxel = *numbers.entry(cell.map(|x| x as i64)).or_insert(found.nearest.len() as u32);
            match found.nearest.get_mut(voxel as usize) {
                None => found.nearest.push((away2, i)),
                Some(nearest) if away2 < nearest.0 => *nearest = (away2, i),
                Some(_) => {}
            }
            found.of.push(voxel);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::mesh::winding_number;

    /// A sphere of so many rings, and twice as many points around each, with a spike of one point.
    fn sphere(rings: u32) -> Model {
        let around = 2 * rings;
        let (mut points, mut faces) = (vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], Polygons::new());
        let at = |ring: u32, k: u32| 2 + ring * around + k % around;
        for ring in 0..rings {
            let (z, r) = (std::f64::consts::PI * f64::from(ring + 1) / f64::from(rings + 1)).sin_cos();
            for k in 0..around {
                let (y, x) = (std::f64::consts::TAU * f64::from(k) / f64::from(around)).sin_cos();
                points.push([z * x, z * y, r]);
                if ring == 0 {
                    faces.push(&[0, at(0, k), at(0, k + 1)]);
                } else {
                    faces.push(&[at(ring - 1, k), at(ring, k), at(ring, k + 1), at(ring - 1, k + 1)]);
                }
            }
        }
        (0..around).for_each(|k| faces.push(&[1, at(rings - 1, k + 1), at(rings - 1, k)]));
        Model { points, faces, ..Model::default() }
    }

    #[test]
    fn a_large_model_keeps_its_shape_and_closed_surfaces_stay_closed() {
        assert!(Thinned::of(&sphere(100)).is_none());
        let model = sphere(250);
        let found = Thinned::of(&model).expect("a large model");
        let (points, thin) = (&found.points, found.model(&model));
        assert!((14_000..28_000).contains(&points.len()), "{}", points.len());
        assert!(points.is_sorted() && points.len() == thin.points.len());
        assert!(points.iter().zip(&thin.points).all(|(&i, p)| model.points[i as usize] == *p));
        let triangles = thin.faces.triangulated();
        let inside = winding_number(&thin.points, &triangles, [0.1, 0.2, 0.3]);
        let outside = winding_number(&thin.points, &triangles, [1.5, 0.0, 0.0]);
        assert!((inside - 1.0).abs() < 1e-9 && outside.abs() < 1e-9, "{inside} {outside}");
    }

    #[test]
    fn an_outlier_does_not_leave_one_point_for_all_others() {
        let mut model = sphere(250);
        model.points.push([0.0, 500.0, 0.0]);
        let kept = Thinned::of(&model).expect("a large model").points.len();
        assert!((5_000..60_000).contains(&kept), "{kept}");
    }
}
