//! Which meshes of a layer are meant, and when they are shown.

use std::collections::HashMap;
use std::sync::Arc;

use super::layer::{Instance, Kind, Layer, Prim, composed};
use crate::error::Fault;
use crate::scene::{
    Node, Steps, Tree, Visibility, Wanted, ancestry, choose as choose_meshes, list, named, said, shown_path,
};

/// The meshes that are wanted, and what the user should know of others.
pub(super) fn choose(layer: &mut Layer<'_>, wanted: Wanted<'_>) -> Result<(Vec<usize>, Vec<String>), Fault> {
    let is_there = |&k: &usize| ancestry(&layer.nodes, k).all(|k| layer.prims[k].is_there);
    let there: Vec<usize> = (0..layer.prims.len()).filter(is_there).collect();
    let is_a = |k: usize, kind: Kind| layer.prims[k].kind == kind;
    let instancer = there.iter().copied().find(|&k| is_a(k, Kind::PointInstancer));
    // Those below an instancer are shown where its points are, and not where they are themselves.
    let places = [Kind::PointInstancer, Kind::Instanced, Kind::Instance];
    let place = |k: usize| ancestry(&layer.nodes, k).map(|k| layer.prims[k].kind).find(|kind| places.contains(kind));
    let is_placed = |&k: &usize| place(k).is_none_or(|kind| kind == Kind::Instance);
    let mut meshes: Vec<usize> = there.iter().copied().filter(|&k| is_a(k, Kind::Mesh)).collect();
    let is_none = meshes.is_empty();
    meshes.retain(is_placed);
    let mut notes = Vec::new();
    if wanted.prims.is_empty() && meshes.len() > 1 {
        let (mut rendered, mut others) = shown(layer, &meshes)?;
        // A part of the rest pose may be hidden in the file of a frame.
        if wanted.points.is_some_and(|points| count(layer, &rendered) != points && count(layer, &meshes) == points) {
            (rendered, others) = (meshes, Vec::new());
        }
        if !others.is_empty() {
            notes.push(format!("left out what is hidden or a guide: {}; --prim reads it too", list(layer, &others)));
        }
        meshes = rendered;
    }
    let first_composed = |prims: &[Prim], among: &[usize]| among.iter().find_map(|&k| Some((k, prims[k].composed?)));
    if meshes.is_empty() {
        return Err(match (first_composed(&layer.prims, &there), instancer) {
            (Some((prim, of)), _) => composed(&shown_path(&layer.nodes, prim), of),
            (None, Some(instancer)) if !is_none => Fault::unsupported(format!(
                "has its meshes as prototypes of {}, a PointInstancer, whose instances are not read; make them real \
                 where it is exported, or export the mesh alone",
                shown_path(&layer.nodes, instancer)
            )),
            _ => Fault::unsupported("holds no polygon mesh; export the mesh itself as USD"),
        });
    }
    let chosen = match (choose_meshes(layer, &meshes, wanted), first_composed(&layer.prims, &there)) {
        // What is missing may be what is not read.
        (Err(_), Some((prim, of))) if wanted.prims.is_empty() => {
            return Err(composed(&shown_path(&layer.nodes, prim), of));
        }
        (chosen, _) => chosen?,
    };
    if layer.most_points < u64::MAX && count(layer, &chosen) as u64 > layer.most_points {
        return Err(Fault::unsupported(format!(
            "shows its meshes so many times that they have more than {} points together; choose some with --prim",
            layer.most_points
        )));
    }
    // What else is composed may be a mesh that is meant, unless all were named.
    let is_named =
        !wanted.prims.is_empty() && wanted.prims.iter().all(|prim| !named(&layer.nodes, &chosen, prim).is_empty());
    let above: Vec<usize> = chosen.iter().flat_map(|&mesh| ancestry(&layer.nodes, mesh)).collect();
    let looked_at = if is_named { above } else { there };
    if let Some((prim, of)) = first_composed(&layer.prims, &looked_at) {
        return Err(composed(&shown_path(&layer.nodes, prim), of));
    }
    notes.extend(instancer.map(|instancer| {
        format!("the instances of {}, a PointInstancer, are not read", shown_path(&layer.nodes, instancer))
    }));
    Ok((chosen, notes))
}

/// How many points meshes have together.
fn count(layer: &mut Layer<'_>, meshes: &[usize]) -> usize {
    meshes.iter().map(|&mesh| layer.points(mesh).unwrap_or(0) as usize).sum()
}

/// Meshes that are rendered, where there are any, and others: cages and other helpers say that they
/// are guides or proxies, and what is switched off is invisible.
fn shown(layer: &mut Layer<'_>, meshes: &[usize]) -> Result<(Vec<usize>, Vec<usize>), Fault> {
    let (mut rendered, mut others, mut switched) = (Vec::new(), Vec::new(), HashMap::new());
    for &mesh in meshes {
        let (mut purpose, mut is_hidden) = (None, false);
        for prim in ancestry(&layer.nodes, mesh).collect::<Vec<_>>() {
            // The innermost purpose counts.
            purpose = match purpose {
                None => constant(layer, prim, "purpose")?,
                known => known,
            };
            is_hidden |= match switched.get(&prim) {
                Some(is_off) => *is_off,
                None => {
                    let is_off = constant(layer, prim, "visibility")?.as_deref() == Some("invisible");
                    *switched.entry(prim).or_insert(is_off)
                }
            };
        }
        let is_rendered = !is_hidden && !matches!(purpose.as_deref(), Some("guide" | "proxy"));
        if is_rendered { rendered.push(mesh) } else { others.push(mesh) }
    }
    Ok(if rendered.is_empty() { (others, rendered) } else { (rendered, others) })
}

/// When a prim is shown: what is invisible hides all below it.
pub(super) fn visible(layer: &mut Layer<'_>, prim: usize, known: &mut Visibility) -> Result<Arc<Steps>, Fault> {
    let above: Vec<usize> = ancestry(&layer.nodes, prim).collect();
    known.of(&above, |prim| {
        if let Some(Instance { hidden: (track, values), .. }) = layer.instances.get(&prim) {
            return said(track, |value| Ok(values.contains(&value.0).then_some(false)));
        }
        let track = layer.attribute(prim, "visibility")?;
        said(&track, |value| Ok((layer.source.tokens(value, 1)? == ["invisible"]).then_some(false)))
    })
}

/// The token that an attribute of a prim is at all times.
fn constant(layer: &mut Layer<'_>, prim: usize, name: &str) -> Result<Option<String>, Fault> {
    let said = layer.attribute(prim, name)?;
    let value = said.still().filter(|_| said.times.len() < 2);
    Ok(value.map_or(Ok(Vec::new()), |value| layer.source.tokens(value, 1))?.pop())
}

impl Tree for Layer<'_> {
    fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    fn points(&mut self, mesh: usize) -> Option<u64> {
        match self.attribute(mesh, "points").ok()?.still() {
            Some(points) => self.source.points(points).ok().map(|points| points.count as u64),
            None => Some(0),
        }
    }
}
