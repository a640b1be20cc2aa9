//! Edge lengths and dihedral angles of a mesh, and the shape that has wanted ones (Fröhlich and
//! Botsch, Example-driven deformations based on discrete shells, 2011), by Gauss and Newton.

use std::collections::{HashMap, HashSet};
use std::f64::consts::{PI, TAU};

use cager_geometry::linalg::SparsePattern;
use faer::Mat;
use glam::DVec3;

use crate::deformation::gradients::flatness;
use crate::deformation::ties::Tie;

/// Lengths of edges and angles across them.
#[derive(Clone, Debug)]
pub(super) struct Features {
    lengths: Vec<f64>,
    angles: Vec<f64>,
}

/// Edges of a mesh, to be brought to wanted lengths and angles. Positions are those of its rows.
pub(super) struct Refinement {
    /// Ends of each edge, and one over its length at rest.
    edges: Vec<([u32; 2], f64)>,
    /// Ends of each edge between two triangles, and their third corners, the one on the left first.
    hinges: Vec<[u32; 4]>,
    rows: usize,
    pattern: Option<SparsePattern>,
}

/// Weight of a squared difference of angles, beside one of lengths over those at rest.
const ANGLE_WEIGHT: f64 = 0.1;
/// Edges shorter than this share of the diagonal are left out.
const MIN_LENGTH: f64 = 1e-9;
/// Triangles whose height over their longest edge is less have no angles to others.
const THIN: f64 = 1e-6;
/// Meshes of more vertices are not refined: the factor would need gigabytes, and a shape a minute.
pub(super) const MAX_VERTICES: usize = 100_000;
/// Wanted lengths are no less than this share of the least one among the poses.
const LEAST_SHARE: f64 = 0.05;
const MAX_STEPS: usize = 8;
const MAX_HALVINGS: usize = 6;
/// Steps end where the energy falls by less, and where the mean of its terms is below the second.
const MIN_PROGRESS: f64 = 1e-4;
const NO_ENERGY: f64 = 1e-20;
/// Added to the diagonal, over its mean.
const DAMPING: f64 = 1e-6;

impl Features {
    /// Angles less than half a turn from those of the pose before.
    pub(super) fn after(mut self, before: &Self) -> Self {
        self.angles
            .iter_mut()
            .zip(&before.angles)
            .for_each(|(angle, before)| *angle = before + wrapped(*angle - before));
        self
    }

    /// Weighted means; weights sum to one. Lengths beyond the poses stay above nothing.
    pub(super) fn mean(of: &[Self], weights: &[f64]) -> Self {
        let sum = |get: fn(&Self) -> &Vec<f64>| -> Vec<f64> {
            (0..get(&of[0]).len()).map(|k| weights.iter().zip(of).map(|(w, f)| w * get(f)[k]).sum()).collect()
        };
        let mut lengths = sum(|f| &f.lengths);
        for (k, length) in lengths.iter_mut().enumerate() {
            let least = of.iter().map(|f| f.lengths[k]).fold(f64::INFINITY, f64::min);
            *length = length.max(LEAST_SHARE * least);
        }
        Self { lengths, angles: sum(|f| &f.angles) }
    }
}

/// Between −π and π.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

impl Refinement {
    /// Of a mesh by its rows. Ties keep their lengths as edges do. None of more than
    /// [`MAX_VERTICES`].
    pub(super) fn new(at: &[DVec3], triangles: &[[u32; 3]], ties: &[Tie]) -> Option<Self> {
        if at.len() > MAX_VERTICES {
            return None;
        }
        let length = |[a, b]: [u32; 2]| at[a as usize].distance(at[b as usize]);
        let (low, high) = at.iter().fold((at[0], at[0]), |(low, high), p| (low.min(*p), high.max(*p)));
        let least = MIN_LENGTH * low.distance(high);
        let mut left: HashMap<[u32; 2], u32> = HashMap::new();
        let mut order = Vec::new();
        for &[a, b, c] in triangles {
            let thick = flatness([a, b, c].map(|v| at[v as usize])).is_some_and(|flatness| flatness > THIN);
            for (i, j, k) in [(a, b, c), (b, c, a), (c, a, b)] {
                order.push([i, j]);
                if thick {
                    left.entry([i, j]).or_insert(k);
                }
            }
        }
        let (mut edges, mut hinges) = (Vec::new(), Vec::new());
        let mut seen = HashSet::new();
        for [i, j] in order {
            if !seen.insert([i.min(j), i.max(j)]) || length([i, j]) <= least {
                continue;
            }
            edges.push(([i, j], 1.0 / length([i, j])));
            if let (Some(&p), Some(&q)) = (left.get(&[i, j]), left.get(&[j, i])) {
                hinges.push([i, j, p, q]);
            }
        }
        let mean = edges.len() as f64 / edges.iter().map(|(_, unit)| unit).sum::<f64>();
        edges.extend(ties.iter().map(|tie| (tie.rows, 1.0 / length(tie.rows).max(mean))));
        let mut places: Vec<(u32, u32)> = (0..3 * at.len() as u32).map(|k| (k, k)).collect();
        edges.iter().for_each(|(ends, _)| add_places(ends, &mut places));
        hinges.iter().for_each(|corners| add_places(corners, &mut places));
        let pattern = SparsePattern::new(3 * at.len(), &places);
        Some(Self { edges, hinges, rows: at.len(), pattern })
    }

