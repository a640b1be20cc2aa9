//! Joints corrected by motion: two parts that meet at a joint turn about one point, which a single
//! pose only guesses.

use super::Rig;
use super::enclosure::{enclose, extent};
use super::placement::PlacedRig;
use super::topology::{BONES, CHEST, HEAD, LEFT_ARM, LEFT_LEG, NECK, PELVIS, QUADS, TO_RIGHT, WAIST};
use crate::Similarity;
use cager_geometry::mesh::{Point, TriMesh};
use glam::{DMat3, DVec3};

/// Rounds, since which points belong to a bone depends on the joints.
const ROUNDS: usize = 3;
/// Points of each bone and frames that are looked at, at the most.
const MAX_POINTS: usize = 400;
const MAX_FRAMES: usize = 300;
/// Points of a bone so many times as far off its rigid motion as usual bend with a joint.
const BENDING: f64 = 1.5;
/// Fewer points have no rigid motion.
const MIN_POINTS: usize = 12;
/// Turns, in radians, that count as much as the first place of a joint.
const TRUSTED_TURN: f64 = 0.1;
/// Farthest that a joint is moved, as a share of the shorter bone at it.
const MAX_SHIFT: f64 = 0.35;

/// A rig whose joints were corrected.
#[derive(Clone, Debug)]
pub struct Corrected {
    /// The rig, enclosing its template again.
    pub placed: PlacedRig,
    /// How far each joint was moved, as a fraction of the height.
    pub shifts: [f64; QUADS],
}

/// Two bones and the joint between them.
struct Meeting {
    quad: usize,
    bones: [[usize; 2]; 2],
    /// The limb bends right at the quad, so that its corners go along.
    moves_corners: bool,
}

/// Corrects the joints of a rig by frames of its template and moves their quads; joints that do not
/// turn stay. `margin` is that of the placement.
pub fn correct(rig: &Rig, template: &TriMesh, frames: &[Vec<Point>], margin: f64) -> Corrected {
    let every = frames.len().div_ceil(MAX_FRAMES).max(1);
    let frames: Vec<&Vec<Point>> = frames.iter().step_by(every).collect();
    let first: Vec<DVec3> = rig.quads.iter().map(|quad| quad.joint.into()).collect();
    let mut joints = first.clone();
    for _ in 0..ROUNDS {
        let found: Vec<(usize, DVec3)> = meetings()
            .iter()
            .filter_map(|meeting| {
                let [above, below] =
                    meeting.bones.map(|bone| motions(&points_of(bone, &joints, template), template, &frames));
                let center = center(&above?, &below?, first[meeting.quad]);
                let length = |[a, b]: [usize; 2]| first[a].distance(first[b]);
                let most = MAX_SHIFT * length(meeting.bones[0]).min(length(meeting.bones[1]));
                let shift = (center - first[meeting.quad]).clamp_length_max(most);
                Some((meeting.quad, first[meeting.quad] + shift))
            })
            .collect();
        found.into_iter().for_each(|(quad, at)| joints[quad] = at);
    }
    let mut corrected = rig.clone();
    for Meeting { quad, bones: [[above, _], [_, below]], moves_corners } in meetings() {
        let shift = joints[quad] - first[quad];
        corrected.quads[quad].joint = joints[quad].to_array();
        if moves_corners {
            let along = (first[below] - first[above]).normalize_or_zero();
            let shift = along * along.dot(shift);
            corrected.quads[quad].corners =
                corrected.quads[quad].corners.map(|corner| (DVec3::from(corner) + shift).to_array());
        }
    }
    let (rig, enclosure) = enclose(corrected, template, margin);
    let height = extent(&template.vertices, rig.up);
    let shifts = std::array::from_fn(|quad| joints[quad].distance(first[quad]) / height);
    Corrected { placed: PlacedRig { rig, enclosure }, shifts }
}

fn meetings() -> Vec<Meeting> {
    let mut all = vec![Meeting { quad: NECK, bones: [[WAIST, CHEST], [NECK, HEAD]], moves_corners: false }];
    for side in [0, TO_RIGHT] {
        for (first, trunk) in [(LEFT_ARM + side, [WAIST, CHEST]), (LEFT_LEG + side, [PELVIS, WAIST])] {
            let bone = |k: usize| [first + k, first + k + 1];
            all.push(Meeting { quad: first, bones: [trunk, bone(0)], moves_corners: false });
            all.push(Meeting { quad: first + 1, bones: [bone(0), bone(1)], moves_corners: true });
            // Feet bend at their toes, so that they hardly tell where ankles are.
            if first == LEFT_ARM + side {
                all.push(Meeting { quad: first + 2, bones: [bone(1), bone(2)], moves_corners: true });
            }
        }
    }
    all
}

/// Points around the middle of a bone, to which no other bone is nearer.
fn points_of(bone: [usize; 2], joints: &[DVec3], template: &TriMesh) -> Vec<usize> {
    let along = |[a, b]: [usize; 2], p: DVec3| {
        let way = joints[b] - joints[a];
        let share = (p - joints[a]).dot(way) / way.length_squared().max(f64::MIN_POSITIVE);
        (share, p.distance(joints[a] + way * share.clamp(0.0, 1.0)))
    };
    let ends = !BONES.iter().any(|[from, _]| *from == bone[1]);
    let within = if ends { 0.2..=9.0 } else { 0.2..=0.8 };
    let mut points: Vec<usize> = (0..template.vertices.len())
        .filter(|&v| {
            let p = DVec3::from(template.vertices[v]);
            let (share, distance) = along(bone, p);
            within.contains(&share) && BONES.iter().all(|&other| other == bone || along(other, p).1 >= distance)
        })
        .collect();
    let every = points.len().div_ceil(MAX_POINTS).max(1);
    points = points.into_iter().step_by(every).collect();
    points
}

