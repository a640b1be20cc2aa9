//! Where the bytes of views are: in the binary chunk, in a `data:` URI, or packed.

use std::borrow::Cow;
use std::cell::{Cell, OnceCell};
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::{Component, Path};

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::{Index, Root, deserialize};
use percent_encoding::percent_decode_str;
use serde_json::json;

use super::container::split;
use super::document::{Document, document};
use super::draco::unpack;
use super::faults::{damaged, item, too_large};
use super::materials::Look;
use super::meshopt::Packed;
use crate::error::Fault;
use crate::text::quoted;

/// Bytes of memory that any file may take, and those beyond for each of its bytes: nodes repeat
/// meshes, and primitives accessors, in a few bytes each, so that small files may hold much.
const MEMORY_OF_ANY_FILE: usize = 1 << 29;
const MEMORY_PER_BYTE: usize = 32;

/// Zeros of sparse accessors, which the file does not hold, and those beyond for each byte.
const ZEROS_OF_ANY_FILE: usize = 1 << 16;
const ZEROS_PER_BYTE: usize = 2;

/// The files' padding is not always whole.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

pub(super) struct Buffers<'a> {
    pub(super) root: Root,
    bytes: Cow<'a, [u8]>,
    binary: Range<usize>,
    /// By buffer: what its `data:` URI holds, once it was asked for.
    decoded: Vec<OnceCell<Vec<u8>>>,
    /// By view: what was packed.
    unpacked: Vec<OnceCell<Vec<u8>>>,
    taken: Cell<usize>,
    /// The number of the frame at 0 s and frames per second, where the file says them.
    pub(super) frame_numbers: Option<[f64; 2]>,
    pub(super) materials: Vec<Look>,
    file: usize,
}

impl<'a> Buffers<'a> {
    /// Those of a `.glb` file, or of a `.gltf` file whose other files lie in a folder.
    pub(super) fn open(bytes: impl Into<Cow<'a, [u8]>>, source: &Source<'_>) -> Result<Self, Fault> {
        let bytes: Cow<'a, [u8]> = bytes.into();
        let (json, binary) = if source.is_text { (&*bytes, 0..0) } else { split(&bytes)? };
        let Document { root, frame_numbers, materials } = document(json)?;
        let others = match source.folder {
            Some(folder) => others(&root, folder)?,
            None => Vec::new(),
        };
        let file = bytes.len() + others.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
        let mut buffers = Self {
            decoded: vec![OnceCell::new(); root.buffers.len()],
            unpacked: vec![OnceCell::new(); root.buffer_views.len()],
            root,
            bytes,
            binary,
            taken: Cell::new(0),
            frame_numbers,
            materials,
            file,
        };
        others.into_iter().for_each(|(k, bytes)| drop(buffers.decoded[k].set(bytes)));
        unpack(&mut buffers)?;
        Ok(buffers)
    }

    /// Adds a buffer in which accessors have their numbers.
    pub(super) fn append(&mut self, bytes: Vec<u8>, accessors: &[(usize, Range<usize>)]) -> Result<(), Fault> {
        let wrong = |cause: gltf::json::Error| Fault::damaged(cause.to_string());
        let buffer = self.root.buffers.len();
        self.taken.set(self.taken.get() + bytes.len());
        let told = deserialize::from_value(json!({ "byteLength": bytes.len() })).map_err(wrong)?;
        self.root.buffers.push(told);
        self.decoded.push(bytes.into());
        for (accessor, range) in accessors {
            let view = json!({ "buffer": buffer, "byteOffset": range.start, "byteLength": range.len() });
            self.root.buffer_views.push(deserialize::from_value(view).map_err(wrong)?);
            self.unpacked.push(OnceCell::new());
            if let Some(accessor) = self.root.accessors.get_mut(*accessor) {
                accessor.buffer_view = Some(Index::new(self.root.buffer_views.len() as u32 - 1));
                accessor.byte_offset = None;
            }
        }
        Ok(())
    }

    /// Bytes that what is read of the file may take.
    pub(super) fn most_bytes(&self) -> usize {
        MEMORY_OF_ANY_FILE.saturating_add(MEMORY_PER_BYTE.saturating_mul(self.file))
    }

    /// Numbers that may be read without being there.
    pub(super) fn most_zeros(&self) -> usize {
        ZEROS_OF_ANY_FILE.saturating_add(ZEROS_PER_BYTE.saturating_mul(self.file))
    }

