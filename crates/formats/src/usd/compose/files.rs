//! Files that layers name: opened once each, below the folder of the first, and no more than some.

use std::collections::HashMap;
use std::fs::File;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use crate::error::Fault;
use crate::scene::{Node, Reader};
use crate::usd::clips::MOST_CLIPS;
use crate::usd::layer::{Layer, Times};
use crate::usd::open_layer;
use crate::usd::reopened::Reopened;

/// Files of one scene, and how many name each other in a row.
pub(super) const MOST_FILES: usize = 256;
const DEEPEST: usize = 8;

/// Time codes per second where a layer does not say them.
const USUAL_RATE: f64 = 24.0;

pub(super) struct Loaded<'a> {
    pub(super) layer: Layer<'a>,
    /// The folder of its file, from that of the first one.
    folder: PathBuf,
    depth: usize,
    places: HashMap<(Option<usize>, Arc<[u8]>), usize>,
    children: HashMap<Option<usize>, Vec<usize>>,
}

impl<'a> Loaded<'a> {
    pub(super) fn new(layer: Layer<'a>, folder: PathBuf, depth: usize) -> Self {
        let (mut places, mut children) = (HashMap::new(), HashMap::<_, Vec<usize>>::new());
        for (k, Node { name, parent, depth }) in layer.nodes.iter().enumerate() {
            // What lies below a variant has no parent, but is not at the top.
            if parent.is_some() || *depth == 1 {
                places.insert((*parent, Arc::clone(name)), k);
                children.entry(*parent).or_default().push(k);
            }
        }
        Self { layer, folder, depth, places, children }
    }

    pub(super) fn child(&self, parent: Option<usize>, name: &[u8]) -> Option<usize> {
        self.places.get(&(parent, Arc::from(name))).copied()
    }

    pub(super) fn children(&self, parent: Option<usize>) -> &[usize] {
        self.children.get(&parent).map_or(&[], Vec::as_slice)
    }

    /// The prim of a path, name by name.
    pub(super) fn find(&self, names: &[Arc<[u8]>]) -> Option<usize> {
        names.iter().try_fold(None, |parent, name| self.child(parent, name).map(Some)).flatten()
    }

    pub(super) fn folder(&self) -> String {
        let names = self.folder.iter().map(|name| name.to_string_lossy());
        names.collect::<Vec<_>>().join("/")
    }

    fn rate(&self) -> f64 {
        let told = self.layer.stage.time_codes_per_second.or(self.layer.stage.frames_per_second);
        told.filter(|rate| rate.is_finite() && *rate > 0.0).unwrap_or(USUAL_RATE)
    }
}

/// A layer, and the stack that it is the strongest of, where there is one.
type Known = (usize, Option<usize>);

/// Layers, each with those below it, the strongest first.
pub(super) struct Files<'a> {
    pub(super) layers: Vec<Loaded<'a>>,
    pub(super) stacks: Vec<Vec<(usize, Times)>>,
    /// The folder of the first, where it is known.
    folder: Option<PathBuf>,
    known: HashMap<PathBuf, Known>,
    /// How many layers are clips.
    clips: usize,
    /// Bytes of all files.
    pub(super) length: u64,
}

impl<'a> Files<'a> {
    /// Of the first layer; none where one below it cannot be had.
    pub(super) fn new(layer: Layer<'a>, length: u64, folder: Option<&Path>) -> Result<Option<Self>, Fault> {
        let folder = folder.map(Path::to_owned);
        let mut files =
            Self { layers: Vec::new(), stacks: Vec::new(), folder, known: HashMap::new(), clips: 0, length };
        let stack = files.stack(Loaded::new(layer, PathBuf::new(), 0))?;
        Ok(stack.map(|_| files))
    }

    pub(super) fn has_folder(&self) -> bool {
        self.folder.is_some()
    }

    /// Whether a file that a layer names may be read.
    pub(super) fn is_there(&self, layer: usize, asset: &str) -> bool {
        let path = resolved(&self.layers[layer].folder, asset);
        self.folder.as_ref().zip(path).is_some_and(|(folder, path)| folder.join(path).is_file())
    }

    /// The layer of a clip that a layer names, without those below it; none where it is not there or
    /// may not be read.
    pub(super) fn open_clip(&mut self, layer: usize, asset: &str) -> Result<Option<usize>, Fault> {
        match self.load(layer, asset, true)? {
            None => Ok(None),
            Some(Ok((known, _))) => Ok(Some(known)),
            Some(Err((path, loaded))) => {
                let layer = self.layers.len();
                self.known.insert(path, (layer, Some(self.stacks.len())));
                self.stacks.push(vec![(layer, Times::default())]);
                self.layers.push(loaded);
                self.clips += 1;
                Ok(Some(layer))
            }
        }
    }

