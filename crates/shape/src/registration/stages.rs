//! A template laid onto another shape than its own: stiff and far-seeing at first, each stage's shape the next one's rest.

use cager_geometry::vector::Point;
use faer::MatRef;

use super::anchors::Anchors;
use super::closeness::MeasuredSurface;
use super::fit::FitOptions;
use super::matching::KnownMatches;
use super::observation::Observation;
use super::target::Target;
use super::template::Template;
use crate::points::matrix;

/// How a template is laid onto another shape.
#[derive(Clone, Copy, Debug)]
pub struct StageOptions {
    /// Stages.
    pub stages: usize,
    /// Iterations of each, at the most.
    pub iterations: usize,
    /// Weight of rigidity in the first stage and in the last.
    pub rigidity: [f64; 2],
    /// Distance at which a match counts a quarter, as a share of the diagonal: where the first stage begins and the last one ends.
    pub reach: [f64; 2],
    /// A score above this, in the unit of [`MeasuredSurface::distance`](crate::registration::MeasuredSurface::distance), is tried again down to the rigidity `softest`, and
    /// the better one is kept; but not where it is above 4 %, for then nothing was reached.
    pub good_score: f64,
    /// See `good_score`.
    pub softest: f64,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self {
            stages: 8,
            iterations: 8,
            rigidity: [1e-1, 3e-4],
            reach: [0.15, 0.006],
            good_score: 0.0035,
            softest: 1e-5,
        }
    }
}

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

/// Scores above this are almost all of distances that are [`MeasuredSurface::MAX_DISTANCE`](crate::registration::MeasuredSurface::MAX_DISTANCE) or more: softer is no use.
const HOPELESS: f64 = 0.8 * MeasuredSurface::MAX_DISTANCE;
/// What a normal counts in matches, as a share of the diagonal: in the first stage, and each stage's over that of the one before.
const FIRST_NORMAL_LENGTH: f64 = 0.1;
const NORMAL_DECAY: f64 = 0.8;
/// Rigidity in the last iteration of a stage over that in its first.
const SOFTENING: f64 = 0.5;
/// Holds what nothing else determines.
const HOLD: f64 = 1e-6;
/// Stages at the end in which anchors do not pull: they may be rough.
const FREE_STAGES: usize = 2;

impl Template {
    /// Lays the template, from where `cage` has it, onto another shape (coarse to fine as in Amberg et al. 2007, in the space of the cage), some of its points
    /// to where they belong, if that is known. `score` tells how far a cage leaves it from there. Once `stopped`, nothing better is looked for. Runs on the current rayon pool; the result does not depend on
    /// it. The template is as before afterwards.
    ///
    /// # Panics
    /// Where there are no observed points.
    pub fn register(
        &mut self,
        cage: &[Point],
        observation: &Observation,
        anchors: Option<&Anchors>,
        options: &StageOptions,
        score: &dyn Fn(&[Point]) -> f64,
        stopped: &dyn Fn() -> bool,
    ) -> Registration {
        let mut to = |softest: f64| {
            let cage = self.register_to(cage, observation, anchors, options, softest, stopped);
            let score = score(&cage);
            Registration { cage, score, rigidity: softest }
        };
        let first = to(options.rigidity[1]);
        if first.score <= options.good_score || first.rigidity <= options.softest {
            return first;
        }
        if first.score > HOPELESS || stopped() {
            return first;
        }
        let second = to(options.softest);
        if first.score <= second.score || second.score.is_nan() { first } else { second }
    }