/// The rigid motion of a bone in each frame, by its points that move rigidly; none of too few.
fn motions(points: &[usize], template: &TriMesh, frames: &[&Vec<Point>]) -> Option<Vec<Similarity>> {
    if points.len() < MIN_POINTS || frames.is_empty() {
        return None;
    }
    let fit = |kept: &[usize]| -> Vec<Similarity> {
        let pairs = |frame: &[Point]| -> Vec<_> {
            kept.iter().map(|&v| (template.vertices[v].into(), frame[v].into(), 1.0)).collect()
        };
        frames.iter().map(|frame| Similarity::between(&pairs(frame), false)).collect()
    };
    let found = fit(points);
    let off = |v: usize| -> f64 {
        let p = DVec3::from(template.vertices[v]);
        let moved = found.iter().zip(frames).map(|(m, frame)| m.apply(p).distance_squared(frame[v].into()));
        moved.sum()
    };
    let mut errors: Vec<(f64, usize)> = points.iter().map(|&v| (off(v), v)).collect();
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let most = BENDING * BENDING * errors[errors.len() / 2].0;
    let kept: Vec<usize> = errors.iter().filter(|(error, _)| *error <= most).map(|&(_, v)| v).collect();
    Some(fit(&kept))
}

/// The rest point that both motions take to about the same places; near the first one where they
/// hardly turn, or about one axis only.
fn center(above: &[Similarity], below: &[Similarity], first: DVec3) -> DVec3 {
    let mut a = DMat3::from_diagonal(DVec3::splat(above.len() as f64 * TRUSTED_TURN * TRUSTED_TURN));
    let mut b = DVec3::ZERO;
    for (above, below) in above.iter().zip(below) {
        let turn = above.rotation - below.rotation;
        a += turn.transpose() * turn;
        b += turn.transpose() * (below.translation - above.translation - turn * first);
    }
    first + a.inverse() * b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::people::tests::mannequin;
    use crate::rotation::exp;

    /// Forty points around each bone, and the bones.
    fn sticks(joints: &[DVec3]) -> (TriMesh, Vec<[usize; 2]>) {
        let (mut vertices, mut bones) = (Vec::new(), Vec::new());
        for [a, b] in BONES {
            for k in 0..40 {
                let (s, t) = (1.3 * f64::from(k), 0.7 * f64::from(k));
                let around = 0.15 * DVec3::new(s.cos(), s.sin(), t.cos());
                vertices.push((joints[a].lerp(joints[b], (f64::from(k) + 0.5) / 40.0) + around).to_array());
                bones.push([a, b]);
            }
        }
        (TriMesh { vertices, triangles: Vec::new() }, bones)
    }

    #[test]
    fn joints_that_turn_come_back_to_where_they_are_and_others_stay() {
        let rig = mannequin();
        let joints: Vec<DVec3> = rig.quads.iter().map(|quad| quad.joint.into()).collect();
        let (template, bones) = sticks(&joints);
        let about = |quad: usize, turn: DVec3| {
            let rotation = exp(turn);
            Similarity { rotation, scale: 1.0, translation: joints[quad] - rotation * joints[quad] }
        };
        let frame = |f: i32| -> Vec<Point> {
            let t = 0.4 * f64::from(f);
            let upper_arm = about(5, 0.5 * DVec3::new(t.sin(), t.cos(), (2.0 * t).sin()));
            // An elbow turns about one axis.
            let forearm = upper_arm.after(&about(6, DVec3::Z * (0.8 + 0.7 * t.sin())));
            let leg = about(9, 0.4 * DVec3::new(t.cos(), 0.2 * t.sin(), t.sin()));
            let moved = |(p, bone): (&Point, &[usize; 2])| {
                let motion = match bone {
                    [5, 6] => upper_arm,
                    [6 | 7, _] => forearm,
                    [9..12, _] => leg,
                    _ => return *p,
                };
                motion.apply((*p).into()).to_array()
            };
            template.vertices.iter().zip(&bones).map(moved).collect()
        };
        let frames: Vec<Vec<Point>> = (0..24).map(frame).collect();
        let mut off = rig.clone();
        let shifts = [(5, DVec3::Y * 0.2), (6, DVec3::X * 0.4), (9, DVec3::new(0.1, 0.2, -0.1)), (10, DVec3::Y * 0.4)];
        for (quad, shift) in shifts {
            let quad = &mut off.quads[quad];
            quad.joint = (DVec3::from(quad.joint) + shift).to_array();
            quad.corners = quad.corners.map(|corner| (DVec3::from(corner) + shift).to_array());
        }
        let Corrected { placed, shifts: told } = correct(&off, &template, &frames, 0.003);
        let from_truth = |quad: usize| DVec3::from(placed.rig.quads[quad].joint) - joints[quad];
        for quad in [5, 6, 9] {
            assert!(from_truth(quad).length() < 0.06, "{quad}: {}", from_truth(quad));
        }
        // The elbow's corners went along; the knee that is never bent stays, and so do joints of
        // the other side.
        assert!((placed.rig.quads[6].corners[0][0] - rig.quads[6].corners[0][0]).abs() < 0.2);
        assert!((from_truth(10) - DVec3::Y * 0.4).length() < 1e-3 && told[10] < 1e-4, "{}", from_truth(10));
        assert!((13..QUADS).all(|quad| told[quad] < 1e-9) && told[6] > 0.01, "{told:?}");
    }
}
