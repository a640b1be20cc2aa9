//! What instancers show: a copy of a prototype for each instance, where and when it is.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use crate::error::Fault;
use crate::scene::{Node, ancestry, damaged, shown_path};
use crate::usd::layer::{Instance, Kind, Layer, Prim};

/// Instances of one scene: each mesh of each is a part.
pub(super) const MOST_INSTANCES: usize = 1 << 13;

/// Adds instances below their instancers; `children` are the prims below each.
pub(super) fn expand(layer: &mut Layer<'_>, children: &[Vec<usize>], most: usize) -> Result<(), Fault> {
    let mut left = MOST_INSTANCES;
    for prim in 0..children.len() {
        let is_there = |prim: usize| ancestry(&layer.nodes, prim).all(|k| layer.prims[k].is_there);
        // Those within prototypes are not taken apart.
        let is_inner = ancestry(&layer.nodes, prim).skip(1).any(|k| layer.prims[k].kind == Kind::Instanced);
        if layer.prims[prim].kind == Kind::PointInstancer && is_there(prim) && !is_inner {
            let name = shown_path(&layer.nodes, prim);
            add_all(layer, prim, children, (&mut left, most)).map_err(|fault| fault.within(&name))?;
        }
    }
    Ok(())
}

fn add_all(
    layer: &mut Layer<'_>,
    instancer: usize,
    children: &[Vec<usize>],
    (left, most): (&mut usize, usize),
) -> Result<(), Fault> {
    let prototypes = layer.source.targets(instancer, "prototypes")?;
    let mut integers = |name| layer.integers(instancer, name, u32::MAX.into());
    let (numbers, ids) = (integers("protoIndices")?, integers("ids")?);
    if numbers.is_empty() {
        return Ok(());
    }
    let track = layer.attribute(instancer, "protoIndices")?;
    for &value in &track.values {
        if layer.source.integers(value, u32::MAX.into())? != numbers {
            let what = "is a PointInstancer whose instances come, go or change, which is not read; make them real \
                        where it is exported";
            return Err(Fault::unsupported(what));
        }
    }
    *left = left.checked_sub(numbers.len()).ok_or_else(|| {
        Fault::unsupported(format!(
            "is a PointInstancer of {} instances, where {MOST_INSTANCES} in all are read; export fewer, or make those \
             real that are meant",
            numbers.len()
        ))
    })?;
    let hidden = layer.attribute(instancer, "invisibleIds")?;
    let mut sets = HashMap::new();
    for value in hidden.values.iter().chain(&hidden.default) {
        if let Entry::Vacant(entry) = sets.entry(value.0) {
            let list = layer.source.integers(*value, MOST_INSTANCES as u64)?;
            entry.insert(list.into_iter().collect::<HashSet<i32>>());
        }
    }
    for (index, &number) in numbers.iter().enumerate() {
        let target = usize::try_from(number).ok().and_then(|number| prototypes.get(number)?.clone());
        let (prototype, _) = target.ok_or_else(|| damaged("an instance has a prototype that is not there"))?;
        if prototype >= children.len() || ancestry(&layer.nodes, instancer).any(|above| above == prototype) {
            return Err(damaged("an instancer is its own prototype"));
        }
        let id = ids.get(index).copied().unwrap_or(index as i32);
        let inside = sets.iter().filter(|(_, set)| set.contains(&id)).map(|(&value, _)| value);
        let hidden = (hidden.clone(), inside.collect());
        layer.source.reserve(hidden.0.times.len() as u64, 16)?;
        let place = layer.nodes.len();
        let name = [&*layer.nodes[prototype].name, format!("_{index}").as_bytes()].concat();
        let depth = layer.nodes[instancer].depth + 1;
        layer.nodes.push(Node { name: Arc::from(name), parent: Some(instancer), depth });
        layer.prims.push(Prim::new(Kind::Instance, true));
        layer.source.copy(usize::MAX, (usize::MAX, place));
        layer.instances.insert(place, Instance { instancer, index, hidden });
        copy(layer, (prototype, place), children, most)?;
    }
    layer.prims[instancer].kind = Kind::Instanced;
    Ok(())
}

/// Copies a prim and all below it to below another, in the order in which they are.
fn copy(
    layer: &mut Layer<'_>,
    (original, parent): (usize, usize),
    children: &[Vec<usize>],
    most: usize,
) -> Result<(), Fault> {
    let top = layer.nodes.len();
    let mut waiting = vec![(original, parent)];
    while let Some((of, parent)) = waiting.pop() {
        if layer.nodes.len() >= most {
            return Err(Fault::unsupported(
                "is a PointInstancer of more prims than some hundred thousand; make those real that are meant",
            ));
        }
        let at = layer.nodes.len();
        let depth = layer.nodes[parent].depth + 1;
        if depth > crate::usd::layer::DEEPEST as usize {
            return Err(crate::usd::layer::too_deep());
        }
        layer.nodes.push(Node { name: Arc::clone(&layer.nodes[of].name), parent: Some(parent), depth });
        let mut prim = layer.prims[of].clone();
        // Prototypes are often not defined, lest they show where they are.
        prim.is_there |= of == original && !prim.is_inactive;
        layer.prims.push(prim);
        layer.source.copy(of, (original, top));
        waiting.extend(children[of].iter().rev().map(|&child| (child, at)));
    }
    Ok(())
}
