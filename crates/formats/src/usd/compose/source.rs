//! The values of a composed scene: those of the strongest site that has some.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use super::clips::{ClipSet, Clipped};
use super::files::Loaded;
use super::instances::MOST_INSTANCES;
use super::{Mapping, Name, Site};
use crate::error::Fault;
use crate::scene::{Allowance, Points, Track, Value, Values, damaged};
use crate::usd::layer::{Attributes, Target};

/// Bits of the number of an element in a value, and of the layer in the start of points.
const ELEMENT: u32 = 48;
const LAYER: u32 = 48;
/// Of values that are elements of lists.
const IS_ELEMENT: u64 = 1 << 63;
/// The value where clips have none.
pub(super) const NOTHING: Value = Value(IS_ELEMENT - 1);

/// Prims by the prim above them and their names.
type Places = HashMap<(Option<usize>, Name), usize>;

pub(super) struct Composite<'a> {
    pub(super) layers: Vec<Loaded<'a>>,
    sites: Vec<Vec<Site>>,
    places: Places,
    mappings: Vec<Mapping>,
    /// Sequences of files with values, and which prims have some there.
    pub(super) sets: Vec<ClipSet>,
    pub(super) clipped: Vec<Option<Clipped>>,
    /// Copies of prims: the top of the original and that of the copy.
    copies: HashMap<usize, (usize, usize)>,
    /// The layer of each value, and the value there.
    values: Vec<(usize, Value)>,
    numbers: HashMap<(usize, u64), u64>,
    /// What was read once: copies ask for the same again.
    tracks: HashMap<(usize, usize, String), Track>,
    paths: HashMap<(usize, usize, String), Vec<String>>,
    tokens: HashMap<u64, Vec<String>>,
    integers: HashMap<u64, Vec<i32>>,
    vectors: HashMap<(u64, usize), Vec<f64>>,
    /// Bytes that may still be given of it.
    pub(super) allowance: Allowance,
}

/// A list that was read once, where it is not longer than it may be.
fn given<T: Clone>(list: &[T], most: u64, allowance: &mut Allowance) -> Result<Vec<T>, Fault> {
    if list.len() as u64 > most {
        return Err(damaged("it has a longer list than there may be"));
    }
    allowance.take(list.len() as u64, size_of::<T>() as u64)?;
    Ok(list.to_vec())
}

impl<'a> Composite<'a> {
    pub(super) fn new(
        layers: Vec<Loaded<'a>>,
        (sites, places, mappings): (Vec<Vec<Site>>, Places, Vec<Mapping>),
        (sets, clipped): (Vec<ClipSet>, Vec<Option<Clipped>>),
        allowance: u64,
    ) -> Self {
        Self {
            layers,
            sites,
            places,
            mappings,
            sets,
            clipped,
            copies: HashMap::new(),
            values: Vec::new(),
            numbers: HashMap::new(),
            tracks: HashMap::new(),
            paths: HashMap::new(),
            tokens: HashMap::new(),
            integers: HashMap::new(),
            vectors: HashMap::new(),
            allowance: Allowance(allowance),
        }
    }

    /// The values that a site itself has.
    fn own(&mut self, site: Site, name: &str) -> Result<Track, Fault> {
        let key = (site.layer, site.prim, name.to_owned());
        if !self.tracks.contains_key(&key) {
            let mut track = self.layers[site.layer].layer.source.attribute(site.prim, name)?;
            track.values.iter_mut().for_each(|value| *value = self.held(site.layer, *value));
            track.default = track.default.map(|value| self.held(site.layer, value));
            self.tracks.insert(key.clone(), track);
        }
        let track = &self.tracks[&key];
        self.allowance.take(track.times.len() as u64, 16)?;
        Ok(track.clone())
    }

    /// The paths to which a site itself leads.
    fn own_paths(&mut self, site: Site, name: &str) -> Result<Vec<String>, Fault> {
        let key = (site.layer, site.prim, name.to_owned());
        if !self.paths.contains_key(&key) {
            let paths = self.layers[site.layer].layer.source.paths(site.prim, name)?;
            self.paths.insert(key.clone(), paths);
        }
        let paths = &self.paths[&key];
        self.allowance.take(paths.iter().map(|path| path.len() as u64 + 64).sum(), 1)?;
        Ok(paths.clone())
    }

    /// The paths to which the strongest site leads that names some, and its mapping.
    fn told_paths(&mut self, prim: usize, name: &str) -> Result<(Vec<String>, usize), Fault> {
        for site in self.sites[prim].clone() {
            let paths = self.own_paths(site, name)?;
            if !paths.is_empty() {
                return Ok((paths, site.mapping));
            }
        }
        Ok(Default::default())
    }

