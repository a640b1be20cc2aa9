//! The animation of a scene, the times of its frames, and when nodes are shown.

use std::ops::Range;

use cager_geometry::surface;
use ufbx::{Anim, AnimCurve, AnimStack, Node, Scene};

use crate::dropped::listed;
use crate::error::Fault;
use crate::frames::{RATES, Times, nominal};
use crate::scene::{Timeline, shown, whole_frames};

const VISIBILITY: &str = "Visibility";

/// The stack that `wanted` names or has as its number, or else the first that moves anything, and
/// what is to be said of others.
pub(super) fn choose<'a>(
    scene: &'a Scene,
    wanted: Option<&str>,
) -> Result<(Option<&'a AnimStack>, Option<String>), Fault> {
    let moves = |stack: &&AnimStack| curves(stack).any(|curve| curve.keyframes.len() > 1);
    let moving: Vec<&AnimStack> = scene.anim_stacks.as_ref().iter().map(|stack| &**stack).filter(moves).collect();
    let name = |stack: &&'a AnimStack| stack.element.name.as_bytes();
    // The only one is taken whatever it is called, as the only mesh is.
    let Some(wanted) = wanted.filter(|_| moving.len() > 1) else {
        let note = (moving.len() > 1).then(|| {
            format!(
                "of its {} animations {} is read, {} left out; choose one with --animation, where the command has it, \
                 or export them merged into one (in Blender: without All Actions)",
                moving.len(),
                listed(moving.iter().take(1).map(name)),
                listed(moving.iter().skip(1).map(name))
            )
        });
        return Ok((moving.first().copied(), note));
    };
    let called = moving.iter().find(|stack| &*stack.element.name == wanted);
    let numbered = || moving.iter().find(|stack| wanted.parse() == Ok(stack.element.typed_id));
    let found = called.or_else(numbered).copied();
    let missing = || {
        let wanted = shown(wanted);
        Fault::invalid(format!("has no animation {wanted}, but {}", listed(moving.iter().map(name))))
    };
    Ok((Some(found.ok_or_else(missing)?), None))
}

/// Whole frames of a stack from its begin to its end, at a rate or that of the file.
pub(super) fn timeline(scene: &Scene, stack: Option<&AnimStack>, rate: Option<f64>) -> Result<Timeline, Fault> {
    let told = Some(nominal(scene.settings.frames_per_second)).filter(|rate| RATES.contains(rate));
    let frame_rate = rate.or(told).unwrap_or(24.0);
    let Some(stack) = stack else {
        let times = Times { frame_rate: Some(frame_rate), ..Times::default() };
        return Ok(Timeline { times, at: vec![0.0] });
    };
    let (begin, end) = match (stack.time_begin, stack.time_end) {
        (begin, end) if begin < end => (begin, end),
        // Where the stack does not say it, its keys do.
        _ => curves(stack)
            .filter(|curve| !curve.keyframes.is_empty())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(begin, end), curve| {
                (begin.min(curve.min_time), end.max(curve.max_time))
            }),
    };
    let keys = curves(stack).map(|curve| curve.keyframes.len()).max().unwrap_or(0);
    whole_frames([begin, end], frame_rate, keys)
}

fn curves(stack: &AnimStack) -> impl Iterator<Item = &AnimCurve> {
    let layers = stack.layers.as_ref().iter();
    let values = layers.flat_map(|layer| layer.anim_values.as_ref().iter());
    values.flat_map(|value| value.curves.iter().flatten()).map(|curve| &**curve)
}

/// Whether something is hidden at all times, by itself or what is above it.
pub(super) fn is_hidden<'a>(stack: Option<&AnimStack>, mut above: impl Iterator<Item = &'a Node>) -> bool {
    above.any(|node| !node.visible && stack.is_none_or(|stack| visibility_keys(stack, node).next().is_none()))
}

/// The frames in which something is shown, by itself and by what is above it; `None` for all.
pub(super) fn shown_in(anim: &Anim, stack: Option<&AnimStack>, above: &[&Node], at: &[f64]) -> Option<Vec<Range<u32>>> {
    if is_hidden(stack, above.iter().copied()) {
        return Some(Vec::new());
    }
    let has_keys = |node: &&&Node| stack.is_some_and(|stack| visibility_keys(stack, node).next().is_some());
    let switched: Vec<&Node> = above.iter().filter(has_keys).copied().collect();
    let times = switched.iter().flat_map(|node| stack.into_iter().flat_map(|stack| visibility_keys(stack, node)));
    // It may change at the frames around keys alone.
    let around = times.flat_map(|time| {
        let next = at.partition_point(|&frame| frame < time - 1e-9);
        [next.saturating_sub(1), next, next + 1]
    });
    let mut changes: Vec<usize> = around.chain([0]).filter(|&frame| frame < at.len()).collect();
    changes.sort_unstable();
    changes.dedup();
    let is_shown = |frame: usize| {
        switched.iter().all(|node| ufbx::evaluate_prop(anim, &node.element, VISIBILITY, at[frame]).value_int != 0)
    };
    let states: Vec<bool> = changes.iter().map(|&frame| is_shown(frame)).collect();
    let state = |frame| states[changes.partition_point(|&change| change <= frame) - 1];
    surface::shown_in((0..at.len()).map(state))
}

/// The times of the keys of a node's visibility.
fn visibility_keys<'a>(stack: &'a AnimStack, node: &'a Node) -> impl Iterator<Item = f64> + 'a {
    let layers = stack.layers.as_ref().iter();
    let all = layers.flat_map(|layer| layer.find_anim_props(&node.element));
    let curves = all.filter(|found| &*found.prop_name == VISIBILITY).flat_map(|found| &found.anim_value.curves);
    curves.flatten().flat_map(|curve| curve.keyframes.as_ref()).map(|key| key.time)
}
