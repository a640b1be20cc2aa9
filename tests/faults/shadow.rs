//! What a disk holds for certain, beside what the system shows.
//!
//! A file's writes are durable after its own sync, a folder's new, renamed and removed entries after the folder's. A rename is
//! one step and durable with the folder it leads to. Files and folders are numbered as inodes are, so that a file written
//! through an old handle is found wherever it was moved to.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Written whole or not at all.
const SECTOR_BYTES: usize = 512;
/// What the system writes at once.
const BLOCK_BYTES: usize = 4096;

#[derive(Clone, Debug)]
enum Change {
    Write(u64, Vec<u8>),
    Length(u64),
}

#[derive(Debug)]
enum Node {
    File { durable: Vec<u8>, unsynced: Vec<Change> },
    Folder { live: BTreeMap<OsString, usize>, durable: BTreeMap<OsString, usize> },
}

type Place = (usize, OsString);

/// A change of folders that is not synced.
#[derive(Clone, Debug)]
struct Step {
    node: usize,
    from: Option<Place>,
    to: Option<Place>,
}

#[derive(Debug)]
pub(super) struct Shadow {
    root: PathBuf,
    /// The root is the first.
    nodes: Vec<Node>,
    steps: Vec<Step>,
}

impl Shadow {
    pub(super) fn new(root: &Path) -> io::Result<Self> {
        let mut shadow = Self { root: root.to_owned(), nodes: Vec::new(), steps: Vec::new() };
        shadow.take_in(root)?;
        Ok(shadow)
    }

    fn take_in(&mut self, path: &Path) -> io::Result<usize> {
        let node = self.nodes.len();
        if !path.is_dir() {
            self.nodes.push(Node::File { durable: fs::read(path)?, unsynced: Vec::new() });
            return Ok(node);
        }
        self.nodes.push(Node::Folder { live: BTreeMap::new(), durable: BTreeMap::new() });
        let mut entries = BTreeMap::new();
        for entry in fs::read_dir(path)? {
            let entry = entry?;
            entries.insert(entry.file_name(), self.take_in(&entry.path())?);
        }
        self.nodes[node] = Node::Folder { live: entries.clone(), durable: entries };
        Ok(node)
    }

    /// The node at a path; none outside the root.
    pub(super) fn find(&self, path: &Path) -> Option<usize> {
        path.strip_prefix(&self.root).ok()?.iter().try_fold(0, |node, name| match &self.nodes[node] {
            Node::Folder { live, .. } => live.get(name).copied(),
            Node::File { .. } => None,
        })
    }

    fn place(&self, path: &Path) -> Option<Place> {
        Some((self.find(path.parent()?)?, path.file_name()?.to_owned()))
    }

    fn live(&mut self, folder: usize) -> &mut BTreeMap<OsString, usize> {
        match &mut self.nodes[folder] {
            Node::Folder { live, .. } => live,
            Node::File { .. } => unreachable!("a file has no entries"),
        }
    }

    pub(super) fn create(&mut self, path: &Path, folder: bool) -> Option<usize> {
        let place = self.place(path)?;
        let node = self.nodes.len();
        self.nodes.push(if folder {
            Node::Folder { live: BTreeMap::new(), durable: BTreeMap::new() }
        } else {
            Node::File { durable: Vec::new(), unsynced: Vec::new() }
        });
        self.live(place.0).insert(place.1.clone(), node);
        self.steps.push(Step { node, from: None, to: Some(place) });
        Some(node)
    }

    pub(super) fn rename(&mut self, from: &Path, to: &Path) {
        let (Some(from), Some(to)) = (self.place(from), self.place(to)) else { return };
        let Some(node) = self.live(from.0).remove(&from.1) else { return };
        self.live(to.0).insert(to.1.clone(), node);
        self.steps.push(Step { node, from: Some(from), to: Some(to) });
    }

    pub(super) fn remove(&mut self, path: &Path) {
        let Some(place) = self.place(path) else { return };
        let Some(node) = self.live(place.0).remove(&place.1) else { return };
        self.steps.push(Step { node, from: Some(place), to: None });
    }

    pub(super) fn sync_dir(&mut self, path: &Path) {
        let Some(folder) = self.find(path) else { return };
        let leads_here = |step: &Step| step.to.as_ref().or(step.from.as_ref()).is_some_and(|place| place.0 == folder);
        while let Some(last) = self.steps.iter().position(leads_here) {
            // What came before with the same file or folder goes along.
            let node = self.steps[last].node;
            let mut index = 0;
            let (now, later) = std::mem::take(&mut self.steps).into_iter().partition(|step: &Step| {
                index += 1;
                index <= last + 1 && step.node == node
            });
            self.steps = later;
            self.settle(now);
        }
    }

