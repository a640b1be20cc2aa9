//! One value that an animation moves: its keys, and what lies between them.

use glam::{DQuat, DVec3};
use gltf::json::accessor::Type;
use gltf::json::animation::{Channel as Stored, Interpolation, Property};
use gltf::json::validation::Checked;
use gltf::json::{Animation, Node, Root};

use super::accessor::Wanted;
use super::buffers::Buffers;
use super::faults::item;
use crate::error::Fault;

/// Seconds within which two times are one.
pub(super) const NEAR: f64 = 1e-6;

pub(super) struct Channel {
    pub(super) node: usize,
    pub(super) property: Property,
    interpolation: Interpolation,
    /// Seconds, ascending; at least one.
    pub(super) times: Vec<f64>,
    /// Numbers of a value.
    width: usize,
    /// A value for each time; of cubic splines its tangent before, itself and its tangent behind.
    values: Vec<f64>,
}

impl Channel {
    /// Reads a channel; none where nothing moves. `room` is how many numbers may still be read.
    pub(super) fn read(
        animation: &Animation,
        stored: &Stored,
        buffers: &Buffers<'_>,
        room: &mut usize,
        place: &str,
    ) -> Result<Option<Self>, Fault> {
        let unknown =
            |what: &str| Fault::damaged(format!("{place}: its {what} is unknown; export the animation again"));
        let sampler = item(&animation.samplers, "sampler", stored.sampler.value())?;
        let Checked::Valid(property) = stored.target.path else { return Err(unknown("path")) };
        let Checked::Valid(interpolation) = sampler.interpolation else { return Err(unknown("interpolation")) };
        let node = stored.target.node.value();
        let width = match property {
            Property::Rotation => 4,
            Property::Translation | Property::Scale => 3,
            Property::MorphTargetWeights => targets(&buffers.root, node),
        };
        if width == 0 {
            return Ok(None);
        }
        let scalars = Wanted::animation(&[Type::Scalar]);
        let times = buffers.values::<1>(sampler.input.value(), &scalars, *room, place)?.into_flattened();
        *room -= times.len();
        if let Some(k) = times.iter().position(|time| !time.is_finite()).or_else(|| descent(&times)) {
            return Err(Fault::invalid(format!(
                "{place}: its time {k} is not after the one before; export the animation again"
            )));
        }
        let output = sampler.output.value();
        let (vectors, turns) = (Wanted::animation(&[Type::Vec3]), Wanted::animation(&[Type::Vec4]));
        let values = match property {
            Property::MorphTargetWeights => buffers.values::<1>(output, &scalars, *room, place)?.into_flattened(),
            Property::Rotation => buffers.values::<4>(output, &turns, *room / 4, place)?.into_flattened(),
            _ => buffers.values::<3>(output, &vectors, *room / 3, place)?.into_flattened(),
        };
        *room -= values.len();
        if let Some(k) = values.iter().position(|value| !value.is_finite()) {
            return Err(Fault::invalid(format!("{place}: its value {k} is not finite; export the animation again")));
        }
        let each = if interpolation == Interpolation::CubicSpline { 3 * width } else { width };
        if times.is_empty() || times.len().checked_mul(each) != Some(values.len()) {
            return Err(Fault::damaged(format!(
                "{place}: has {} values for {} times of {each} each; export the animation again",
                values.len(),
                times.len()
            )));
        }
        Ok(Some(Self { node, property, interpolation, times, width, values }))
    }

    /// Whether it does not stay until its next key.
    pub(super) fn moves_between_keys(&self) -> bool {
        let is_still = || self.values.chunks(self.width).all(|value| *value == self.values[..self.width]);
        self.interpolation != Interpolation::Step && self.times.len() > 1 && !is_still()
    }

    /// The scale of a mesh that is shown, where this one hides it by scales of 0.
    pub(super) fn switched(&self) -> Option<&[f64]> {
        let is_switch = self.property == Property::Scale && self.interpolation == Interpolation::Step;
        let (mut shown, mut hidden) = (None, false);
        for value in self.values.chunks(self.width).filter(|_| is_switch) {
            if value == [0.0; 3] {
                hidden = true;
            } else if *shown.get_or_insert(value) != value {
                return None;
            }
        }
        shown.filter(|_| hidden)
    }

    /// Whether all of it is 0 at a time.
    pub(super) fn is_zero(&self, time: f64) -> bool {
        self.value(time).iter().all(|&x| x == 0.0)
    }

    /// Puts the value at a time into a node.
    pub(super) fn apply(&self, time: f64, node: &mut Node) {
        self.put(&self.value(time), node);
    }

    /// Puts a value into a node.
    pub(super) fn put(&self, value: &[f64], node: &mut Node) {
        match self.property {
            Property::MorphTargetWeights => node.weights = Some(value.iter().map(|&x| x as f32).collect()),
            Property::Rotation => {
                let turn = DQuat::from_slice(value);
                let turn = if turn.length() > 0.0 { turn.normalize() } else { DQuat::IDENTITY };
                node.rotation = Some(gltf::json::scene::UnitQuaternion(turn.as_quat().to_array()));
            }
            Property::Translation => node.translation = Some(DVec3::from_slice(value).as_vec3().to_array()),
            Property::Scale => node.scale = Some(DVec3::from_slice(value).as_vec3().to_array()),
        }
    }

    /// The value at a time; before the first and behind the last, theirs.
    fn value(&self, time: f64) -> Vec<f64> {
        let last = self.times.len() - 1;
        let before = self.times.partition_point(|&key| key <= time + NEAR).saturating_sub(1);
        let step = self.times[(before + 1).min(last)] - self.times[before];
        let share =
            if time > self.times[before] + NEAR && step > 0.0 { (time - self.times[before]) / step } else { 0.0 };
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let part = |key: usize, part: usize| {
            let first = if cubic { 3 * key + part } else { key } * self.width;
            &self.values[first..first + self.width]
        };
        let (a, b) = (part(before, 1), part((before + 1).min(last), 1));
        if share == 0.0 || self.interpolation == Interpolation::Step {
            return a.to_vec();
        }
        if self.property == Property::Rotation && !cubic {
            return DQuat::from_slice(a).slerp(DQuat::from_slice(b), share).to_array().to_vec();
        }
        let mixed = |k: usize| {
            if !cubic {
                return a[k] + share * (b[k] - a[k]);
            }
            // The cubic Hermite spline; tangents are stored for a step of one second.
            let (t, t2, t3) = (share, share * share, share * share * share);
            (2.0 * t3 - 3.0 * t2 + 1.0) * a[k]
                + step * (t3 - 2.0 * t2 + t) * part(before, 2)[k]
                + (3.0 * t2 - 2.0 * t3) * b[k]
                + step * (t3 - t2) * part(before + 1, 0)[k]
        };
        (0..self.width).map(mixed).collect()
    }
}

/// How many morph targets the mesh of a node has.
fn targets(root: &Root, node: usize) -> usize {
    let mesh = root.nodes.get(node).and_then(|node| root.meshes.get(node.mesh?.value()));
    let all = mesh.into_iter().flat_map(|mesh| &mesh.primitives);
    all.map(|primitive| primitive.targets.as_ref().map_or(0, Vec::len)).max().unwrap_or(0)
}

fn descent(times: &[f64]) -> Option<usize> {
    (1..times.len()).find(|&k| times[k] <= times[k - 1])
}
