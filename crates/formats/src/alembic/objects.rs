//! The tree of objects of an archive: what each is called, what it is, what it lies below.

use std::sync::Arc;

use super::ogawa::{Container, DATA};
use super::sampling::Sampling;
use crate::error::Fault;
use crate::frames::nominal;
use crate::scene::{Fields, Node, Reader, damaged};

/// Objects of an archive, and how deep they nest; programs write far fewer.
const MOST_OBJECTS: usize = 1 << 20;
pub(super) const DEEPEST: usize = 256;
/// Bytes at the end of the headers of a group's objects that tell its contents apart from others.
const HASHES: usize = 32;
/// In place of an index of metadata that is told beside it.
pub(super) const INLINE: usize = 0xff;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A polygon mesh.
    Mesh,
    /// The control mesh of a subdivision surface.
    Subdivision,
    Transform,
    /// Another object once more.
    Instance,
    /// Faces of a mesh, for a material of their own.
    FaceSet,
    Other,
}

impl Kind {
    fn of(metadata: &[u8]) -> Self {
        let schema = told(metadata, b"schema").unwrap_or_default();
        match schema {
            _ if told(metadata, b"isInstance") == Some(b"1") => Self::Instance,
            _ if schema.starts_with(b"AbcGeom_PolyMesh_") => Self::Mesh,
            _ if schema.starts_with(b"AbcGeom_SubD_") => Self::Subdivision,
            _ if schema.starts_with(b"AbcGeom_Xform_") => Self::Transform,
            _ if schema.starts_with(b"AbcGeom_FaceSet_") => Self::FaceSet,
            _ => Self::Other,
        }
    }
}

/// What metadata `key=value;key=value` say of a key.
pub(super) fn told<'a>(metadata: &'a [u8], key: &[u8]) -> Option<&'a [u8]> {
    metadata.split(|&b| b == b';').find_map(|entry| entry.strip_prefix(key)?.strip_prefix(b"="))
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Object {
    pub(super) kind: Kind,
    pub(super) group: u64,
    /// Whether it is another one once more, or within such.
    pub(super) is_copy: bool,
}

/// An archive without the contents of its objects.
pub(super) struct Archive<'a> {
    pub(super) container: Container<'a>,
    pub(super) samplings: Vec<Sampling>,
    /// What headers say by an index, the first of which says that there are none.
    pub(super) metadata: Vec<Arc<[u8]>>,
    /// Frames per second of the program that wrote it.
    pub(super) frame_rate: Option<f64>,
    /// Each comes before what lies below it, and that before its next sibling.
    pub(super) nodes: Vec<Node>,
    pub(super) objects: Vec<Object>,
}

impl<'a> Archive<'a> {
    pub(super) fn open(source: Reader<'a>, length: u64) -> Result<Self, Fault> {
        let (mut container, root) = Container::open(source, length)?;
        let children = container.children(root)?;
        let &[_, _, top, information, times, metadata, ..] = children.as_slice() else {
            return Err(damaged("it has no contents"));
        };
        let frame_rate = frame_rate(&container.contents(information)?);
        let samplings = Sampling::table(&container.contents(times)?)?;
        let metadata = container.contents(metadata)?;
        let metadata = texts(&metadata)?;
        let kinds: Vec<Kind> = metadata.iter().map(|text| Kind::of(text)).collect();
        let (mut nodes, mut objects) = (Vec::new(), Vec::new());
        // Objects that are yet to be entered, the next one last.
        let mut waiting = children_of(&mut container, (top, None, 1), &kinds)?;
        while let Some((node, object)) = waiting.pop() {
            if object.group & DATA == 0 {
                let place = (object.group, Some(objects.len()), node.depth + 1);
                waiting.extend(children_of(&mut container, place, &kinds)?);
            }
            nodes.push(node);
            objects.push(object);
            if objects.len() + waiting.len() > MOST_OBJECTS {
                return Err(too_many());
            }
        }
        // What follows reads the properties of some objects, some of them twice.
        container.allow(4);
        Ok(Self { container, samplings, metadata, frame_rate, nodes, objects })
    }

    /// The sets of faces of a mesh.
    pub(super) fn sets(&self, mesh: usize) -> Vec<usize> {
        let below = (mesh + 1..self.nodes.len()).take_while(|&k| self.nodes[k].depth > self.nodes[mesh].depth);
        below.filter(|&k| self.objects[k].kind == Kind::FaceSet && self.nodes[k].parent == Some(mesh)).collect()
    }
}

/// The fault of objects within objects, more than programs write.
pub(super) fn too_deep() -> Fault {
    let what = format!("nests deeper than {DEEPEST}; export the mesh alone, without what it lies below");
    Fault::unsupported(what)
}

fn too_many() -> Fault {
    Fault::unsupported(format!("has more than {MOST_OBJECTS} objects; export the mesh alone"))
}

/// The objects that a group has, the last one first.
fn children_of(
    container: &mut Container<'_>,
    (group, parent, depth): (u64, Option<usize>, usize),
    kinds: &[Kind],
) -> Result<Vec<(Node, Object)>, Fault> {
    let children = container.children(group)?;
    // The first are its own properties, the last are the headers of the others.
    let [_, groups @ .., headers] = children.as_slice() else { return Ok(Vec::new()) };
    if headers & DATA == 0 || groups.is_empty() {
        return Ok(Vec::new());
    }
    if depth > DEEPEST {
        return Err(too_deep());
    }
    if groups.len() > MOST_OBJECTS {
        return Err(too_many());
    }
    let headers = container.contents(*headers)?;
    let mut fields = Fields(&headers[..headers.len().saturating_sub(HASHES)]);
    let mut objects = Vec::new();
    for &group in groups {
        let name = Arc::from(fields.sized(2)?);
        let kind = match fields.short(0)? {
            INLINE => Kind::of(fields.sized(2)?),
            index => *kinds.get(index).ok_or_else(|| damaged("an object has metadata that are not there"))?,
        };
        objects.push((Node { name, parent, depth }, Object { kind, group, is_copy: false }));
    }
    objects.reverse();
    Ok(objects)
}

/// The texts of a table of metadata, behind an empty one.
fn texts(table: &[u8]) -> Result<Vec<Arc<[u8]>>, Fault> {
    let (mut fields, mut texts) = (Fields(table), vec![Arc::default()]);
    while !fields.0.is_empty() {
        texts.push(Arc::from(fields.sized(0)?));
    }
    Ok(texts)
}

/// What programs write beside each other as `key=value;key=value`.
fn frame_rate(information: &[u8]) -> Option<f64> {
    let text = String::from_utf8_lossy(information);
    let value = |key: &str| text.split(';').find_map(|entry| entry.trim().strip_prefix(key)?.strip_prefix('='));
    let told = ["_ai_DCC_FPS", "FramesPerTimeUnit"].into_iter().find_map(value)?;
    told.trim().parse().ok().filter(|rate: &f64| (1e-3..1e6).contains(rate)).map(nominal)
}