    fn settle(&mut self, steps: Vec<Step>) {
        for Step { node, from, to } in steps {
            if let Some((folder, name)) = from
                && let Node::Folder { durable, .. } = &mut self.nodes[folder]
                && durable.get(&name) == Some(&node)
            {
                durable.remove(&name);
            }
            if let Some((folder, name)) = to
                && let Node::Folder { durable, .. } = &mut self.nodes[folder]
            {
                durable.insert(name, node);
            }
        }
    }

    fn change(&mut self, node: Option<usize>, change: Change) {
        if let Some(Node::File { unsynced, .. }) = node.map(|node| &mut self.nodes[node]) {
            unsynced.push(change);
        }
    }

    pub(super) fn write(&mut self, node: Option<usize>, offset: u64, bytes: &[u8]) {
        self.change(node, Change::Write(offset, bytes.to_vec()));
    }

    pub(super) fn set_len(&mut self, node: Option<usize>, bytes: u64) {
        self.change(node, Change::Length(bytes));
    }

    pub(super) fn sync(&mut self, node: Option<usize>) {
        if let Some(Node::File { durable, unsynced }) = node.map(|node| &mut self.nodes[node]) {
            unsynced.drain(..).for_each(|change| apply(durable, &change));
        }
    }

    /// A sync that failed: the system forgets what it should have written, and shows it all the same. The blocks it tried to
    /// write may hold nothing of use then, also where they had older bytes.
    pub(super) fn lose(&mut self, node: Option<usize>, ruin: bool) {
        let Some(Node::File { durable, unsynced }) = node.map(|node| &mut self.nodes[node]) else { return };
        for change in unsynced.drain(..) {
            if let Change::Write(offset, bytes) = change
                && ruin
            {
                let start = offset as usize / BLOCK_BYTES * BLOCK_BYTES;
                let end = (offset as usize + bytes.len()).next_multiple_of(BLOCK_BYTES).min(durable.len());
                durable.get_mut(start..end).unwrap_or_default().fill(0xdb);
            }
        }
    }

    /// Makes the folder what the disk holds: without everything unsynced, or torn by chance.
    pub(super) fn restore(&mut self, seed: Option<u64>) -> io::Result<()> {
        let mut chance = Chance(seed.unwrap_or(0));
        let steps = std::mem::take(&mut self.steps);
        let kept = if seed.is_some() { chance.below(steps.len() as u64 + 1) as usize } else { 0 };
        self.settle(steps.into_iter().take(kept).collect());
        for node in &mut self.nodes {
            match node {
                Node::File { durable, unsynced } => {
                    let lost = std::mem::take(unsynced);
                    if seed.is_some() {
                        tear(durable, &lost, &mut chance);
                    }
                }
                Node::Folder { live, durable } => *live = durable.clone(),
            }
        }
        for entry in fs::read_dir(&self.root)? {
            let path = entry?.path();
            if path.is_dir() { fs::remove_dir_all(path)? } else { fs::remove_file(path)? }
        }
        self.lay_out(0, &self.root)
    }

    fn lay_out(&self, node: usize, path: &Path) -> io::Result<()> {
        match &self.nodes[node] {
            Node::File { durable, .. } => fs::write(path, durable),
            Node::Folder { durable, .. } => {
                if node != 0 {
                    fs::create_dir(path)?;
                }
                durable.iter().try_for_each(|(name, &node)| self.lay_out(node, &path.join(name)))
            }
        }
    }
}

fn apply(file: &mut Vec<u8>, change: &Change) {
    match change {
        Change::Length(bytes) => file.resize(*bytes as usize, 0),
        Change::Write(offset, bytes) => {
            let (start, end) = (*offset as usize, *offset as usize + bytes.len());
            if file.len() < end {
                file.resize(end, 0);
            }
            file[start..end].copy_from_slice(bytes);
        }
    }
}

/// Keeps some of the changes, sector by sector.
fn tear(file: &mut Vec<u8>, changes: &[Change], chance: &mut Chance) {
    for change in changes {
        match change {
            Change::Length(_) if chance.below(2) == 0 => {}
            Change::Length(_) => apply(file, change),
            Change::Write(offset, bytes) => {
                let mut at = 0;
                while at < bytes.len() {
                    let here = *offset as usize + at;
                    let end = bytes.len().min(at + SECTOR_BYTES - here % SECTOR_BYTES);
                    if chance.below(2) == 0 {
                        apply(file, &Change::Write(here as u64, bytes[at..end].to_vec()));
                    }
                    at = end;
                }
            }
        }
    }
}

/// SplitMix64.
struct Chance(u64);

impl Chance {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }
}
