//! Scenes of several layers: references, payloads and sublayers are followed, and instancers are
//! taken apart. Of all that names a prim the strongest opinion counts: that of the layer itself and
//! those below it, then those of its chosen variants, of references and of payloads, each with its own.

mod clips;
mod files;
mod instances;
mod source;

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::layer::{Arc as To, Kind, Layer, Prim, Times, Variant, composed, too_deep};
use crate::error::Fault;
use crate::scene::Node;
use clips::{ClipSet, Clipped};
use files::{Files, within};
use source::Composite;

/// Prims, points and bytes of lists that a scene may have of what its files hold once, however small
/// these are.
const MOST_PRIMS: usize = 1 << 17;
const MOST_POINTS: u64 = 1 << 21;
const MOST_BYTES: u64 = 1 << 28;
/// Points and bytes of lists for each byte of the files.
const POINTS_OF_BYTE: u64 = 1;
const BYTES_OF_BYTE: u64 = 64;
/// Opinions of one prim, and references that lead to each other.
const MOST_SITES: usize = 64;
const MOST_IN_A_ROW: usize = 32;

type Name = Arc<[u8]>;

/// A prim of a layer, as one of those that say what a composed prim is.
#[derive(Clone, Copy, Debug)]
struct Site {
    layer: usize,
    prim: usize,
    mapping: usize,
    times: Times,
}

/// Where the prims of a stack of layers are in the scene.
#[derive(Clone, Debug)]
struct Mapping {
    stack: usize,
    /// The path of the prim that is referred to, and the one that refers to it; none for all.
    root: Vec<Name>,
    at: Option<usize>,
    /// Of the same stack, for what lies elsewhere in it.
    outer: Option<usize>,
    times: Times,
}

struct Builder<'a> {
    files: Files<'a>,
    nodes: Vec<Node>,
    prims: Vec<Prim>,
    sites: Vec<Vec<Site>>,
    places: HashMap<(Option<usize>, Name), usize>,
    children: Vec<Vec<usize>>,
    mappings: Vec<Mapping>,
    sets: Vec<ClipSet>,
    clipped: Vec<Option<Clipped>>,
    most: usize,
}

/// A layer of `length` bytes with what it is composed of, where that is plain; of files those below
/// a folder, where it is known.
pub(super) fn compose<'a>(layer: Layer<'a>, length: u64, folder: Option<&Path>) -> Result<Layer<'a>, Fault> {
    let is_alone = |prim: &Prim| {
        let has_others = !prim.arcs.is_empty() || !prim.variants.is_empty() || prim.clips.is_some();
        !has_others && prim.kind != Kind::PointInstancer
    };
    if layer.stage.sublayers.is_empty() && layer.prims.iter().all(is_alone) {
        return Ok(layer);
    }
    let stage = layer.stage.clone();
    let Some(files) = Files::new(layer, length, folder)? else { return Err(composed("the layer", "sublayers")) };
    let mut builder = Builder {
        files,
        nodes: Vec::new(),
        prims: Vec::new(),
        sites: Vec::new(),
        places: HashMap::new(),
        children: Vec::new(),
        mappings: vec![Mapping { stack: 0, root: Vec::new(), at: None, outer: None, times: Times::default() }],
        sets: Vec::new(),
        clipped: Vec::new(),
        most: MOST_PRIMS,
    };
    builder.build()?;
    let (length, nodes, prims) = (builder.files.length, builder.nodes, builder.prims);
    let most_points = MOST_POINTS.max(length.saturating_mul(POINTS_OF_BYTE));
    let allowance = length.saturating_mul(BYTES_OF_BYTE).saturating_add(MOST_BYTES);
    let scene = (builder.sites, builder.places, builder.mappings);
    let source = Composite::new(builder.files.layers, scene, (builder.sets, builder.clipped), allowance);
    let mut layer = Layer { most_points, ..Layer::plain(stage, nodes, prims, Box::new(source)) };
    instances::expand(&mut layer, &builder.children, builder.most)?;
    Ok(layer)
}