    /// The stack of a file that a layer names, and by how much faster its time codes pass; none
    /// where it is not there or may not be read.
    pub(super) fn open(&mut self, layer: usize, asset: &str) -> Result<Option<(usize, f64)>, Fault> {
        let Some(loaded) = self.load(layer, asset, false)? else { return Ok(None) };
        let stack = match loaded {
            Ok((_, stack)) => stack,
            Err((path, loaded)) => {
                let top = self.layers.len();
                let stack = self.stack(loaded)?;
                self.known.insert(path, (top, stack));
                stack
            }
        };
        let rates = |stack: usize| self.layers[layer].rate() / self.layers[self.stacks[stack][0].0].rate();
        Ok(stack.map(|stack| (stack, rates(stack))))
    }

    /// A file that is not known yet, or one that is.
    #[allow(clippy::type_complexity)]
    fn load(
        &mut self,
        from: usize,
        asset: &str,
        is_clip: bool,
    ) -> Result<Option<Result<Known, (PathBuf, Loaded<'a>)>>, Fault> {
        let Loaded { folder: base, depth, .. } = &self.layers[from];
        let (Some(folder), Some(path)) = (&self.folder, resolved(base, asset)) else { return Ok(None) };
        if let Some(known) = self.known.get(&path) {
            return Ok(Some(Ok(*known)));
        }
        let is_full = if is_clip { self.clips == MOST_CLIPS } else { self.layers.len() - self.clips == MOST_FILES };
        if *depth == DEEPEST || is_full {
            return Err(Fault::unsupported(format!(
                "is composed of more than {MOST_FILES} files or {MOST_CLIPS} value clips, or of files that name each \
                 other more than {DEEPEST} times in a row; write all into one file"
            )));
        }
        // Before it is opened, as a pipe would wait.
        if !folder.join(&path).is_file() {
            return Ok(None);
        }
        let Ok(file) = File::open(folder.join(&path)) else { return Ok(None) };
        let found = file.metadata()?;
        // As many files as clips are cannot be open at once.
        let source: Reader<'a> = if is_clip { Box::new(Reopened::new(folder.join(&path))) } else { Box::new(file) };
        let name = path.display().to_string();
        let (layer, _) = open_layer(source, found.len(), false).map_err(|fault| fault.within(&name))?.0;
        self.length = self.length.saturating_add(found.len());
        let loaded = Loaded::new(layer, path.parent().unwrap_or(Path::new("")).to_owned(), depth + 1);
        Ok(Some(Err((path, loaded))))
    }

    /// Adds a layer and those below it.
    fn stack(&mut self, loaded: Loaded<'a>) -> Result<Option<usize>, Fault> {
        let top = self.layers.len();
        self.layers.push(loaded);
        let mut stack = Vec::new();
        let whole = self.add_to(&mut stack, (top, Times::default()))?;
        self.stacks.push(stack);
        Ok(Some(self.stacks.len() - 1).filter(|_| whole))
    }

    fn add_to(&mut self, stack: &mut Vec<(usize, Times)>, (layer, times): (usize, Times)) -> Result<bool, Fault> {
        stack.push((layer, times));
        let mut whole = true;
        for (asset, own) in self.layers[layer].layer.stage.sublayers.clone() {
            let below = match self.load(layer, &asset, false)? {
                Some(Err((path, loaded))) => {
                    let below = self.layers.len();
                    self.layers.push(loaded);
                    self.known.insert(path, (below, None));
                    below
                }
                // One that is below two, or a reference too, is read twice by no program.
                _ => {
                    whole = false;
                    continue;
                }
            };
            let scale = self.layers[layer].rate() / self.layers[below].rate();
            let Some(times) = within(times, own, scale) else {
                whole = false;
                continue;
            };
            whole &= self.add_to(stack, (below, times))?;
        }
        Ok(whole)
    }
}

/// Times of a layer as those around it count them; none where they would not ascend.
pub(super) fn within(outer: Times, inner: Times, rate: f64) -> Option<Times> {
    let scale = outer.scale * inner.scale * rate;
    let offset = outer.offset + outer.scale * inner.offset;
    (scale.is_finite() && scale > 0.0 && offset.is_finite()).then_some(Times { offset, scale })
}

/// The path of a file that a layer in a folder names, where it lies below that of the first one.
fn resolved(base: &Path, asset: &str) -> Option<PathBuf> {
    let asset = asset.replace('\\', "/");
    // With a protocol, a drive or a place in a package.
    if asset.is_empty() || asset.starts_with('/') || asset.contains([':', '[', '\0']) {
        return None;
    }
    let mut path = base.to_owned();
    for part in Path::new(&asset).components() {
        match part {
            Component::Normal(name) => path.push(name),
            Component::ParentDir => {
                if !path.pop() {
                    return None;
                }
            }
            Component::CurDir => {}
            _ => return None,
        }
    }
    Some(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_lie_below_the_folder_of_the_first() {
        let at = |asset: &str| resolved(Path::new("a"), asset);
        assert_eq!(at("./b/c.usd"), Some(PathBuf::from("a/b/c.usd")));
        assert_eq!(at("../c.usd"), Some(PathBuf::from("c.usd")));
        for outside in ["../../c.usd", "/c.usd", "https://a/c.usd", "C:/c.usd", "a.usdz[c.usd]", ""] {
            assert_eq!(at(outside), None, "{outside}");
        }
    }
}
