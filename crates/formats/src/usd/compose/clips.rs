//! Values that a composed scene has in clips: they count as those of the layer that names the files,
//! before what lies below it.

use std::collections::HashMap;

use super::source::{Composite, NOTHING};
use super::{Builder, Name, Site};
use crate::error::Fault;
use crate::scene::{Track, Value};
use crate::usd::clips::Clips;
use crate::usd::layer::Attributes;

/// A sequence of files, and whose values it has.
pub(super) struct ClipSet {
    clips: Clips,
    /// The layer of each file.
    layers: Vec<usize>,
    /// Those sites of the prim that has it whose opinions count before its values.
    stronger: Vec<Site>,
}

/// A prim that has values in clips: in which sequence, and the prim above it where that has them too.
#[derive(Clone)]
pub(super) struct Clipped {
    set: usize,
    above: Option<usize>,
    name: Name,
}

impl Builder<'_> {
    /// Where a prim of these sites has values in clips; `unread` says that it names some that cannot be
    /// read.
    pub(super) fn clipped(
        &mut self,
        (parent, name): (Option<usize>, &Name),
        sites: &[Site],
        unread: &mut Option<&'static str>,
    ) -> Result<Option<Clipped>, Fault> {
        let told = |site: &Site| self.files.layers[site.layer].layer.prims[site.prim].clips.as_deref();
        let Some(strongest) = sites.iter().position(|site| told(site).is_some()) else {
            let set = parent.and_then(|parent| Some(self.clipped[parent].as_ref()?.set));
            return Ok(set.map(|set| Clipped { set, above: parent, name: Name::clone(name) }));
        };
        let (site, clips) = (sites[strongest], told(&sites[strongest]).cloned().unwrap_or_default());
        let plain =
            if self.files.has_folder() { clips.plain(|file| self.files.is_there(site.layer, file)) } else { None };
        let Some(mut clips) = plain else {
            *unread = Some("value clips");
            return Ok(None);
        };
        let mut layers = Vec::new();
        for file in &clips.files {
            let missing = || {
                let what = "is a value clip that is not there, or not below the folder of the layer";
                Fault::invalid(format!("{file}: {what}; put it there, or write all into one file with usdstitchclips"))
            };
            layers.push(self.files.open_clip(site.layer, file)?.ok_or_else(missing)?);
        }
        // The time codes of metadata are those of their layer.
        let moved = |time: f64| site.times.offset + site.times.scale * time;
        clips.active.iter_mut().chain(&mut clips.times).for_each(|pair| pair[0] = moved(pair[0]));
        self.sets.push(ClipSet { clips, layers, stronger: sites[..=strongest].to_vec() });
        Ok(Some(Clipped { set: self.sets.len() - 1, above: None, name: Name::clone(name) }))
    }
}

impl Composite<'_> {
    /// Whether a site of a prim counts before the values of its clips.
    pub(super) fn is_stronger(&self, clipped: &Clipped, site: Site) -> bool {
        let own = &self.sets[clipped.set].stronger;
        own.iter().any(|other| (other.layer, other.mapping) == (site.layer, site.mapping))
    }

    /// The values of an attribute in clips; none where none of these has any.
    pub(super) fn in_clips(&mut self, clipped: &Clipped, attribute: &str) -> Result<Track, Fault> {
        let set = &self.sets[clipped.set];
        let mut names = vec![clipped];
        while let Some(above) = names[names.len() - 1].above {
            let Some(above) = self.clipped[above].as_ref().filter(|above| above.set == clipped.set) else { break };
            names.push(above);
        }
        // The name of the first one is that of the prim of the scene.
        names.pop();
        let prim = set.clips.prim.trim_start_matches('/').split('/').map(|name| Name::from(name.as_bytes()));
        let path: Vec<Name> = prim.chain(names.iter().rev().map(|place| Name::clone(&place.name))).collect();
        let (active, layers) = (set.clips.active.clone(), set.layers.clone());
        self.reserve(active.len() as u64, 1)?;
        let mut tracks = HashMap::new();
        for layer in active.iter().map(|&[_, file]| layers[file as usize]) {
            if tracks.contains_key(&layer) {
                continue;
            }
            let loaded = &mut self.layers[layer];
            let own = match loaded.find(&path) {
                Some(prim) => loaded.layer.source.attribute(prim, attribute)?,
                None => Track::default(),
            };
            self.reserve(own.times.len() as u64, 16)?;
            tracks.insert(layer, own);
        }
        let mut track = Track::default();
        if tracks.values().all(|own| own.times.is_empty()) {
            return Ok(track);
        }
        for (k, &[start, file]) in active.iter().enumerate() {
            let begin = if k == 0 { f64::NEG_INFINITY } else { start };
            let end = active.get(k + 1).map_or(f64::INFINITY, |next| next[0]);
            let layer = layers[file as usize];
            let own = &tracks[&layer];
            let clips = &self.sets[clipped.set].clips;
            let file = &clips.files[file as usize];
            if own.times.is_empty() {
                // As after a value that is blocked: what is above it says whether it is shown.
                if attribute == "visibility" {
                    track.times.push(start);
                    track.values.push(NOTHING);
                    continue;
                }
                let what =
                    format!("has value clips of which {file} has no samples of {attribute}; write all into one file");
                return Err(Fault::unsupported(what));
            }
            let mapped = clips.mapped(&own.times, [begin, end], &mut self.allowance)?;
            let between = || {
                let what = format!("has value clips of which {file} begins or ends between two of its samples");
                Fault::unsupported(format!("{what}, which is not read; write all into one file"))
            };
            let mut values: Vec<(f64, Value)> = Vec::new();
            for (time, inside) in mapped {
                let (value, _, share) = own.at(inside).ok_or_else(between)?;
                values.push((time, if share == 0.0 { value } else { return Err(between()) }));
            }
            for (time, value) in values {
                track.times.push(time);
                let value = self.held(layer, value);
                track.values.push(value);
            }
        }
        Ok(track)
    }
}