    /// The bytes of a view, and its stride where it has one.
    pub(super) fn view(&self, index: usize, place: &str) -> Result<(&[u8], Option<usize>), Fault> {
        let view = item(&self.root.buffer_views, "bufferView", index)?;
        let stride = view.byte_stride.map(|stride| stride.0).filter(|&stride| stride > 0);
        let Some(packed) = Packed::of(view) else {
            let offset = view.byte_offset.map_or(0, |offset| offset.0);
            return Ok((self.part(view.buffer.value(), offset, view.byte_length.0, place)?, stride));
        };
        let cell = &self.unpacked[index];
        if cell.get().is_none() {
            let wrong = || damaged(place, format!("the packed bufferView {index} is not understood"));
            let packed = packed.ok_or_else(wrong)?;
            let size = packed.size().ok_or_else(wrong)?;
            let taken =
                self.taken.get().checked_add(size).filter(|&taken| taken <= self.most_bytes()).ok_or_else(too_large)?;
            let stream = self.part(packed.buffer, packed.offset, packed.length, place)?;
            let unpacked = packed.unpack(stream).ok_or_else(wrong)?;
            cell.get_or_init(|| unpacked);
            self.taken.set(taken);
        }
        Ok((cell.get().map_or(&[], Vec::as_slice), stride))
    }

    fn part(&self, buffer: usize, offset: u64, length: u64, place: &str) -> Result<&[u8], Fault> {
        let bytes = self.buffer(buffer, place)?;
        let range = || {
            let start = usize::try_from(offset).ok()?;
            bytes.get(start..start.checked_add(usize::try_from(length).ok()?)?)
        };
        range().ok_or_else(|| outside(place))
    }

    fn buffer(&self, index: usize, place: &str) -> Result<&[u8], Fault> {
        let buffer = item(&self.root.buffers, "buffer", index)?;
        if let Some(bytes) = self.decoded[index].get() {
            return Ok(bytes);
        }
        let Some(uri) = &buffer.uri else {
            if index == 0 {
                return Ok(&self.bytes[self.binary.clone()]);
            }
            return Err(Fault::unsupported(format!(
                "{place}: buffer {index} has no data of its own; export the mesh without compression"
            )));
        };
        let Some(data) = uri.strip_prefix("data:") else {
            return Err(Fault::unsupported(format!(
                "{place}: has its data in another file; export one self-contained .glb"
            )));
        };
        let text = data.split_once(";base64,").map(|(_, text)| text.trim_ascii());
        let wrong = || damaged(place, format!("the data: URI of buffer {index} is not base64"));
        let decoded = text.and_then(|text| BASE64.decode(text).ok()).ok_or_else(wrong)?;
        Ok(self.decoded[index].get_or_init(|| decoded))
    }
}

/// What is read: a `.gltf` file, which is text, or a `.glb`.
#[derive(Default)]
pub(crate) struct Source<'a> {
    pub(crate) is_text: bool,
    /// Where other files lie that may be read.
    pub(crate) folder: Option<&'a Path>,
    /// Whether points along seams are read as often as they are stored.
    pub(crate) is_split: bool,
}

/// What is in other files, by the numbers of buffers.
fn others(root: &Root, folder: &Path) -> Result<Vec<(usize, Vec<u8>)>, Fault> {
    let (mut found, mut room) = (Vec::new(), LARGEST);
    for (k, buffer) in root.buffers.iter().enumerate() {
        let Some(uri) = buffer.uri.as_ref().filter(|uri| !uri.starts_with("data:")) else { continue };
        let name = percent_decode_str(uri).decode_utf8_lossy().into_owned();
        let is_below = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
        if uri.contains(':') || name.is_empty() || !Path::new(&name).components().all(is_below) {
            return Err(Fault::unsupported(format!(
                "has its data in {}, which is not in its folder; export one self-contained .glb",
                quoted(uri.as_bytes())
            )));
        }
        let mut bytes = Vec::new();
        let read = File::open(folder.join(&name)).and_then(|file| file.take(room + 1).read_to_end(&mut bytes));
        read.map_err(|cause| {
            let name = quoted(name.as_bytes());
            Fault::damaged(format!("has its data in {name}, which cannot be read ({cause}); copy it beside the file"))
        })?;
        room = room.checked_sub(bytes.len() as u64).ok_or_else(too_long)?;
        found.push((k, bytes));
    }
    Ok(found)
}

/// Bytes that files may have together, as they are held in memory.
pub(super) const LARGEST: u64 = 1 << 31;

pub(super) fn too_long() -> Fault {
    Fault::unsupported(format!(
        "is larger than {} GiB, which glTF is read up to; export the mesh as Alembic or USD",
        LARGEST >> 30
    ))
}

pub(super) fn outside(place: &str) -> Fault {
    Fault::damaged(format!("{place}: reaches beyond the binary data; copy or export the file again"))
}
