//! Which mesh of a layer is meant.

use super::layer::{Layer, Prim, composed};
use crate::error::Fault;
use crate::scene::{Failure, Objects, choose as choose_object, named, shown_path};

/// The mesh that `prim` names, or the only one.
pub(super) fn choose<'a>(layer: &mut Box<dyn Layer + 'a>, prim: Option<&str>) -> Result<u32, Failure> {
    let is_there = |&k: &usize| layer.ancestry(k).all(|k| layer.prims()[k].is_there);
    let there: Vec<usize> = (0..layer.prims().len()).filter(is_there).collect();
    let mut meshes: Vec<usize> = there.iter().copied().filter(|&k| layer.prims()[k].is_mesh).collect();
    if prim.is_none() && meshes.len() > 1 {
        meshes = shown(layer, meshes)?;
    }
    let first_composed = |prims: &[Prim], among: &[usize]| among.iter().find_map(|&k| Some((k, prims[k].composed?)));
    if meshes.is_empty() {
        return Err(match first_composed(layer.prims(), &there) {
            Some((prim, of)) => composed(&shown_path(layer, prim), of),
            None => Fault::unsupported("holds no polygon mesh; export the mesh itself as USD"),
        }
        .into());
    }
    let chosen = choose_object(layer, &meshes, prim)?;
    // What else is composed may be the mesh that is meant, unless this one was named.
    let is_named = prim.is_some_and(|prim| !named(layer, &[chosen], prim).is_empty());
    let above: Vec<usize> = layer.ancestry(chosen).collect();
    let looked_at = if is_named { above } else { there };
    match first_composed(layer.prims(), &looked_at) {
        Some((prim, of)) => Err(composed(&shown_path(layer, prim), of).into()),
        None => Ok(chosen as u32),
    }
}

/// Meshes that are rendered, where there are any: cages and other helpers say that they are guides, and what is switched off is invisible.
fn shown<'a>(layer: &mut Box<dyn Layer + 'a>, meshes: Vec<usize>) -> Result<Vec<usize>, Failure> {
    let mut rendered = Vec::new();
    for &mesh in &meshes {
        let mut is_hidden = says(layer, mesh, "purpose", "guide")?;
        for prim in layer.ancestry(mesh).collect::<Vec<_>>() {
            is_hidden = is_hidden || says(layer, prim, "visibility", "invisible")?;
        }
        if !is_hidden {
            rendered.push(mesh);
        }
    }
    Ok(if rendered.is_empty() { meshes } else { rendered })
}

/// Whether an attribute of a prim is this token at all times.
fn says<'a>(layer: &mut Box<dyn Layer + 'a>, prim: usize, name: &str, token: &str) -> Result<bool, Failure> {
    let said = layer.attribute(prim as u32, name)?;
    let value = said.still().filter(|_| said.times.len() < 2);
    Ok(value.map_or(Ok(Vec::new()), |value| layer.tokens(value, 1))? == [token])
}

impl Objects for Box<dyn Layer + '_> {
    fn name(&self, object: usize) -> &[u8] {
        self.as_ref().name(&self.prims()[object])
    }

    fn parent(&self, object: usize) -> Option<usize> {
        self.prims()[object].parent.map(|parent| parent as usize)
    }

    fn depth(&self, object: usize) -> usize {
        self.prims()[object].depth as usize
    }

    fn told(&mut self, object: usize) -> String {
        let points = self.attribute(object as u32, "points").and_then(|points| match points.still() {
            Some(points) => self.points(points).map(|points| points.count),
            None => Ok(0),
        });
        points.map_or_else(|_| "unreadable".to_owned(), |points| format!("{points} points"))
    }
}
