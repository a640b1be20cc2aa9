//! Placing a rig in a template in a T- or A-pose, by landmarks of its cross-sections, relative to
//! its height.

use super::landmarks::{Arm, Landmarks, Leg};
use super::sections::{Body, Extent};
use super::topology::{LEFT_ARM, LEFT_LEG, TO_RIGHT};
use super::{Enclosure, QUADS, Quad, Rig, RigError, enclose};
use crate::points::{range, vectors};
use cager_geometry::mesh::{Point, TriMesh};
use glam::{DMat3, DVec3};

/// How a template stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacementOptions {
    /// From the feet to the head.
    pub up: Point,
    /// To where the person looks; told by the feet where it is not given.
    pub forward: Option<Point>,
    /// Distance between template and cage where it can be kept, over the height.
    pub margin: f64,
}

impl Default for PlacementOptions {
    fn default() -> Self {
        Self { up: [0.0, 1.0, 0.0], forward: None, margin: 0.003 }
    }
}

/// A rig and how well it encloses its template.
#[derive(Clone, Debug)]
pub struct PlacedRig {
    /// The rig.
    pub rig: Rig,
    /// What its cage leaves outside.
    pub enclosure: Enclosure,
}

/// Places a rig in a template.
///
/// # Errors
/// Where the template is no surface, or arms, legs or head cannot be told from the trunk.
pub fn place(template: &TriMesh, options: &PlacementOptions) -> Result<PlacedRig, RigError> {
    let (points, faces) = (template.vertices.len(), template.triangles.len());
    if points < 100 || faces < 100 || template.vertices.as_flattened().iter().any(|x| !x.is_finite()) {
        return Err(RigError::NoSurface { points, faces });
    }
    let to_world = axes(template, options)?;
    let own: Vec<Point> =
        template.vertices.iter().map(|&p| (to_world.transpose() * DVec3::from(p)).to_array()).collect();
    let body = Body::new(&own, &template.triangles);
    let rig = first_rig(&Landmarks::find(&body)?);
    let rig = taken_by(&rig, to_world);
    let (rig, enclosure) = enclose(rig, template, options.margin);
    Ok(PlacedRig { rig, enclosure })
}

/// Left, up and forward as columns.
fn axes(template: &TriMesh, options: &PlacementOptions) -> Result<DMat3, RigError> {
    let up = DVec3::from(options.up).try_normalize().ok_or(RigError::BadNumbers)?;
    if let Some(forward) = options.forward {
        let forward = DVec3::from(forward).reject_from_normalized(up).try_normalize().ok_or(RigError::ForwardIsUp)?;
        return Ok(DMat3::from_cols(up.cross(forward), up, forward));
    }
    let points = vectors(&template.vertices);
    let extent = |a: DVec3| range(points.iter().map(|p| p.dot(a)));
    let level = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis.reject_from_normalized(up));
    let spans = level.map(|axis| axis.try_normalize().map_or(0.0, |axis| extent(axis).1 - extent(axis).0));
    let widest = (0..3).max_by(|&a, &b| spans[a].total_cmp(&spans[b])).unwrap_or(0);
    let across = level[widest].try_normalize().ok_or(RigError::BadNumbers)?;
    let (low, high) = extent(up);
    // Feet reach forward of the ankles.
    let ahead = across.cross(up);
    let middle = |from: f64, to: f64| {
        let inside = points.iter().filter(|p| (from..=to).contains(&((p.dot(up) - low) / (high - low))));
        let (low, high) = range(inside.map(|p| p.dot(ahead)));
        0.5 * (low + high)
    };
    let forward = if middle(0.0, 0.03) - middle(0.06, 0.12) >= 0.0 { ahead } else { -ahead };
    Ok(DMat3::from_cols(up.cross(forward), up, forward))
}

/// The rig in the template's coordinates.
fn taken_by(rig: &Rig, to_world: DMat3) -> Rig {
    let at = |p: Point| (to_world * DVec3::from(p)).to_array();
    let quad = |q: &Quad| Quad { joint: at(q.joint), corners: q.corners.map(at) };
    Rig {
        quads: rig.quads.iter().map(quad).collect(),
        crotch: rig.crotch.map(at),
        up: to_world.y_axis.to_array(),
        forward: to_world.z_axis.to_array(),
    }
}

/// What quads stand off the surface, as a fraction of the height.
const AROUND: f64 = 0.012;

