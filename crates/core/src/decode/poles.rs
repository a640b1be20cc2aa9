//! Points of another model beside poles of its coordinates.
//!
//! Mean values have poles where their weights add up to zero: outside of a cage, and inside one
//! that cuts itself. Beside a pole a point's coordinates are large and change quickly. The
//! capture's own points there were in the fit of its cages; one between them lands anywhere.

use crate::cage::Cage;
use crate::coordinates::{PointwiseCoordinates, for_each_chunk};
use crate::inversion::PrepareError;
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::{Aabb, Bvh, Surface};
use cager_geometry::vector::{along, distance, sub};
use faer::{Mat, MatRef};
use std::collections::HashMap;

/// Coordinates whose sizes add up to more are beside a pole.
const LARGE: f64 = 2.0;
/// Coordinates whose sizes add up to less have a usable derivative.
const GOOD: f64 = 1.5;
/// Of so many of the model's points, evenly spaced, the nearest good one gives the derivative.
const CANDIDATES: usize = 20_000;
/// Step of the derivative, and the longest way that needs none, as shares of the cage's diagonal.
const STEP: f64 = 1e-5;
const NO_WAY: f64 = 1e-12;
/// Coordinates that are bound, at the most: 128 MB of rows. A model with more is in another place.
const MAX_ENTRIES: usize = 1 << 24;

/// What is to be known of another model's points in a cage.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// How many lie outside of it.
    pub outside: usize,
    /// Those that lie beside poles, ascending.
    pub beside: Vec<u32>,
}

impl Survey {
    /// Of these points, chunk by chunk.
    pub fn of(pointwise: PointwiseCoordinates, cage: &Cage, points: &[Point]) -> Self {
        let mut found = Self::default();
        for_each_chunk(pointwise, cage, points, cage.vertices().len(), |first, part| {
            found.outside += part.outside.len();
            found.beside.extend(beside_poles(part.phi.as_ref()).iter().map(|place| first as u32 + place));
        });
        found
    }
}

/// Those of some points whose coordinates are beside a pole, ascending.
pub fn beside_poles(phi: MatRef<'_, f64>) -> Vec<u32> {
    // Not a number counts as well.
    sums(phi).iter().zip(0..).filter(|(sum, _)| sum.is_nan() || **sum > LARGE).map(|(_, place)| place).collect()
}

/// Sums of the sizes of each point's coordinates.
fn sums(phi: MatRef<'_, f64>) -> Vec<f64> {
    let mut sums = vec![0.0; phi.nrows()];
    for column in phi.col_iter() {
        sums.iter_mut().zip(column.iter()).for_each(|(sum, x)| *sum += x.abs());
    }
    sums
}

/// Coordinates of points that would lie beside a pole, by those of others.
#[derive(Clone, Debug)]
pub struct Bound {
    /// The points, ascending.
    pub places: Vec<u32>,
    /// Their coordinates, a row each.
    pub rows: Mat<f64>,
}

impl Bound {
    /// Of no points.
    pub fn none() -> Self {
        Self { places: Vec::new(), rows: zeros(0, 0) }
    }

    /// Binds those of some `points` that are `beside` poles to the model that the cages were fitted
    /// to: they get the coordinates of the nearest place on it, and for the way from there the
    /// first order of a good point's. The model's own points keep theirs.
    pub fn new(
        pointwise: PointwiseCoordinates,
        cage: &Cage,
        fitted: &TriMesh,
        points: &[Point],
        beside: &[u32],
    ) -> Result<Self, PrepareError> {
        let columns = cage.vertices().len();
        if beside.is_empty() || fitted.vertices.is_empty() {
            return Ok(Self::none());
        }
        let most = MAX_ENTRIES / columns;
        if beside.len() > most {
            return Err(PrepareError::TooManyBesidePoles { first: beside[0] as usize, points: beside.len(), most });
        }
        let own = tree(&fitted.vertices);
        let others = |&place: &u32| {
            distance(fitted.vertices[nearest(&own, &fitted.vertices, points[place as usize])], points[place as usize])
                > 0.0
        };
        let places: Vec<u32> = beside.iter().copied().filter(others).collect();
        let mut model =
            Fitted { pointwise, cage, fitted, surface: Surface::from(fitted), own, good: None, known: HashMap::new() };
        let mut rows = zeros(places.len(), columns);
        for (i, &place) in places.iter().enumerate() {
            model.row(points[place as usize]).into_iter().enumerate().for_each(|(j, value)| rows[(i, j)] = value);
        }
        Ok(Self { places, rows })
    }

    /// Those of the points from `first` on, as many as there are rows, with their rows.
    pub(super) fn within(&self, first: usize, rows: usize) -> impl Iterator<Item = (usize, usize)> {
        let from = self.places.partition_point(|&place| (place as usize) < first);
        let to = self.places.partition_point(|&place| (place as usize) < first + rows);
        (from..to).map(move |at| (self.places[at] as usize - first, at))
    }
}