impl Builder<'_> {
    fn build(&mut self) -> Result<(), Fault> {
        self.most += 2 * self.files.layers.iter().map(|loaded| loaded.layer.nodes.len()).sum::<usize>();
        let top = self.files.stacks[0].iter().map(|&(layer, times)| (layer, None, 0, times));
        let mut waiting: Vec<(Option<usize>, Name, Vec<Site>)> = Vec::new();
        let tops: Vec<_> = top.collect();
        waiting.extend(self.below(&tops).into_iter().rev().map(|(name, sites)| (None, name, sites)));
        while let Some((parent, name, direct)) = waiting.pop() {
            let (at, depth) = (self.nodes.len(), parent.map_or(0, |parent| self.nodes[parent].depth) + 1);
            if depth > super::layer::DEEPEST as usize {
                return Err(too_deep());
            }
            if at == self.most {
                return Err(Fault::unsupported(
                    "is composed of more prims than its files hold and some hundred thousand; write the meshes that \
                     are meant into a file of their own",
                ));
            }
            let (mut sites, mut unread) = (Vec::new(), None);
            for site in direct {
                self.follow(site, at, (&mut sites, &mut unread), 0)?;
            }
            let clipped = self.clipped((parent, &name), &sites, &mut unread)?;
            self.clipped.push(clipped);
            let all = || sites.iter().map(|site| &self.files.layers[site.layer].layer.prims[site.prim]);
            let is_inactive = all().any(|prim| prim.is_inactive);
            let kind = all().map(|prim| prim.kind).find(|kind| *kind != Kind::Other).unwrap_or(Kind::Other);
            let prim = Prim {
                is_inactive,
                composed: all().find_map(|prim| prim.composed).or(unread),
                ..Prim::new(kind, all().any(|prim| prim.is_there) && !is_inactive)
            };
            let of: Vec<_> = sites.iter().map(|site| (site.layer, Some(site.prim), site.mapping, site.times)).collect();
            // What is not there shows nothing below it, but may be referred to.
            let below = self.below(&of);
            waiting.extend(below.into_iter().rev().map(|(name, sites)| (Some(at), name, sites)));
            self.places.insert((parent, Arc::clone(&name)), at);
            if let Some(parent) = parent {
                self.children[parent].push(at);
            }
            self.nodes.push(Node { name, parent, depth });
            self.prims.push(prim);
            self.sites.push(sites);
            self.children.push(Vec::new());
        }
        Ok(())
    }

    /// Names below prims, those of the weakest first as OpenUSD has them, and who says something of
    /// each, the strongest first.
    fn below(&self, above: &[(usize, Option<usize>, usize, Times)]) -> Vec<(Name, Vec<Site>)> {
        let (mut all, mut places) = (Vec::<(Name, Vec<Site>)>::new(), HashMap::<Name, usize>::new());
        for &(layer, parent, mapping, times) in above.iter().rev() {
            let loaded = &self.files.layers[layer];
            for &prim in loaded.children(parent) {
                let name = &loaded.layer.nodes[prim].name;
                let place = *places.entry(Arc::clone(name)).or_insert(all.len());
                if place == all.len() {
                    all.push((Arc::clone(name), Vec::new()));
                }
                all[place].1.insert(0, Site { layer, prim, mapping, times });
            }
        }
        all
    }

    /// Adds a site and those that its arcs lead to; says which arcs cannot be followed.
    fn follow(
        &mut self,
        site: Site,
        at: usize,
        (sites, unread): (&mut Vec<Site>, &mut Option<&'static str>),
        depth: usize,
    ) -> Result<(), Fault> {
        if depth == MOST_IN_A_ROW || sites.len() == MOST_SITES {
            return Err(Fault::unsupported(format!(
                "has a prim with more than {MOST_IN_A_ROW} references in a row or {MOST_SITES} in all, or one that \
                 refers to itself; write all into one file"
            )));
        }
        sites.push(site);
        let Prim { arcs, variants, .. } = self.files.layers[site.layer].layer.prims[site.prim].clone();
        for Variant { set, name, prim } in variants {
            let chosen = |site: &Site| {
                let all = &self.files.layers[site.layer].layer.prims[site.prim].chosen;
                all.iter().find(|(of, _)| **of == *set).map(|(_, chosen)| chosen)
            };
            if sites.iter().find_map(chosen) == Some(&name) {
                self.follow(Site { prim, ..site }, at, (&mut *sites, &mut *unread), depth + 1)?;
            }
        }
        for arc in arcs {
            let Some(mapping) = self.lead(site, &arc, at)? else {
                *unread = Some(arc.words);
                continue;
            };
            let Mapping { stack, root, times, .. } = &mapping;
            let found: Vec<Site> = self.files.stacks[*stack]
                .iter()
                .filter_map(|&(layer, moved)| {
                    let prim = self.files.layers[layer].find(root)?;
                    let times = within(*times, moved, 1.0)?;
                    Some(Site { layer, prim, mapping: self.mappings.len(), times })
                })
                .collect();
            if found.is_empty() {
                *unread = Some(arc.words);
            }
            self.mappings.push(mapping);
            for site in found {
                self.follow(site, at, (&mut *sites, &mut *unread), depth + 1)?;
            }
        }
        Ok(())
    }

    /// Where an arc leads.
    fn lead(&mut self, site: Site, arc: &To, at: usize) -> Result<Option<Mapping>, Fault> {
        let around = &self.mappings[site.mapping];
        let (own, times) = (around.stack, around.times);
        let is_inside = arc.asset.is_empty();
        let (stack, rate) = match is_inside {
            true => (own, 1.0),
            false => match self.files.open(site.layer, &arc.asset)? {
                Some(found) => found,
                None => return Ok(None),
            },
        };
        let Some(times) = within(times, arc.times, rate) else { return Ok(None) };
        let top = self.files.stacks[stack][0].0;
        let usual = &self.files.layers[top].layer.stage.default_prim;
        let path = if arc.prim.is_empty() { usual } else { &arc.prim };
        let path = path.trim_start_matches('/');
        if path.is_empty() || path.contains(['{', '.']) {
            return Ok(None);
        }
        let root = path.split('/').map(|name| Arc::from(name.as_bytes())).collect();
        Ok(Some(Mapping { stack, root, at: Some(at), outer: is_inside.then_some(site.mapping), times }))
    }
}