    /// Lengths and angles of a pose.
    pub(super) fn features(&self, pose: &[DVec3]) -> Features {
        let at = |v: u32| pose[v as usize];
        Features {
            lengths: self.edges.iter().map(|([a, b], _)| at(*a).distance(at(*b))).collect(),
            angles: self.hinges.iter().map(|corners| Hinge::new(corners.map(at)).angle()).collect(),
        }
    }

    /// The pose near `pose` whose lengths and angles are nearest to the wanted ones.
    pub(super) fn refine(&self, mut pose: Vec<DVec3>, wanted: &Features) -> Vec<DVec3> {
        let Some(pattern) = &self.pattern else { return pose };
        let mut energy = self.energy(&pose, wanted);
        let least = NO_ENERGY * (self.edges.len() + self.hinges.len()) as f64;
        for _ in 0..MAX_STEPS {
            if energy <= least {
                break;
            }
            let Equations { mut values, mut pull, trace } = self.equations(&pose, wanted);
            if trace <= 0.0 {
                return pose;
            }
            values[..3 * self.rows].fill(DAMPING * (trace / (3 * self.rows) as f64));
            let Some(factor) = pattern.factor(&values) else { return pose };
            factor.solve(&mut pull);
            let mut step = 1.0;
            let mut better = None;
            for _ in 0..=MAX_HALVINGS {
                let move_by = |v: usize| DVec3::new(pull[(3 * v, 0)], pull[(3 * v + 1, 0)], pull[(3 * v + 2, 0)]);
                let moved: Vec<DVec3> = (0..self.rows).map(|v| pose[v] + step * move_by(v)).collect();
                let found = self.energy(&moved, wanted);
                if found < energy {
                    better = Some((moved, found));
                    break;
                }
                step *= 0.5;
            }
            let Some((moved, found)) = better else { break };
            let progress = energy - found;
            (pose, energy) = (moved, found);
            if progress < MIN_PROGRESS * (energy + progress) {
                break;
            }
        }
        pose
    }

    fn energy(&self, pose: &[DVec3], wanted: &Features) -> f64 {
        let found = self.features(pose);
        let lengths = self.edges.iter().zip(found.lengths.iter().zip(&wanted.lengths));
        let lengths: f64 = lengths.map(|((_, unit), (l, wanted))| ((wanted - l) * unit).powi(2)).sum();
        let angles = found.angles.iter().zip(&wanted.angles);
        lengths + angles.map(|(a, wanted)| ANGLE_WEIGHT * wrapped(wanted - a).powi(2)).sum::<f64>()
    }

    fn equations(&self, pose: &[DVec3], wanted: &Features) -> Equations {
        let at = |v: u32| pose[v as usize];
        let (values, pull) = (vec![0.0; 3 * self.rows], Mat::zeros(3 * self.rows, 1));
        let mut equations = Equations { values, pull, trace: 0.0 };
        for (([a, b], unit), wanted) in self.edges.iter().zip(&wanted.lengths) {
            let d = at(*a) - at(*b);
            let direction = d.normalize_or_zero() * *unit;
            equations.add(&[*a, *b], &[direction, -direction], (wanted - d.length()) * unit);
        }
        let weight = ANGLE_WEIGHT.sqrt();
        for (corners, wanted) in self.hinges.iter().zip(&wanted.angles) {
            let hinge = Hinge::new(corners.map(at));
            let gradient = hinge.gradient().map(|g| weight * g);
            equations.add(corners, &gradient, weight * wrapped(wanted - hinge.angle()));
        }
        equations
    }
}

/// The lower triangle of a term's square.
fn add_places(vertices: &[u32], places: &mut Vec<(u32, u32)>) {
    let rows: Vec<u32> = vertices.iter().flat_map(|&v| [3 * v, 3 * v + 1, 3 * v + 2]).collect();
    for i in 0..rows.len() {
        places.extend((0..=i).map(|j| (rows[i], rows[j])));
    }
}