fn tree(points: &[Point]) -> Bvh {
    let boxes: Vec<Aabb> = points.iter().map(|&p| Aabb::around([p.into()])).collect();
    Bvh::new(&boxes)
}

/// The nearest of a tree's points; the first where there is none, as of points that are not finite.
fn nearest(tree: &Bvh, points: &[Point], p: Point) -> usize {
    let found = tree.nearest(p.into(), f64::INFINITY, |i| distance(points[i as usize], p).powi(2));
    found.map_or(0, |(i, _)| i as usize)
}

/// The model that a capture's cages were fitted to, at rest.
struct Fitted<'a> {
    pointwise: PointwiseCoordinates,
    cage: &'a Cage,
    fitted: &'a TriMesh,
    surface: Surface,
    own: Bvh,
    /// Points whose coordinates have a usable derivative, once they are wanted.
    good: Option<(Vec<Point>, Bvh)>,
    /// Derivatives at them that are known, one slope for each coordinate.
    known: HashMap<usize, Vec<Point>>,
}

impl Fitted<'_> {
    fn row(&mut self, p: Point) -> Vec<f64> {
        let points = &self.fitted.vertices;
        let (corners, weights) = match self.surface.nearest(p.into()) {
            Some(found) => (self.surface.triangles[found.face as usize].map(|v| points[v as usize]), found.weights),
            None => ([points[nearest(&self.own, points, p)]; 3], [1.0, 0.0, 0.0]),
        };
        let phi = (self.pointwise)(self.cage, &corners).phi;
        let mut row: Vec<f64> = phi.col_iter().map(|column| (0..3).map(|k| weights[k] * column[k]).sum()).collect();
        let foot: Point = std::array::from_fn(|k| (0..3).map(|c| weights[c] * corners[c][k]).sum());
        if distance(p, foot) > NO_WAY * self.cage.diagonal() {
            let way = sub(p, foot);
            for (value, slope) in row.iter_mut().zip(self.derivative(p)) {
                *value += (0..3).map(|k| slope[k] * way[k]).sum::<f64>();
            }
        }
        row
    }

    /// Derivatives of each coordinate at the good point nearest to a place.
    fn derivative(&mut self, p: Point) -> &[Point] {
        let Self { pointwise, cage, fitted, good, known, .. } = self;
        let (points, tree) = good.get_or_insert_with(|| {
            let points = good_points(*pointwise, cage, &fitted.vertices);
            let tree = tree(&points);
            (points, tree)
        });
        let at = nearest(tree, points, p);
        known.entry(at).or_insert_with(|| {
            let step = STEP * cage.diagonal();
            let beside: [Point; 6] = std::array::from_fn(|k| {
                let axis: Point = std::array::from_fn(|c| f64::from(u8::from(c == k % 3)));
                along(points[at], if k < 3 { step } else { -step }, axis)
            });
            let phi = pointwise(cage, &beside).phi;
            let slope = |j: usize, k: usize| (phi[(k, j)] - phi[(k + 3, j)]) / (beside[k][k] - beside[k + 3][k]);
            (0..phi.ncols()).map(|j| std::array::from_fn(|k| slope(j, k))).collect()
        })
    }
}

