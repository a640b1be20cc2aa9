//! A template laid onto another shape: stiff and far-seeing first, each stage's shape the next
//! one's rest.

use cager_geometry::vector::Point;

use super::anchors::Anchors;
use super::closeness::MeasuredSurface;
use super::fit::FitOptions;
use super::matching::KnownMatches;
use super::observation::Observation;
use super::target::Target;
use super::template::Template;
use crate::points::vectors;

/// Stages, and iterations of each at the most: in earnest, and where alignments are compared.
const STAGES: usize = 8;
const ITERATIONS: [usize; 2] = [8, 3];
/// Weight of rigidity in the first stage and in the last.
const RIGIDITY: [f64; 2] = [1e-1, 3e-4];
/// Distance at which a match counts a quarter, over the diagonal, at the beginning and at the end.
const REACH: [f64; 2] = [0.15, 0.006];
/// A worse score than this is tried again down to this rigidity.
const GOOD_SCORE: f64 = 0.0035;
const SOFTEST: f64 = 1e-5;

/// A template on another shape.
#[derive(Clone, Debug)]
pub struct Registration {
    /// The cage that lays it there.
    pub cage: Vec<Point>,
    /// What its cage was scored: the less, the better.
    pub score: f64,
    /// The weight of rigidity that it ended with.
    pub rigidity: f64,
}

/// Scores above are mostly of distances beyond the most that counts: softer is no use.
const HOPELESS: f64 = 0.8 * MeasuredSurface::MAX_DISTANCE;
/// What a normal counts in matches, over the diagonal: at first, and each stage's over that before.
const FIRST_NORMAL_LENGTH: f64 = 0.1;
const NORMAL_DECAY: f64 = 0.8;
/// Rigidity in the last iteration of a stage over that in its first.
const SOFTENING: f64 = 0.5;
/// Holds what nothing else determines.
const HOLD: f64 = 1e-6;
/// Stages at the end in which anchors do not pull: they may be rough.
const FREE_STAGES: usize = 2;

impl Template {
    /// Lays the template, from where `cage` has it, onto another shape (coarse to fine as in Amberg
    /// et al. 2007, in the space of the cage), some points to known places. `score` tells how far a
    /// cage leaves it from there. Once, in few iterations, where `quick`; once `stopped`, nothing
    /// better is looked for. Runs on the current rayon pool; the result does not depend on it.
    ///
    /// # Panics
    /// Where there are no observed points.
    pub fn register(
        &mut self,
        cage: &[Point],
        observation: &Observation,
        anchors: Option<&Anchors>,
        quick: bool,
        score: &dyn Fn(&[Point]) -> f64,
        stopped: &dyn Fn() -> bool,
    ) -> Registration {
        let mut to = |rigidity: f64| {
            let iterations = ITERATIONS[usize::from(quick)];
            let cage = self.register_to(cage, observation, anchors, iterations, rigidity, stopped);
            Registration { score: score(&cage), cage, rigidity }
        };
        let first = to(RIGIDITY[1]);
        if quick || first.score <= GOOD_SCORE || first.score > HOPELESS || stopped() {
            return first;
        }
        let second = to(SOFTEST);
        if first.score <= second.score || second.score.is_nan() { first } else { second }
    }