    fn register_to(
        &mut self,
        cage: &[Point],
        observation: &Observation,
        anchors: Option<&Anchors>,
        options: &StageOptions,
        softest: f64,
        stopped: &dyn Fn() -> bool,
    ) -> Vec<Point> {
        let at_rest = self.rigidity.rest();
        let last = options.stages.saturating_sub(1).max(1) as f64;
        let narrowing = (options.reach[1] / options.reach[0]).powf(1.0 / options.stages.max(1) as f64);
        let mut known = KnownMatches::none(self.samples.len(), observation.points.len());
        let mut moved = cage.to_vec();
        for stage in 0..options.stages {
            if stopped() {
                break;
            }
            let rigidity = options.rigidity[0] * (softest / options.rigidity[0]).powf(stage as f64 / last);
            let reach = options.reach[0] * narrowing.powi(stage as i32);
            let normal_length = FIRST_NORMAL_LENGTH * NORMAL_DECAY.powi(stage as i32) * self.diagonal;
            let target = Target::with_normal_length(observation, normal_length);
            let fit = FitOptions {
                iterations: options.iterations,
                rigidity: [rigidity, SOFTENING * rigidity],
                reach: [reach, narrowing * reach],
                hold: HOLD,
                ..FitOptions::NEAR
            };
            let anchors = anchors.filter(|_| stage + FREE_STAGES < options.stages);
            let (found, in_reach) = self.fit_anchored(&target, &moved, cage, &fit, anchors, &mut known);
            moved = found;
            if !in_reach {
                // Later stages see less far.
                break;
            }
            self.rest_in(matrix(&moved).as_ref());
        }
        self.rigidity.restore(&at_rest);
        moved
    }

    /// Takes the shape in a cage for the one at rest.
    fn rest_in(&mut self, cage: MatRef<'_, f64>) {
        let positions = self.rigidity.positions(cage);
        self.rigidity.set_rest(&positions);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::observation::ObservationOptions;
    use crate::registration::template::TemplateOptions;
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
        let mut template = Template::new(&rest, &cage, phi.as_ref(), &TemplateOptions::default()).unwrap();
        let draw = ObservationOptions::default();
        let seen = Observation::of_mesh(&target.vertices, &target.triangles, &draw).unwrap().0;
        let surface = MeasuredSurface::of_mesh(&target.vertices, &target.triangles, template.diagonal());
        let score = |cage: &[Point]| {
            let laid = tall_product(phi.as_ref(), matrix(cage).as_ref());
            let laid: Vec<Point> = (0..laid.nrows()).map(|i| [0, 1, 2].map(|k| laid[(i, k)])).collect();
            surface.distance(&seen, &laid, &rest.triangles, 0)
        };
        let before = score(cage.vertices());
        let mut lay = |anchors: Option<&Anchors>, options: &StageOptions| {
            template.register(cage.vertices(), &seen, anchors, options, &score, &|| false)
        };
        let found = lay(None, &StageOptions::default());
        assert!(found.score < 0.004 && found.score < 0.2 * before, "{} after {before}", found.score);
        let again = lay(None, &StageOptions::default());
        assert!(found.cage == again.cage && found.score == again.score);
        let nothing = lay(None, &StageOptions { stages: 0, ..StageOptions::default() });
        assert_eq!(nothing.cage, cage.vertices());
        // A surface out of reach is left at once, and not tried again.
        let far = |points: &[Point]| points.iter().map(|p| p.map(|x| 0.02 * x + 90.0)).collect();
        let far = Observation { points: far(&seen.points), normals: seen.normals.clone() };
        let unreached = template.register(cage.vertices(), &far, None, &StageOptions::default(), &|_| 0.05, &|| false);
        assert!(unreached.cage == cage.vertices() && unreached.rigidity == StageOptions::default().rigidity[1]);
        // One that is stopped at once stays where it is.
        let stopped = template.register(cage.vertices(), &seen, None, &StageOptions::default(), &|_| 0.02, &|| true);
        assert!(stopped.cage == cage.vertices() && stopped.rigidity == StageOptions::default().rigidity[1]);
        let mut lay = |anchors: Option<&Anchors>, options: &StageOptions| {
            template.register(cage.vertices(), &seen, anchors, options, &score, &|| false)
        };
        // The first vertex belongs somewhere else on the surface than where it lies nearest.
        let place = target.vertices[40];
        let anchors = Anchors::new(rows_of(phi.as_ref(), &[0]), &[place], 10.0);
        let first = |cage: &[Point]| {
            let at = tall_product(phi.as_ref().subrows(0, 1), matrix(cage).as_ref());
            cager_geometry::vector::distance([at[(0, 0)], at[(0, 1)], at[(0, 2)]], place)
        };
        let pulled = lay(Some(&anchors), &StageOptions::default());
        assert!(first(&pulled.cage) < 0.3 * first(&found.cage), "{} {}", first(&pulled.cage), first(&found.cage));
    }
}