/// Those of some points whose coordinates are good; the best of them where there is none.
fn good_points(pointwise: PointwiseCoordinates, cage: &Cage, points: &[Point]) -> Vec<Point> {
    let every = points.len().div_ceil(CANDIDATES);
    let some: Vec<Point> = points.iter().copied().step_by(every).collect();
    let mut sizes = Vec::new();
    for_each_chunk(pointwise, cage, &some, cage.vertices().len(), |_, part| sizes.extend(sums(part.phi.as_ref())));
    let best = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let is_good = |&(_, size): &(&Point, f64)| size <= GOOD.max(best);
    let good: Vec<Point> = some.iter().zip(sizes).filter(is_good).map(|(&p, _)| p).collect();
    if good.is_empty() { some } else { good }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinates::{CoordinateSystem as _, MeanValue};
    use crate::decode::Decoder;
    use cager_geometry::vector::combination;

    /// A tube along z, of rings of points.
    fn tube(rings: usize, around: usize, radius: f64, half: f64) -> TriMesh {
        let at = |i: usize, k: usize| {
            let turn = std::f64::consts::TAU * k as f64 / around as f64;
            [radius * turn.cos(), radius * turn.sin(), half * (2.0 * i as f64 / (rings - 1) as f64 - 1.0)]
        };
        let mut vertices: Vec<Point> = (0..rings * around).map(|v| at(v / around, v % around)).collect();
        let mut triangles = Vec::new();
        let id = |i: usize, k: usize| (i * around + k % around) as u32;
        for i in 0..rings - 1 {
            for k in 0..around {
                triangles.push([id(i, k), id(i, k + 1), id(i + 1, k + 1)]);
                triangles.push([id(i, k), id(i + 1, k + 1), id(i + 1, k)]);
            }
        }
        for (ring, z, flip) in [(0, -half, true), (rings - 1, half, false)] {
            let middle = vertices.len() as u32;
            vertices.push([0.0, 0.0, z]);
            for k in 0..around {
                let (a, b) = (id(ring, k), id(ring, k + 1));
                triangles.push(if flip { [b, a, middle] } else { [a, b, middle] });
            }
        }
        TriMesh { vertices, triangles }
    }

    /// A cage that cuts itself, as free designs do: a dent of a wall goes through the opposite one.
    fn cage() -> Cage {
        let mut mesh = tube(8, 8, 1.0, 2.0);
        mesh.vertices[3 * 8][0] = -1.6;
        Cage::new(mesh).expect("a cage")
    }

    #[test]
    fn points_beside_poles_follow_the_model_that_cages_were_fitted_to() {
        let cage = cage();
        let fitted = tube(41, 40, 0.8, 1.6);
        // A dense copy: the middle of every face, and some off the surface.
        let corners = |t: &[u32; 3]| t.map(|v| fitted.vertices[v as usize]);
        let on = |t: &[u32; 3], w: [f64; 3]| combination(w, corners(t));
        let weights = [[0.4, 0.35, 0.25], [0.2, 0.3, 0.5], [0.6, 0.1, 0.3]];
        let copies = |w: [f64; 3]| fitted.triangles.iter().map(move |t| on(t, w));
        let mut dense: Vec<Point> = weights.into_iter().flat_map(copies).collect();
        let surface = dense.len();
        dense.extend(fitted.vertices.iter().map(|p| p.map(|x| 1.004 * x)));
        let off = dense.len();
        dense.extend(&fitted.vertices);
        let pointwise = MeanValue.pointwise().expect("mean values");
        let Survey { beside, .. } = Survey::of(pointwise, &cage, &dense);
        assert_eq!(beside, beside_poles(pointwise(&cage, &dense).phi.as_ref()));
        let bound = Bound::new(pointwise, &cage, &fitted, &dense, &beside).unwrap();
        let many = vec![0; MAX_ENTRIES / cage.vertices().len() + 1];
        let refused = Bound::new(pointwise, &cage, &fitted, &dense, &many).err();
        assert!(matches!(refused, Some(PrepareError::TooManyBesidePoles { .. })), "{refused:?}");
        assert!(bound.places.len() > 3 && bound.places.iter().all(|&place| (place as usize) < off), "{bound:?}");
        for (at, &place) in bound.places.iter().enumerate() {
            let row: Vec<f64> = bound.rows.row(at).iter().copied().collect();
            let back: Point = std::array::from_fn(|k| row.iter().zip(cage.vertices()).map(|(w, v)| w * v[k]).sum());
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{place}");
            assert!(distance(back, dense[place as usize]) < 1e-9, "{place}: {back:?}");
        }

        // Whatever the cage does, what lies on the model moves with it.
        let mut random = fastrand::Rng::with_seed(5);
        let mut near = |x: &f64| (x + 0.2 * (random.f64() - 0.5)) as f32;
        let cages: Vec<Vec<f32>> =
            (0..4).map(|_| cage.vertices().as_flattened().iter().map(&mut near).collect()).collect();
        let cages: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        let columns = cage.vertices().len();
        let stored = || Decoder::with_stored_coordinates(pointwise, &cage, &dense, columns);
        let recomputed = || Decoder::with_recomputed_coordinates(pointwise, &cage, &dense, columns);
        let decoded = |decoder: &Decoder| {
            let mut found = vec![Vec::new(); cages.len()];
            decoder.decode(&cages, &mut found);
            found
        };
        let on_surface = || bound.places.iter().map(|&place| place as usize).filter(|&place| place < surface);
        let largest = |decoder: &Decoder| {
            let at = |frame: &Vec<f32>, i: usize| -> Point { std::array::from_fn(|k| f64::from(frame[3 * i + k])) };
            let apart = |frame: &Vec<f32>, i: usize| {
                let corners = fitted.triangles[i % fitted.triangles.len()].map(|v| at(frame, off + v as usize));
                distance(at(frame, i), combination(weights[i / fitted.triangles.len()], corners))
            };
            let frames = decoded(decoder);
            frames.iter().flat_map(|frame| on_surface().map(|i| apart(frame, i))).fold(0.0, f64::max)
        };
        let (before, after) = (largest(&stored()), largest(&stored().with_bound(bound.clone())));
        assert!(on_surface().count() > 20 && before > 0.02 && after < 1e-5, "{before} {after}");
        // Recomputed, too, and some of them.
        let some: Vec<u32> = [&bound.places[..2], &[0, 7]].concat();
        let (kept, again) = (stored().with_bound(bound.clone()), recomputed().with_bound(bound));
        assert_eq!(decoded(&kept), decoded(&again));
        assert_eq!(decoded(&kept.of_points(&some)), decoded(&again.of_points(&some)));
    }
}
