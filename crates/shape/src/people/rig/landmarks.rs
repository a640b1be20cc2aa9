//! Where limbs and joints are, by cross-sections: left along x, up along y, forward along z.

use super::RigError;
use super::sections::{Body, Extent};
use glam::DVec3;

/// Levels of horizontal sections.
const LEVELS: usize = 120;

/// An arm, from its shoulder to its hand.
pub(super) struct Arm {
    /// Shoulder, elbow, wrist and middle of the hand.
    pub(super) joints: [DVec3; 4],
    /// The points of the surface around the shoulder, elbow, wrist and over all of the hand.
    pub(super) around: [Vec<DVec3>; 4],
    /// The tip of the hand.
    pub(super) tip: DVec3,
}

/// A leg, by horizontal sections.
pub(super) struct Leg {
    /// Hip, knee, ankle and toes.
    pub(super) joints: [DVec3; 4],
    /// Extent around the upper thigh, the knee and the shin above the ankle, and of the foot.
    pub(super) extents: [Extent; 4],
}

/// What was found of a person.
pub(super) struct Landmarks {
    pub(super) height: f64,
    pub(super) top: f64,
    pub(super) middle: f64,
    /// Heights of the crotch, the armpits and the neck where it is narrowest.
    pub(super) crotch: f64,
    pub(super) armpit: f64,
    pub(super) neck: f64,
    /// Left, then right.
    pub(super) arms: [Arm; 2],
    pub(super) legs: [Leg; 2],
    levels: Vec<Level>,
}

/// A horizontal section.
struct Level {
    y: f64,
    parts: Vec<Extent>,
}

impl Level {
    /// The part around the middle: the trunk, with the arms where they are one with it.
    fn trunk(&self, middle: f64) -> Option<Extent> {
        let across = self.parts.iter().filter(|part| part.low.x < middle && part.high.x > middle);
        across.copied().reduce(Extent::and)
    }

    /// The largest part on one side.
    fn leg(&self, middle: f64, sign: f64) -> Option<Extent> {
        let on_side = self.parts.iter().filter(|part| (part.center().x - middle) * sign > 0.0);
        on_side.copied().max_by(|a, b| area(a).total_cmp(&area(b)))
    }
}

fn area(extent: &Extent) -> f64 {
    extent.size().x * extent.size().z
}

impl Landmarks {
    pub(super) fn find(body: &Body) -> Result<Self, RigError> {
        let whole = Extent::of(body.points.iter().copied());
        let (bottom, top, height) = (whole.low.y, whole.high.y, whole.size().y);
        let middle = whole.center().x;
        let level = |k: usize| {
            let y = bottom + height * (k as f64 + 0.5) / LEVELS as f64;
            let parts = body.section(DVec3::Y * y, DVec3::Y).into_iter().map(Extent::of);
            // Eyes, teeth and the like are no parts of the trunk or the legs.
            Level { y, parts: parts.filter(|part| part.size().max_element() > 0.02 * height).collect() }
        };
        let levels: Vec<Level> = (0..LEVELS).map(level).collect();
        let spanned = |level: &Level| level.trunk(middle).is_some_and(|part| part.size().x > 0.08 * height);
        let low = LEVELS / 5;
        let crotch = (low..LEVELS * 2 / 3)
            .find(|&k| spanned(&levels[k]) && spanned(&levels[k + 1]) && spanned(&levels[k + 2]))
            .filter(|&k| k > low)
            .ok_or(RigError::NoLimb("legs"))?;
        // Where the trunk and the arms become one, its width leaps.
        let width = |k: usize| levels[k].trunk(middle).map_or(0.0, |part| part.size().x);
        let armpit = (crotch + LEVELS / 8..LEVELS - LEVELS / 10)
            .find(|&k| width(k) > 1.22 * width(k - 1).min(width(k - 2)))
            .map(|k| k - 1)
            .ok_or(RigError::NoLimb("arms"))?;
        let neck = (armpit + 3..LEVELS - LEVELS * 6 / 100)
            .min_by(|&a, &b| width(a).total_cmp(&width(b)))
            .ok_or(RigError::NoLimb("head"))?;
        let chest = levels[armpit - 1].trunk(middle).unwrap_or(whole);
        let found = Self {
            height,
            top,
            middle,
            crotch: levels[crotch].y,
            armpit: levels[armpit].y,
            neck: levels[neck].y,
            arms: [
                Self::arm(body, &whole, chest, levels[armpit].y, 1.0)?,
                Self::arm(body, &whole, chest, levels[armpit].y, -1.0)?,
            ],
            legs: [1.0, -1.0].map(|sign| Self::leg(body, &levels, middle, levels[crotch].y, bottom, sign)),
            levels,
        };
        Ok(found)
    }

    /// Extent of the trunk between two heights.
    pub(super) fn trunk(&self, from: f64, to: f64) -> Extent {
        let between = self.levels.iter().filter(|level| level.y >= from && level.y <= to);
        let all = between.filter_map(|level| level.trunk(self.middle)).reduce(Extent::and);
        let nearest = || {
            let near = self.levels.iter().filter(|level| level.trunk(self.middle).is_some());
            near.min_by(|a, b| (a.y - from).abs().total_cmp(&(b.y - from).abs()))
                .and_then(|level| level.trunk(self.middle))
        };
        all.or_else(nearest).unwrap_or(Extent { low: DVec3::ZERO, high: DVec3::ZERO })
    }