    fn register_to(
        &mut self,
        cage: &[Point],
        observation: &Observation,
        anchors: Option<&Anchors>,
        iterations: usize,
        softest: f64,
        stopped: &dyn Fn() -> bool,
    ) -> Vec<Point> {
        let at_rest = self.rigidity.graph.rest.clone();
        let narrowing = (REACH[1] / REACH[0]).powf(1.0 / STAGES as f64);
        let mut known = KnownMatches::none(self.samples.len(), observation.points.len());
        let mut moved = cage.to_vec();
        for stage in 0..STAGES {
            if stopped() {
                break;
            }
            let rigidity = RIGIDITY[0] * (softest / RIGIDITY[0]).powf(stage as f64 / (STAGES - 1) as f64);
            let reach = REACH[0] * narrowing.powi(stage as i32);
            let normal_length = FIRST_NORMAL_LENGTH * NORMAL_DECAY.powi(stage as i32) * self.diagonal;
            let target = Target::with_normal_length(observation, normal_length);
            let fit = FitOptions {
                iterations,
                rigidity: [rigidity, SOFTENING * rigidity],
                reach: [reach, narrowing * reach],
                hold: HOLD,
            };
            let anchors = anchors.filter(|_| stage + FREE_STAGES < STAGES);
            let (found, in_reach) = self.fit_held(&target, &moved, cage, &fit, anchors, &mut known);
            moved = found;
            if !in_reach {
                // Later stages see less far.
                break;
            }
            let nodes = self.rigidity.positions(&vectors(&moved));
            self.rigidity.graph.set_rest(&nodes);
        }
        self.rigidity.graph.rest = at_rest;
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::matrix;
    use crate::registration::observation::ObservationOptions;
    use cager_core::cage::Cage;
    use cager_core::coordinates::{CoordinateSystem, MeanValue};
    use cager_geometry::linalg::{rows_of, tall_product};
    use cager_geometry::mesh::TriMesh;

    /// A sphere of 12 rings, stretched.
    fn ellipsoid(stretch: Point) -> TriMesh {
        let (rings, around) = (12_u32, 24_u32);
        let mut vertices = vec![[0.0, 0.0, 1.0]];
        for (i, j) in (1..rings).flat_map(|i| (0..around).map(move |j| (i, j))) {
            let polar = std::f64::consts::PI * f64::from(i) / f64::from(rings);
            let turn = std::f64::consts::TAU * f64::from(j) / f64::from(around);
            vertices.push([polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos()]);
        }
        vertices.push([0.0, 0.0, -1.0]);
        let (at, last) = (|i: u32, j: u32| 1 + (i - 1) * around + j % around, vertices.len() as u32 - 1);
        let mut triangles = Vec::new();
        for j in 0..around {
            triangles.extend([[0, at(1, j), at(1, j + 1)], [last, at(rings - 1, j + 1), at(rings - 1, j)]]);
            for i in 1..rings - 1 {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        vertices.iter_mut().for_each(|p| (0..3).for_each(|k| p[k] *= stretch[k]));
        TriMesh { vertices, triangles }
    }

    #[test]
    fn a_template_reaches_another_shape_and_is_as_before_afterwards() {
        let (rest, target) = (ellipsoid([1.0, 0.7, 0.5]), ellipsoid([0.8, 0.8, 0.6]));
        let cage = Cage::new(ellipsoid([1.3, 0.9, 0.7])).unwrap();
        let phi = MeanValue.coordinates(&cage, &rest.vertices, None).unwrap().phi;
        let mut template = Template::new(&rest, &cage, phi.as_ref(), 0).unwrap();
        let draw = ObservationOptions::default();
        let seen = Observation::of_mesh(&target.vertices, &target.triangles, &draw).unwrap().0;
        let surface = MeasuredSurface::of_mesh(&target.vertices, &target.triangles, template.diagonal());
        let score = |cage: &[Point]| {
            let laid = tall_product(phi.as_ref(), matrix(cage).as_ref());
            let laid: Vec<Point> = (0..laid.nrows()).map(|i| [0, 1, 2].map(|k| laid[(i, k)])).collect();
            surface.distance(&seen, &laid, &rest.triangles, 0)
        };
        let before = score(cage.vertices());
        let mut lay = |anchors: Option<&Anchors>, quick: bool| {
            template.register(cage.vertices(), &seen, anchors, quick, &score, &|| false)
        };
        let found = lay(None, false);
        assert!(found.score < 0.004 && found.score < 0.2 * before, "{} after {before}", found.score);
        let again = lay(None, false);
        assert!(found.cage == again.cage && found.score == again.score);
        // A surface out of reach is left at once, and not tried again.
        let far = |points: &[Point]| points.iter().map(|p| p.map(|x| 0.02 * x + 90.0)).collect();
        let far = Observation { points: far(&seen.points), normals: seen.normals.clone() };
        let unreached = template.register(cage.vertices(), &far, None, false, &|_| 0.05, &|| false);
        assert!(unreached.cage == cage.vertices() && unreached.rigidity == RIGIDITY[1]);
        // One that is stopped at once stays where it is.
        let stopped = template.register(cage.vertices(), &seen, None, false, &|_| 0.02, &|| true);
        assert!(stopped.cage == cage.vertices() && stopped.rigidity == RIGIDITY[1]);
        let mut lay = |anchors: Option<&Anchors>, quick: bool| {
            template.register(cage.vertices(), &seen, anchors, quick, &score, &|| false)
        };
        // The first vertex belongs somewhere else on the surface than where it lies nearest.
        let place = target.vertices[40];
        let anchors = Anchors::new(rows_of(phi.as_ref(), &[0]), &[place], 10.0);
        let first = |cage: &[Point]| {
            let at = tall_product(phi.as_ref().subrows(0, 1), matrix(cage).as_ref());
            cager_geometry::vector::distance([at[(0, 0)], at[(0, 1)], at[(0, 2)]], place)
        };
        let pulled = lay(Some(&anchors), false);
        assert!(first(&pulled.cage) < 0.3 * first(&found.cage), "{} {}", first(&pulled.cage), first(&found.cage));
    }
}
