//! A skeleton and its animation: where joints are at a time, and how strong shapes.

use std::collections::HashMap;

use glam::{DAffine3, DQuat, DVec3};

use super::Arrays;
use crate::error::Fault;
use crate::scene::{affine, damaged, union};
use crate::usd::layer::{Kind, Layer};

/// Joints of a skeleton and shapes of an animation, bytes of the path of one and names in it;
/// programs write far fewer.
pub(super) const MOST_JOINTS: usize = 1 << 16;
const LONGEST_PATH: usize = 4096;
const DEEPEST: usize = 256;

pub(super) struct Rig {
    /// The number of each joint, by its path.
    pub(super) joints: HashMap<String, usize>,
    /// Joints above others come before them.
    parents: Vec<Option<usize>>,
    /// From the space of the skeleton to that of each joint as the mesh was bound to it.
    unbinds: Vec<DAffine3>,
    rests: Vec<DAffine3>,
    animation: Animation,
    /// The time of the last pose, and by what each joint moves what is bound to it.
    pose: Option<(f64, Vec<DAffine3>)>,
}

/// A SkelAnimation.
#[derive(Default)]
struct Animation {
    /// Which of its joints each joint of the skeleton is.
    joints: Vec<Option<usize>>,
    count: usize,
    translations: Arrays,
    rotations: Arrays,
    scales: Arrays,
    /// Which weight a shape has, by its name.
    shapes: HashMap<String, usize>,
    weights: Arrays,
}

impl Rig {
    pub(super) fn read(layer: &mut Layer<'_>, skeleton: usize, animation: Option<usize>) -> Result<Self, Fault> {
        let paths = layer.tokens(skeleton, "joints", MOST_JOINTS)?.unwrap_or_default();
        let mut matrices = |name| -> Result<Vec<DAffine3>, Fault> {
            let Some(value) = layer.first(skeleton, name)? else { return Ok(Vec::new()) };
            let numbers = layer.source.vectors(value, 16, MOST_JOINTS as u64)?;
            Ok(numbers.as_chunks::<16>().0.iter().map(|numbers| affine(numbers)).collect())
        };
        let (binds, rests) = (matrices("bindTransforms")?, matrices("restTransforms")?);
        let animation = match animation.filter(|&prim| layer.prims[prim].kind == Kind::Motion) {
            Some(prim) => Animation::read(layer, prim, &paths)?,
            None => Animation { joints: vec![None; paths.len()], ..Animation::default() },
        };
        if binds.len() != paths.len() {
            let what = "has a skeleton that does not say where its joints were as the mesh was bound to them \
                        (bindTransforms); export it again, or with its points baked";
            return Err(Fault::unsupported(what));
        }
        if rests.len() != paths.len() && animation.joints.iter().any(Option::is_none) {
            return Err(damaged("a skeleton has other restTransforms than joints"));
        }
        let joints = paths.iter().enumerate().map(|(k, path)| (path.clone(), k)).collect();
        let parents = parents(&paths, &joints)?;
        let unbinds = binds.iter().map(DAffine3::inverse).collect();
        Ok(Self { joints, parents, unbinds, rests, animation, pose: None })
    }

    pub(super) fn count(&self) -> usize {
        self.parents.len()
    }

    /// The times at which joints and shapes are told.
    pub(super) fn times(&self) -> Vec<f64> {
        let Animation { translations, rotations, scales, weights, .. } = &self.animation;
        let tracks = [translations, rotations, scales, weights].map(|arrays| &arrays.track.times);
        union(tracks.into_iter().flatten().copied().collect(), 0.0)
    }

    /// Which weight a shape has.
    pub(super) fn shape(&self, name: &str) -> Option<usize> {
        self.animation.shapes.get(name).copied()
    }

    /// How strong shapes are at a time.
    pub(super) fn weights(&self, time: f64) -> Vec<f64> {
        let Some((from, to, share)) = self.animation.weights.at(time) else { return Vec::new() };
        let pairs = from.iter().zip(to);
        pairs.map(|(&from, &to)| f64::from(from) + share * (f64::from(to) - f64::from(from))).collect()
    }

