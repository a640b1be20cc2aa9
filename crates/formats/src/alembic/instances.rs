//! Instances: objects that say which other one they are, taken for that one and all below it.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use cager_geometry::surface::Part;

use super::objects::{Archive, Kind, Object, too_deep};
use super::properties::{Kind as PropertyKind, find};
use crate::error::Fault;
use crate::scene::{Allowance, MeshTracks, Node, shown, shown_path};

/// Bytes of the path of what an instance is of, and instances that are of each other in a row.
const LONGEST_PATH: u64 = 4096;
const MOST_IN_A_ROW: usize = 32;
/// Objects that an archive may have of what it holds once.
const MOST_COPIES: usize = 1 << 17;
/// Bytes that meshes may take that are there once more: of any archive, and for each byte of it.
const ROOM: u64 = 1 << 28;
const ROOM_PER_BYTE: u64 = 64;
/// Bytes of a sample, of a point, and of each byte of faces, which are read several times.
const SAMPLE: u64 = 16;
const POINT: u64 = 64;
const FACES: u64 = 8;

impl Archive<'_> {
    /// Puts what instances are in their place; gives those that are of nothing, in words.
    pub(super) fn expand_instances(&mut self) -> Result<Vec<String>, Fault> {
        if self.objects.iter().all(|object| object.kind != Kind::Instance) {
            return Ok(Vec::new());
        }
        let sources = self.sources()?;
        let (nodes, objects) = (std::mem::take(&mut self.nodes), std::mem::take(&mut self.objects));
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
        let (mut waiting, mut copies) = (Vec::new(), 0);
        // Of each instance how often it is there, and the first place.
        let mut missing: BTreeMap<usize, (usize, String)> = BTreeMap::new();
        for (k, node) in nodes.iter().enumerate() {
            match node.parent {
                Some(parent) => children[parent].push(k),
                None => waiting.push((k, None, false)),
            }
        }
        waiting.reverse();
        while let Some((original, parent, is_within)) = waiting.pop() {
            let chain = std::iter::successors(Some(original), |k| sources.get(k)?.as_ref().ok().copied());
            let of = chain.take(MOST_IN_A_ROW).last().unwrap_or(original);
            let is_missing = objects[of].kind == Kind::Instance;
            let is_copy = is_within || of != original;
            copies += usize::from(is_copy || is_missing);
            if copies > MOST_COPIES {
                return Err(too_many());
            }
            if is_missing {
                if let Some((count, _)) = missing.get_mut(&original) {
                    *count += 1;
                    continue;
                }
                let told = sources.get(&of).and_then(|told| told.as_ref().err());
                let source = told.map_or("itself", String::as_str);
                let path = shown_path(&nodes, original);
                let said = format!("{path} is an instance of {source}, which is not there, and is left out");
                missing.insert(original, (0, said));
                continue;
            }
            let depth = parent.map_or(1, |parent: usize| self.nodes[parent].depth + 1);
            if depth > super::objects::DEEPEST {
                return Err(too_deep());
            }
            waiting.extend(children[of].iter().rev().map(|&child| (child, Some(self.nodes.len()), is_copy)));
            self.nodes.push(Node { name: Arc::clone(&nodes[original].name), parent, depth });
            self.objects.push(Object { is_copy, ..objects[of] });
        }
        let said = |(more, said)| match more {
            0 => said,
            _ => format!("{said}, {more} more times in copies of what it lies below"),
        };
        Ok(missing.into_values().map(said).collect())
    }

    /// Which object each instance is, or the path of what is not there.
    fn sources(&mut self) -> Result<HashMap<usize, Result<usize, String>>, Fault> {
        let places: HashMap<(Option<usize>, Arc<[u8]>), usize> =
            self.nodes.iter().enumerate().map(|(k, node)| ((node.parent, Arc::clone(&node.name)), k)).collect();
        let mut sources = HashMap::new();
        for instance in (0..self.objects.len()).filter(|&k| self.objects[k].kind == Kind::Instance).collect::<Vec<_>>()
        {
            let properties = self.top_properties(instance)?;
            let path = match find(&properties, ".instanceSource", PropertyKind::Scalar).filter(|told| told.samples > 0)
            {
                Some(told) => told.small(&mut self.container, LONGEST_PATH)?,
                None => Vec::new(),
            };
            let path = path.strip_suffix(b"\0").unwrap_or(&path);
            let names = path.strip_prefix(b"/").into_iter().flat_map(|names| names.split(|&byte| byte == b'/'));
            let found = names
                .into_iter()
                .try_fold(None, |parent, name| places.get(&(parent, Arc::from(name))).map(|&k| Some(k)));
            let missing = || if path.is_empty() { "nothing".to_owned() } else { shown(&String::from_utf8_lossy(path)) };
            sources.insert(instance, found.flatten().ok_or_else(missing));
        }
        Ok(sources)
    }
}

fn too_many() -> Fault {
    Fault::unsupported(
        "shows its meshes so many times, as instances, that they take far more than the file; make those real that \
         are meant, or choose some with --prim",
    )
}

/// What meshes may take that are there once more.
pub(super) struct Room {
    left: Allowance,
    /// Bytes that they took.
    pub(super) taken: u64,
}

impl Room {
    pub(super) fn of(archive: &Archive<'_>) -> Self {
        let left = archive.container.source.length.saturating_mul(ROOM_PER_BYTE).saturating_add(ROOM);
        Self { left: Allowance(left), taken: 0 }
    }

    /// Takes that of a mesh of so many points.
    pub(super) fn take(&mut self, archive: &mut Archive<'_>, mesh: &MeshTracks, points: u64) -> Result<(), Fault> {
        let mut bytes = points.saturating_mul(POINT);
        for faces in &mesh.faces {
            let stored =
                faces.still().map_or(Ok(0), |first| archive.container.sample(first).map(|block| block.length))?;
            bytes = bytes.saturating_add(stored.saturating_mul(FACES));
        }
        let faces = mesh.faces.iter().map(|faces| faces.times.len());
        let moved = mesh.chain.moving().map(<[f64]>::len);
        let samples: usize = faces.chain(moved).sum::<usize>() + mesh.positions.times.len() + mesh.shown.len();
        self.bytes(bytes.saturating_add((samples as u64).saturating_mul(SAMPLE)))
    }

    /// Takes that of what lies on the faces of a mesh.
    pub(super) fn take_part(&mut self, part: &Part, normals: usize) -> Result<(), Fault> {
        let sets = part.uv_sets.iter().map(|set| 8 * set.values.len() + 4 * set.corners.len());
        let colors = part.color_sets.iter().map(|set| 16 * set.values.len() + 4 * set.corners.len());
        let groups = part.groups.iter().map(|group| 4 * group.faces.len());
        let others = 4 * part.materials.len() + 12 * (normals + part.creases.len());
        self.bytes((sets.chain(colors).chain(groups).sum::<usize>() + others) as u64)
    }

    fn bytes(&mut self, bytes: u64) -> Result<(), Fault> {
        self.taken = self.taken.saturating_add(bytes);
        self.left.take(bytes, 1).map(|_| ()).map_err(|_| too_many())
    }
}