/// Normal equations of least squares.
struct Equations {
    /// `JᵀJ`, in the order of the pattern's places, after its diagonal.
    values: Vec<f64>,
    /// `Jᵀr`.
    pull: Mat<f64>,
    trace: f64,
}

impl Equations {
    fn add<const N: usize>(&mut self, vertices: &[u32; N], gradient: &[DVec3; N], residual: f64) {
        for i in 0..3 * N {
            let g = gradient[i / 3][i % 3];
            self.pull[(3 * vertices[i / 3] as usize + i % 3, 0)] += g * residual;
            self.values.extend((0..=i).map(|j| g * gradient[j / 3][j % 3]));
            self.trace += g * g;
        }
    }
}

/// Two triangles at an edge from a to b, p on its left, q on its right.
struct Hinge {
    corners: [DVec3; 4],
    edge: DVec3,
    normals: [DVec3; 2],
}

impl Hinge {
    fn new(corners: [DVec3; 4]) -> Self {
        let [a, b, p, q] = corners;
        let edge = b - a;
        Self { corners, edge, normals: [edge.cross(p - a), (q - a).cross(edge)] }
    }

    /// 0 where it is flat.
    fn angle(&self) -> f64 {
        let [m, n] = self.normals;
        (m.cross(n).dot(self.edge) / self.edge.length().max(f64::MIN_POSITIVE)).atan2(m.dot(n))
    }

    /// Derivative by each corner; zero for a triangle without an area.
    fn gradient(&self) -> [DVec3; 4] {
        let ([m, n], length) = (self.normals, self.edge.length());
        let [a, _, p, q] = self.corners;
        let squares = [m.length_squared(), n.length_squared()];
        if length <= 0.0 || squares.iter().any(|s| *s <= 1e-24 * length.powi(4)) {
            return [DVec3::ZERO; 4];
        }
        let (at_p, at_q) = (-length * m / squares[0], -length * n / squares[1]);
        let share = |x: DVec3| (x - a).dot(self.edge) / (length * length);
        let (s, t) = (share(p), share(q));
        [-(1.0 - s) * at_p - (1.0 - t) * at_q, -s * at_p - t * at_q, at_p, at_q]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_of_an_angle_are_its_derivatives() {
        let corners = [[0.0, 0.1, 0.0], [1.0, 0.0, 0.2], [0.4, 0.9, 0.3], [0.6, -0.8, -0.5]].map(DVec3::from);
        let gradient = Hinge::new(corners).gradient();
        for (c, k) in (0..4).flat_map(|c| (0..3).map(move |k| (c, k))) {
            let moved = |by: f64| {
                let mut corners = corners;
                corners[c][k] += by;
                Hinge::new(corners).angle()
            };
            let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((gradient[c][k] - expected).abs() < 1e-8, "{c} {k}: {} {expected}", gradient[c][k]);
        }
    }

    #[test]
    fn an_angle_that_turns_on_is_followed_beyond_half_a_turn() {
        let corners = |angle: f64| {
            let folded = DVec3::new(0.5, -angle.cos(), angle.sin());
            [DVec3::ZERO, DVec3::X, DVec3::new(0.5, 1.0, 0.0), folded]
        };
        let of = Refinement::new(&corners(0.0), &[[0, 1, 2], [1, 0, 3]], &[]).unwrap();
        let [a, b, c] = [0.0, 2.0, 4.0].map(|angle| of.features(&corners(angle)));
        let b = b.after(&a);
        let c = c.after(&b);
        let between = Features::mean(&[a.clone(), b.clone(), c], &[0.0, 0.5, 0.5]).angles[0];
        assert!((between.abs() - 3.0).abs() < 1e-12 && (b.angles[0] - a.angles[0]).abs() < PI, "{between}");
    }

    #[test]
    fn lengths_beyond_poses_stay_above_nothing() {
        let [long, short] = [4.0, 1.0].map(|length| Features { lengths: vec![length], angles: Vec::new() });
        assert_eq!(Features::mean(&[long.clone(), short.clone()], &[0.5, 0.5]).lengths, [2.5]);
        assert_eq!(Features::mean(&[long, short], &[-1.0, 2.0]).lengths, [0.05]);
    }

    #[test]
    fn meshes_of_more_vertices_than_the_limit_are_left_unrefined() {
        let at = vec![DVec3::X; MAX_VERTICES + 1];
        assert!(Refinement::new(&at, &[[0, 1, 2]], &[]).is_none());
    }
}