    /// By what each joint moves what is bound to it, in the space of the skeleton.
    pub(super) fn pose(&mut self, time: f64) -> &[DAffine3] {
        if self.pose.as_ref().is_none_or(|(at, _)| *at != time) {
            let animated = self.animation.joints_at(time);
            let mut joints: Vec<DAffine3> = Vec::with_capacity(self.count());
            for (joint, parent) in self.parents.iter().enumerate() {
                let moved = self.animation.joints[joint].and_then(|k| Some(animated.as_ref()?[k]));
                let own = moved.or_else(|| self.rests.get(joint).copied()).unwrap_or_default();
                joints.push(parent.map_or(own, |parent| joints[parent] * own));
            }
            joints.iter_mut().zip(&self.unbinds).for_each(|(joint, unbind)| *joint *= *unbind);
            self.pose = Some((time, joints));
        }
        self.pose.as_ref().map_or(&[], |(_, pose)| pose)
    }
}

impl Animation {
    fn read(layer: &mut Layer<'_>, prim: usize, joints: &[String]) -> Result<Self, Fault> {
        let mut numbers = |name| -> Result<HashMap<String, usize>, Fault> {
            let names = layer.tokens(prim, name, MOST_JOINTS)?.unwrap_or_default();
            Ok(names.into_iter().enumerate().map(|(k, name)| (name, k)).collect())
        };
        let (own, shapes) = (numbers("joints")?, numbers("blendShapes")?);
        let mut arrays = |name, width| Arrays::read(layer, prim, (name, width), MOST_JOINTS as u64);
        Ok(Self {
            joints: joints.iter().map(|path| own.get(path).copied()).collect(),
            count: own.len(),
            translations: arrays("translations", 3)?,
            rotations: arrays("rotations", 4)?,
            scales: arrays("scales", 3)?,
            shapes,
            weights: arrays("blendShapeWeights", 1)?,
        })
    }

    /// The transforms of its joints below those above them; none where it does not say all.
    fn joints_at(&self, time: f64) -> Option<Vec<DAffine3>> {
        let [places, turns, sizes] = [&self.translations, &self.rotations, &self.scales].map(|arrays| arrays.at(time));
        let (places, turns, sizes) = (vectors(places?), turns?, vectors(sizes?));
        let rotation = |numbers: &[f32; 4]| DQuat::from_array(numbers.map(f64::from));
        let pairs = turns.0.as_chunks().0.iter().zip(turns.1.as_chunks().0);
        let turns: Vec<DQuat> = pairs
            .map(|(from, to)| match turns.2 {
                0.0 => rotation(from),
                share => rotation(from).slerp(rotation(to), share),
            })
            .collect();
        if [places.len(), turns.len(), sizes.len()] != [self.count; 3] {
            return None;
        }
        let all = sizes.iter().zip(turns).zip(places);
        // As OpenUSD has it: quaternions are not made to be of length 1.
        Some(all.map(|((&size, turn), place)| matrix(size, turn, place)).collect())
    }
}

fn matrix(size: DVec3, turn: DQuat, place: DVec3) -> DAffine3 {
    let axes = glam::DMat3::from_cols(turn * DVec3::X, turn * DVec3::Y, turn * DVec3::Z);
    DAffine3::from_mat3_translation(axes * glam::DMat3::from_diagonal(size), place)
}

fn vectors((from, to, share): (&[f32], &[f32], f64)) -> Vec<DVec3> {
    let vector = |numbers: &[f32; 3]| DVec3::from_array(numbers.map(f64::from));
    let pairs = from.as_chunks().0.iter().zip(to.as_chunks().0);
    pairs.map(|(from, to)| vector(from).lerp(vector(to), share)).collect()
}

/// The nearest joint of those above each that the skeleton has.
fn parents(paths: &[String], joints: &HashMap<String, usize>) -> Result<Vec<Option<usize>>, Fault> {
    if joints.len() < paths.len() || paths.iter().any(|path| path.len() > LONGEST_PATH) {
        return Err(damaged("a skeleton has a joint twice, or a longer path than any program writes"));
    }
    let parent = |(joint, path): (usize, &String)| {
        let above = std::iter::successors(path.rsplit_once('/'), |(above, _)| above.rsplit_once('/'));
        let parent = above.take(DEEPEST).find_map(|(above, _)| joints.get(above).copied());
        if parent.is_some_and(|parent| parent >= joint) {
            return Err(damaged("a skeleton has a joint before the one above it"));
        }
        Ok(parent)
    };
    paths.iter().enumerate().map(parent).collect()
}