    /// What the strongest site says that says something.
    fn first_told<T>(
        &mut self,
        prim: usize,
        mut told: impl FnMut(&mut (dyn Attributes + 'a), usize) -> Result<Option<T>, Fault>,
    ) -> Result<Option<T>, Fault> {
        for site in &self.sites[prim] {
            let told = told(self.layers[site.layer].layer.source.as_mut(), site.prim)?;
            if told.is_some() {
                return Ok(told);
            }
        }
        Ok(None)
    }

    /// Reads vectors once.
    fn list(&mut self, value: Value, width: usize, most: u64) -> Result<&[f64], Fault> {
        if !self.vectors.contains_key(&(value.0, width)) {
            let (source, inner, _) = self.of(value)?;
            let list = source.vectors(inner, width, most)?;
            self.vectors.insert((value.0, width), list);
        }
        Ok(&self.vectors[&(value.0, width)])
    }

    pub(super) fn held(&mut self, layer: usize, value: Value) -> Value {
        let next = self.values.len() as u64;
        let number = *self.numbers.entry((layer, value.0)).or_insert(next);
        if number == next {
            self.values.push((layer, value));
        }
        Value(number)
    }

    /// The layer of a value, and the value there.
    fn of(&mut self, value: Value) -> Result<(&mut (dyn Attributes + 'a), Value, usize), Fault> {
        let held = usize::try_from(value.0).ok().and_then(|number| self.values.get(number).copied());
        let (layer, value) = held.ok_or_else(|| damaged("it has one number where a list belongs"))?;
        Ok((self.layers[layer].layer.source.as_mut(), value, layer))
    }

    /// The prim of a path in the layers of a mapping.
    fn mapped(&self, path: &str, mapping: usize) -> Option<Target> {
        let (names, attribute) = path.split_once('.').unwrap_or((path, ""));
        let names: Vec<Name> = names.strip_prefix('/')?.split('/').map(|name| Arc::from(name.as_bytes())).collect();
        let mut mapping = &self.mappings[mapping];
        while !names.starts_with(&mapping.root) {
            mapping = &self.mappings[mapping.outer?];
        }
        Some((self.down(mapping.at, &names[mapping.root.len()..])?, attribute.to_owned()))
    }

    fn down(&self, from: Option<usize>, names: &[Name]) -> Option<usize> {
        names
            .iter()
            .try_fold(from, |prim, name| self.places.get(&(prim, Arc::clone(name))).copied().map(Some))
            .flatten()
    }

    /// Where the copy of a prim is for what lies in the same copy.
    fn copied(&self, prim: usize, target: usize) -> usize {
        let Some(&(original, copy)) = self.copies.get(&prim) else { return target };
        // Copies keep the order of what they are of.
        let last = self.copies.len();
        let offset = target.checked_sub(original).filter(|offset| *offset <= last);
        let there = offset.and_then(|offset| copy.checked_add(offset));
        there.filter(|there| self.copies.get(there) == Some(&(original, copy))).unwrap_or(target)
    }
}

impl Attributes for Composite<'_> {
    fn attribute(&mut self, prim: usize, name: &str) -> Result<Track, Fault> {
        let mut clipped = self.clipped[prim].clone();
        for site in self.sites[prim].clone() {
            if let Some(clipped) = clipped.take_if(|clipped| !self.is_stronger(clipped, site)) {
                let track = self.in_clips(&clipped, name)?;
                if !track.is_empty() {
                    return Ok(track);
                }
            }
            let mut track = self.own(site, name)?;
            if !track.is_empty() {
                track.times.iter_mut().for_each(|time| *time = site.times.offset + site.times.scale * *time);
                return Ok(track);
            }
        }
        clipped.map_or(Ok(Track::default()), |clipped| self.in_clips(&clipped, name))
    }

    fn properties(&self, prim: usize) -> Vec<(String, String)> {
        let (mut all, mut known) = (Vec::new(), BTreeSet::new());
        for site in &self.sites[prim] {
            let own = self.layers[site.layer].layer.source.properties(site.prim);
            all.extend(own.into_iter().filter(|(name, _)| known.insert(name.clone())));
        }
        all
    }

    fn interpolation(&mut self, prim: usize, name: &str) -> Result<String, Fault> {
        let told = self.first_told(prim, |source, prim| {
            let told = source.interpolation(prim, name)?;
            Ok(Some(told).filter(|told| !told.is_empty()))
        });
        Ok(told?.unwrap_or_default())
    }

    fn weight(&mut self, prim: usize, name: &str) -> Result<Option<f64>, Fault> {
        self.first_told(prim, |source, prim| source.weight(prim, name))
    }

    fn element(&mut self, prim: usize, name: &str, width: usize, index: usize) -> Result<Track, Fault> {
        let mut track = self.attribute(prim, name)?;
        self.reserve(track.times.len() as u64 + 1, 16)?;
        for value in track.values.iter_mut().chain(&mut track.default) {
            self.list(*value, width, MOST_INSTANCES as u64)?;
            // Three numbers or four.
            *value = Value(IS_ELEMENT | (width as u64 & 4) << 60 | (index as u64) << ELEMENT | value.0);
        }
        Ok(track)
    }

    fn copy(&mut self, of: usize, tops: (usize, usize)) {
        self.copies.insert(self.sites.len(), tops);
        self.sites.push(self.sites.get(of).cloned().unwrap_or_default());
        self.clipped.push(self.clipped.get(of).cloned().flatten());
    }

    fn folder(&self, value: Value) -> String {
        let held = usize::try_from(value.0).ok().and_then(|number| self.values.get(number));
        held.map_or_else(String::new, |&(layer, _)| self.layers[layer].folder())
    }

    fn origin(&self, prim: usize) -> (usize, usize) {
        self.sites[prim].first().map_or((usize::MAX, prim), |site| (site.layer, site.prim))
    }

    fn paths(&mut self, prim: usize, name: &str) -> Result<Vec<String>, Fault> {
        Ok(self.told_paths(prim, name)?.0)
    }

    fn targets(&mut self, prim: usize, name: &str) -> Result<Vec<Option<Target>>, Fault> {
        let (paths, mapping) = self.told_paths(prim, name)?;
        let find = |path: &String| {
            let (at, name) = self.mapped(path, mapping)?;
            Some((self.copied(prim, at), name))
        };
        Ok(paths.iter().map(find).collect())
    }

    fn vectors(&mut self, value: Value, width: usize, most: u64) -> Result<Vec<f64>, Fault> {
        self.list(value, width, most)?;
        given(&self.vectors[&(value.0, width)], most.saturating_mul(width as u64), &mut self.allowance)
    }

    fn reserve(&mut self, count: u64, size: u64) -> Result<(), Fault> {
        self.allowance.take(count, size).map(|_| ())
    }

    fn tokens(&mut self, value: Value, most: usize) -> Result<Vec<String>, Fault> {
        if value.0 == NOTHING.0 {
            return Ok(Vec::new());
        }
        if !self.tokens.contains_key(&value.0) {
            let (source, inner, _) = self.of(value)?;
            let names = source.tokens(inner, most)?;
            self.tokens.insert(value.0, names);
        }
        let names = &self.tokens[&value.0];
        self.allowance.take(names.iter().map(|name| name.len() as u64).sum(), 1)?;
        given(names, most as u64, &mut self.allowance)
    }
}

impl Values for Composite<'_> {
    fn numbers(&mut self, value: Value) -> Result<Vec<f64>, Fault> {
        if value.0 & IS_ELEMENT == 0 {
            let (source, value, _) = self.of(value)?;
            return source.numbers(value);
        }
        let width = if value.0 >> 62 & 1 == 1 { 4 } else { 3 };
        let (index, list) = ((value.0 >> ELEMENT & 0x3fff) as usize, value.0 & ((1 << ELEMENT) - 1));
        let list = self.vectors.get(&(list, width)).and_then(|list| list.get(width * index..width * (index + 1)));
        list.map(<[f64]>::to_vec)
            .ok_or_else(|| damaged("an instancer says of fewer instances where they are than there are"))
    }

    fn integers(&mut self, value: Value, most: u64) -> Result<Vec<i32>, Fault> {
        if !self.integers.contains_key(&value.0) {
            let (source, inner, _) = self.of(value)?;
            let list = source.integers(inner, most)?;
            self.integers.insert(value.0, list);
        }
        given(&self.integers[&value.0], most, &mut self.allowance)
    }

    fn points(&mut self, value: Value) -> Result<Points, Fault> {
        let (source, value, layer) = self.of(value)?;
        let points = source.points(value)?;
        if points.start >> LAYER != 0 {
            return Err(damaged("an offset leads out of the file"));
        }
        Ok(Points { start: points.start | (layer as u64) << LAYER, ..points })
    }

    fn read(&mut self, points: Points, out: &mut [f64]) -> Result<bool, Fault> {
        let (layer, start) = ((points.start >> LAYER) as usize, points.start & ((1 << LAYER) - 1));
        self.layers[layer].layer.source.read(Points { start, ..points }, out)
    }
}