/// The rig by landmarks alone, left along x.
fn first_rig(marks: &Landmarks) -> Rig {
    let h = marks.height;
    let trunk = |part: f64| marks.crotch + part * (marks.armpit - marks.crotch);
    let level = |y: f64, box_: Extent| {
        let (low, high) = (box_.low - AROUND * h, box_.high + AROUND * h);
        [[high.x, y, high.z], [low.x, y, high.z], [low.x, y, low.z], [high.x, y, low.z]]
    };
    let middle = |y: f64, box_: Extent| [marks.middle, y, box_.center().z];
    let (pelvis, waist) = (marks.trunk(marks.crotch, trunk(0.40)), marks.trunk(trunk(0.42), trunk(0.72)));
    let chest = marks.trunk(trunk(0.74), marks.armpit - 0.002 * h);
    let neck = marks.trunk(marks.neck - 0.012 * h, marks.neck + 0.012 * h);
    let head = marks.trunk(marks.neck + 0.01 * h, marks.top);
    let mut quads = vec![Quad { joint: [0.0; 3], corners: [[0.0; 3]; 4] }; QUADS];
    quads[0] = Quad { joint: middle(trunk(0.30), pelvis), corners: level(trunk(0.21), pelvis) };
    quads[1] = Quad { joint: middle(trunk(0.58), waist), corners: level(trunk(0.60), waist) };
    quads[2] = Quad { joint: middle(trunk(0.88), chest), corners: level(trunk(0.90), chest) };
    quads[3] =
        Quad { joint: middle(marks.neck - 0.015 * h, neck), corners: level(marks.neck + 0.005 * h, neck.and(head)) };
    quads[4] = Quad { joint: middle(marks.top - 0.012 * h, head), corners: level(marks.top + 0.02 * h, head) };
    for (side, sign) in [(0, 1.0), (TO_RIGHT, -1.0)] {
        let half = usize::from(side > 0);
        quads[LEFT_ARM + side..LEFT_ARM + side + 4].copy_from_slice(&arm(&marks.arms[half], sign, h));
        quads[LEFT_LEG + side..LEFT_LEG + side + 4].copy_from_slice(&leg(&marks.legs[half], sign, marks, h));
    }
    let thighs = marks.trunk(marks.crotch, marks.crotch + 0.03 * h);
    let y = marks.crotch - 0.004 * h;
    let crotch = [thighs.high.z + 0.5 * AROUND * h, thighs.low.z - 0.5 * AROUND * h].map(|z| [marks.middle, y, z]);
    Rig { quads, crotch, up: [0.0, 1.0, 0.0], forward: [0.0, 0.0, 1.0] }
}

fn arm(arm: &Arm, sign: f64, h: f64) -> [Quad; 4] {
    let [shoulder, elbow, wrist, hand] = arm.joints;
    let along = |v: DVec3| v.normalize_or(DVec3::X * sign);
    let directions = [
        along(along(elbow - shoulder) + DVec3::X * sign),
        along(along(elbow - shoulder) + along(wrist - elbow)),
        along(along(wrist - elbow) + along(arm.tip - wrist)),
        along(arm.tip - wrist),
    ];
    let mut up = DVec3::Y;
    let mut quads = [Quad { joint: [0.0; 3], corners: [[0.0; 3]; 4] }; 4];
    for k in 0..4 {
        let direction = directions[k];
        // Carried along the arm, so that the quads do not turn about it.
        up = up.reject_from_normalized(direction).try_normalize().unwrap_or(up);
        let front = sign * direction.cross(up);
        let frame = |p: DVec3| DVec3::new(p.dot(direction), p.dot(up), p.dot(front));
        let box_ = Extent::of(arm.around[k].iter().map(|&p| frame(p)));
        let box_ = if box_.is_none() { Extent::of([frame(arm.joints[k])]) } else { box_ };
        let at = if k == 3 { box_.high.x + AROUND * h } else { box_.center().x };
        let (low, high) = (box_.low - AROUND * h, box_.high + AROUND * h);
        let corner = |y: f64, z: f64| (direction * at + up * y + front * z).to_array();
        quads[k] = Quad {
            joint: [shoulder, elbow, wrist, hand][k].to_array(),
            corners: [corner(low.y, high.z), corner(low.y, low.z), corner(high.y, low.z), corner(high.y, high.z)],
        };
    }
    quads
}

fn leg(leg: &Leg, sign: f64, marks: &Landmarks, h: f64) -> [Quad; 4] {
    let [hip, knee, ankle, toe] = leg.joints;
    let [thigh, around_knee, shin, foot] = leg.extents;
    let margin = AROUND * h;
    let sides = |box_: Extent| {
        let (inner, outer) = if sign > 0.0 { (box_.low.x, box_.high.x) } else { (box_.high.x, box_.low.x) };
        let inner = (sign * (inner - marks.middle) - margin).max(0.002 * h);
        [marks.middle + sign * inner, outer + sign * margin]
    };
    let across = |y: f64, box_: Extent| {
        let [inner, outer] = sides(box_);
        let (back, front) = (box_.low.z - margin, box_.high.z + margin);
        [[outer, y, front], [inner, y, front], [inner, y, back], [outer, y, back]]
    };
    let [inner, outer] = sides(foot.and(shin));
    let bottom = foot.low.y - 0.7 * margin;
    let (front, back) = (shin.high.z + margin, foot.low.z - margin);
    let (raised, tip) = (ankle.y + 0.045 * h, foot.high.z + margin);
    let toes = bottom + 0.062 * h;
    [
        Quad { joint: hip.to_array(), corners: across(marks.crotch - 0.042 * h, thigh) },
        Quad { joint: knee.to_array(), corners: across(knee.y, around_knee) },
        Quad {
            joint: ankle.to_array(),
            corners: [[outer, raised, front], [inner, raised, front], [inner, bottom, back], [outer, bottom, back]],
        },
        Quad {
            joint: toe.to_array(),
            corners: [[outer, toes, tip], [inner, toes, tip], [inner, bottom, tip], [outer, bottom, tip]],
        },
    ]
}
