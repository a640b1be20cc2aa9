//! The animation that moves chosen meshes.

use std::collections::HashSet;
use std::ops::Range;

use cager_geometry::surface::shown_in;
use gltf::json::animation::Property;
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};

use super::buffers::Buffers;
use super::channel::{Channel, NEAR};
use super::faults::item;
use super::scene::{Placement, Scene};
use crate::dropped::listed;
use crate::error::Fault;
use crate::scene::{shown, union};

/// What a number of a channel takes at the most, while it is read.
const NUMBER_BYTES: usize = 12;

pub(super) struct Clip {
    channels: Vec<Channel>,
    /// Those that show and hide a mesh, which is where it is all the same.
    switches: Vec<Channel>,
    /// What is to be said of others.
    pub(super) note: Option<String>,
}

impl Clip {
    /// The animation that `wanted` names, or else the first that moves the chosen placements.
    pub(super) fn of(
        buffers: &Buffers<'_>,
        scene: &Scene,
        chosen: Range<usize>,
        wanted: Option<&str>,
    ) -> Result<Option<Self>, Fault> {
        let root = &buffers.root;
        let chosen = &scene.placements[chosen];
        let movers = Movers::of(root, scene, chosen);
        let moves = |k: &usize| {
            let channels = &root.animations[*k].channels;
            channels.iter().any(|channel| movers.move_by(channel.target.node.value(), &channel.target.path))
        };
        let moving: Vec<usize> = (0..root.animations.len()).filter(moves).collect();
        // The only one is taken whatever it is called, as the only mesh is.
        let first = match wanted.filter(|_| moving.len() > 1) {
            Some(wanted) => find(root, &moving, wanted)?,
            None => match moving.first() {
                Some(&first) => first,
                None => return Ok(None),
            },
        };
        let (animation, mut room) = (&root.animations[first], buffers.most_bytes() / NUMBER_BYTES);
        let mut channels = Vec::new();
        for (k, stored) in animation.channels.iter().enumerate() {
            let node = stored.target.node.value();
            if !movers.move_by(node, &stored.target.path) {
                continue;
            }
            let place = format!("animation {first}, channel {k}");
            let same = |other: &Channel| other.node == node && Checked::Valid(other.property) == stored.target.path;
            if channels.iter().any(same) {
                return Err(Fault::damaged(format!(
                    "{place}: moves what another channel moves; export the animation again"
                )));
            }
            let channel = Channel::read(animation, stored, buffers, &mut room, &place)?;
            let fixed = item(&root.nodes, "node", node)?;
            let Some(channel) = channel else { continue };
            if fixed.matrix.is_some() && channel.property != Property::MorphTargetWeights {
                return Err(Fault::unsupported(format!(
                    "{place}: moves node {node}, which has a matrix; export it with translation, rotation and scale"
                )));
            }
            channels.push(channel);
        }
        let others: Vec<usize> = moving.into_iter().filter(|&k| k != first).collect();
        let note = (!others.is_empty() && wanted.is_none()).then(|| {
            format!(
                "of its {} animations {} is read, {} left out; choose one with --animation, where the command has it, \
                 or export them merged into one (in Blender: Animation mode, Active actions merged)",
                others.len() + 1,
                name(root, first),
                names(root, &others)
            )
        });
        let is_own = |channel: &Channel| {
            let has_none_below = root.nodes[channel.node].children.as_ref().is_none_or(Vec::is_empty);
            has_none_below && chosen.iter().any(|own| own.skin.is_none() && own.node == Some(channel.node))
        };
        let (switches, channels) =
            channels.into_iter().partition(|channel| channel.switched().is_some() && is_own(channel));
        Ok(Some(Self { channels, switches, note }))
    }

    /// The times of all keys, ascending, none twice.
    pub(super) fn key_times(&self) -> Vec<f64> {
        let all = self.channels.iter().chain(&self.switches);
        union(all.flat_map(|channel| &channel.times).copied().collect(), NEAR)
    }

    /// Which of some times the mesh of a node is shown at; none where it always is.
    pub(super) fn shown(&self, node: usize, times: &[f64]) -> Option<Vec<Range<u32>>> {
        let switch = self.switches.iter().find(|channel| channel.node == node)?;
        shown_in(times.iter().map(|&time| !switch.is_zero(time)))
    }

    pub(super) fn moves_between_keys(&self) -> bool {
        self.channels.iter().any(Channel::moves_between_keys)
    }

    /// Puts the nodes where they are at a time.
    pub(super) fn apply(&self, time: f64, root: &mut Root) {
        for channel in &self.channels {
            if let Some(node) = root.nodes.get_mut(channel.node) {
                channel.apply(time, node);
            }
        }
        for channel in &self.switches {
            if let (Some(node), Some(shown)) = (root.nodes.get_mut(channel.node), channel.switched()) {
                channel.put(shown, node);
            }
        }
    }
}

/// The one of several animations that is called so, or has this number among all in the file.
fn find(root: &Root, moving: &[usize], wanted: &str) -> Result<usize, Fault> {
    let called = moving.iter().find(|&&k| root.animations[k].name.as_deref() == Some(wanted));
    let numbered = || moving.iter().find(|&&k| wanted.parse() == Ok(k));
    called.or_else(numbered).copied().ok_or_else(|| {
        Fault::invalid(format!(
            "holds no animation {} that moves the mesh, but {}; give one of these with --animation, by its name or \
             number",
            shown(wanted),
            names(root, moving)
        ))
    })
}

fn name(root: &Root, k: usize) -> String {
    root.animations[k].name.as_ref().map_or_else(|| format!("animation {k}"), |name| shown(name))
}

/// Animations as far as a message has room.
fn names(root: &Root, animations: &[usize]) -> String {
    let names: Vec<String> = animations.iter().map(|&k| name(root, k)).collect();
    listed(names.iter().map(String::as_bytes))
}

/// Nodes whose transforms, and those whose weights, say where chosen meshes are.
struct Movers {
    transforms: HashSet<usize>,
    weights: HashSet<usize>,
}

impl Movers {
    fn of(root: &Root, scene: &Scene, chosen: &[Placement]) -> Self {
        let skins: HashSet<usize> = chosen.iter().filter_map(|placement| placement.skin).collect();
        let joints = skins.iter().filter_map(|&skin| root.skins.get(skin)).flat_map(|skin| &skin.joints);
        let own = chosen.iter().filter(|placement| placement.skin.is_none()).filter_map(|placement| placement.node);
        let mut transforms = HashSet::new();
        for node in joints.map(Index::value).chain(own) {
            let mut next = scene.places.get(node).map(|_| node);
            while let Some(node) = next.filter(|&node| transforms.insert(node)) {
                next = scene.places[node].as_ref().and_then(|place| place.parent);
            }
        }
        Self { transforms, weights: chosen.iter().filter_map(|placement| placement.node).collect() }
    }

    fn move_by(&self, node: usize, property: &Checked<Property>) -> bool {
        match property {
            Checked::Valid(Property::MorphTargetWeights) => self.weights.contains(&node),
            Checked::Valid(_) => self.transforms.contains(&node),
            // Told when it is read.
            Checked::Invalid => true,
        }
    }
}