    fn arm(body: &Body, whole: &Extent, chest: Extent, armpit: f64, sign: f64) -> Result<Arm, RigError> {
        let height = whole.size().y;
        let none = RigError::NoLimb("an arm");
        let out = |p: DVec3| sign * (p.x - chest.center().x);
        let half_width = 0.5 * chest.size().x;
        let tip = (0..body.points.len())
            .filter(|&v| body.points[v].y > whole.low.y + 0.25 * height)
            .max_by(|&a, &b| out(body.points[a]).total_cmp(&out(body.points[b])))
            .ok_or(none.clone())?;
        if out(body.points[tip]) < 1.3 * half_width {
            return Err(none);
        }
        // The ring of the shoulder: the highest part of an upright section beside the chest.
        let beside = DVec3::new(chest.center().x + sign * (half_width + 0.01 * height), armpit, chest.center().z);
        let ring = |through: DVec3, normal: DVec3| {
            let parts = body.section(through, normal).into_iter().filter(|part| part.len() > 4);
            parts.max_by(|a, b| {
                Extent::of(a.iter().copied()).center().y.total_cmp(&Extent::of(b.iter().copied()).center().y)
            })
        };
        let upright = ring(beside, DVec3::X * sign).ok_or(none.clone())?;
        let shoulder_center = Extent::of(upright.iter().copied()).center();
        let distance = body.distances(tip);
        // Positions along the arm: the middle of what is equally far from the tip along the
        // surface.
        let width = 0.012 * height;
        let at = |d: f64| -> Vec<DVec3> {
            let near = (0..body.points.len())
                .filter(|&v| (distance[v] - d).abs() < width && out(body.points[v]) > 0.8 * half_width);
            near.map(|v| body.points[v]).collect()
        };
        let center = |d: f64| {
            let around = at(d);
            (!around.is_empty()).then(|| Extent::of(around).center())
        };
        let steps = 80;
        let mut path = Vec::new();
        for k in 1..steps {
            let d = 0.9 * height * f64::from(k) / f64::from(steps);
            let Some(c) = center(d) else { continue };
            if out(c) < half_width + 0.02 * height {
                break;
            }
            path.push((d, c));
        }
        let (last_d, last_c) = *path.last().ok_or(none.clone())?;
        let upper = path.iter().rev().find(|(d, _)| last_d - d > 0.06 * height).map_or(body.points[tip], |&(_, c)| c);
        let direction = (upper - last_c).normalize_or(DVec3::X * sign);
        let normal = (direction + DVec3::X * sign).normalize();
        let shoulder_ring = ring(beside, normal).unwrap_or(upright);
        let joint = DVec3::new(
            chest.center().x + sign * 0.85 * half_width,
            shoulder_center.y + 0.4 * (shoulder_center.y - last_c.y).max(0.0),
            shoulder_center.z,
        );
        let length = last_d + last_c.distance(joint);
        let along =
            |d: f64| path.iter().min_by(|a, b| (a.0 - d).abs().total_cmp(&(b.0 - d).abs())).map_or(joint, |&(_, c)| c);
        let girth = |d: f64| {
            let (c, around) = (along(d), at(d));
            around.iter().map(|p| p.distance(c)).sum::<f64>() / around.len().max(1) as f64
        };
        let candidates = (0..=12).map(|k| (0.20 + 0.01 * f64::from(k)) * length);
        let wrist = candidates.min_by(|&a, &b| girth(a).total_cmp(&girth(b))).unwrap_or(0.26 * length);
        let elbow = wrist + 0.47 * (length - wrist);
        let hand = (0..body.points.len()).filter(|&v| distance[v] < wrist).map(|v| body.points[v]).collect();
        let reach = |d: f64| {
            let mut all = at(d - width);
            all.extend(at(d + width));
            all
        };
        Ok(Arm {
            joints: [joint, along(elbow), along(wrist), along(0.3 * wrist)],
            around: [shoulder_ring, reach(elbow), reach(wrist), hand],
            tip: body.points[tip],
        })
    }

    fn leg(body: &Body, levels: &[Level], middle: f64, crotch: f64, bottom: f64, sign: f64) -> Leg {
        let height = levels.last().map_or(1.0, |level| level.y - bottom);
        let between = |from: f64, to: f64| {
            let inside = levels.iter().filter(|level| level.y >= from && level.y <= to);
            inside.filter_map(|level| level.leg(middle, sign)).reduce(Extent::and)
        };
        let at = |y: f64| {
            between(y - 0.012 * height, y + 0.012 * height).unwrap_or(Extent { low: DVec3::Y * y, high: DVec3::Y * y })
        };
        let ankle = bottom + 0.054 * height;
        let hip = crotch + 0.036 * height;
        let knee = 0.5 * (ankle + hip);
        let thigh =
            between(crotch - 0.09 * height, crotch - 0.01 * height).unwrap_or_else(|| at(crotch - 0.03 * height));
        let around_knee = between(knee - 0.05 * height, knee + 0.05 * height).unwrap_or_else(|| at(knee));
        let shin = between(bottom + 0.09 * height, bottom + 0.12 * height).unwrap_or_else(|| at(ankle));
        let low = body.points.iter().filter(|p| p.y < bottom + 0.045 * height && (p.x - middle) * sign > 0.0);
        let foot = Extent::of(low.copied());
        let foot = if foot.is_none() { shin } else { foot };
        let joint = |extent: Extent, y: f64| DVec3::new(extent.center().x, y, extent.center().z);
        let ankle_joint = joint(shin, ankle);
        let toe_z = ankle_joint.z + 0.62 * (foot.high.z - ankle_joint.z);
        let top = at(crotch - 0.02 * height);
        Leg {
            joints: [
                DVec3::new(middle + 0.9 * (top.center().x - middle), hip, top.center().z),
                joint(at(knee), knee),
                ankle_joint,
                DVec3::new(foot.center().x, bottom + 0.015 * height, toe_z),
            ],
            extents: [thigh, around_knee, shin, foot],
        }
    }
}
