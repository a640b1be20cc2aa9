//! Gradients split into rotations and stretches; rotation vectors that go on over triangles and
//! poses.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};

use crate::deformation::gradients::Gradients;
use crate::deformation::ties::Tie;
use crate::rotation::rotation_vector;

/// Rotation and symmetric stretch of each gradient, `D = R S`.
pub(super) fn polar(gradients: &[DMat3]) -> (Vec<DMat3>, Vec<DMat3>) {
    let rotations = Gradients::rotations(gradients);
    let stretches = gradients.iter().zip(&rotations).map(|(d, r)| {
        let stretch = r.transpose() * *d;
        (stretch + stretch.transpose()) * 0.5
    });
    let stretches = stretches.collect();
    (rotations, stretches)
}

/// Where rotation vectors go on: over edges, and from part to part over ties.
pub(super) struct Ways<'a> {
    gradients: &'a Gradients,
    /// Triangles at both ends of ties, each way, sorted.
    ties: Vec<[u32; 2]>,
}

/// A triangle to be done, after another of its part (before all else), of another part, or after
/// itself in the pose before.
type Next = Reverse<(bool, u64, u32, u32)>;

impl<'a> Ways<'a> {
    pub(super) fn new(gradients: &'a Gradients, ties: &[Tie]) -> Self {
        let ends = ties.iter().filter_map(|tie| Some([tie.triangle, tie.carried?]));
        let mut ties: Vec<[u32; 2]> = ends.flat_map(|[a, b]| [[a, b], [b, a]]).collect();
        ties.sort_unstable();
        ties.dedup();
        Self { gradients, ties }
    }

    /// Axis times angle of each rotation, whole turns added so that neighbours agree, over the
    /// smallest differences first. A part begins where it is turned least against the pose before
    /// (zero for the first), or against a part that it is tied to.
    pub(super) fn unwrapped(&self, rotations: &[DMat3], before: &[DVec3]) -> Vec<DVec3> {
        let mut turned: Vec<DQuat> = rotations.iter().map(DQuat::from_mat3).collect();
        let mut turns = vec![DVec3::ZERO; rotations.len()];
        let mut done = vec![false; rotations.len()];
        let with_area = (0..rotations.len()).filter(|&t| self.gradients.has_area(t));
        let begin = |t: usize| {
            let difference = difference(turned[t], DQuat::from_scaled_axis(before[t]));
            Reverse((true, difference, t as u32, t as u32))
        };
        let mut next: BinaryHeap<Next> = with_area.map(begin).collect();
        while let Some(Reverse((_, _, t, from))) = next.pop() {
            let (t, from) = (t as usize, from as usize);
            if std::mem::replace(&mut done[t], true) {
                continue;
            }
            let to = if t == from { before[t] } else { turns[from] };
            if self.gradients.has_area(t) {
                turns[t] = nearest(rotation_vector(turned[t]), to);
            } else {
                // What has no rotation of its own hands on that of its neighbour.
                (turns[t], turned[t]) = (to, turned[from]);
            }
            for other in self.gradients.neighbours(t).filter(|&other| !done[other]) {
                let by = if self.gradients.has_area(other) { difference(turned[t], turned[other]) } else { 0 };
                next.push(Reverse((false, by, other as u32, t as u32)));
            }
            let first = self.ties.partition_point(|tie| (tie[0] as usize) < t);
            for &[_, other] in self.ties[first..].iter().take_while(|tie| tie[0] as usize == t) {
                if !done[other as usize] {
                    let by = difference(turned[t], turned[other as usize]);
                    next.push(Reverse((true, by, other, t as u32)));
                }
            }
        }
        turns
    }
}

/// In the order of the angle between two rotations.
fn difference(a: DQuat, b: DQuat) -> u64 {
    (1.0 - a.dot(b).abs()).max(0.0).to_bits()
}

/// Below this angle there is no axis.
const NO_TURN: f64 = 1e-12;

/// Of the vectors of a rotation the one nearest to another vector.
fn nearest(turn: DVec3, to: DVec3) -> DVec3 {
    let angle = turn.length();
    let whole = |angle: f64| TAU * (angle / TAU).round();
    if angle < NO_TURN {
        return turn + to.normalize_or_zero() * whole(to.length());
    }
    let axis = turn / angle;
    turn + axis * whole(to.dot(axis) - angle)
}
