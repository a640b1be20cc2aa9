//! Where the bytes of views are: in the binary chunk, in a `data:` URI, or packed.

use std::cell::{Cell, OnceCell};

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::Root;

use super::faults::{dangling, too_large};
use super::meshopt::Packed;
use crate::error::Fault;

/// Bytes that packed views of any file may have.
const UNPACKED_FREE: usize = 1 << 20;
/// Those beyond, for each byte of the file.
const UNPACKED_PER_BYTE: usize = 24;

/// The files' padding is not always whole.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

pub(super) struct Buffers<'a> {
    pub(super) root: &'a Root,
    binary: &'a [u8],
    /// By buffer: what its `data:` URI holds, once it was asked for.
    decoded: Vec<OnceCell<Vec<u8>>>,
    /// By view: what was packed.
    unpacked: Vec<OnceCell<Vec<u8>>>,
    /// Bytes that were unpacked, and that may be at the most.
    taken: Cell<usize>,
    most: usize,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(root: &'a Root, binary: &'a [u8], file: usize) -> Self {
        Self {
            root,
            binary,
            decoded: vec![OnceCell::new(); root.buffers.len()],
            unpacked: vec![OnceCell::new(); root.buffer_views.len()],
            taken: Cell::new(0),
            most: UNPACKED_FREE + UNPACKED_PER_BYTE * file,
        }
    }

    /// Unpacks what an accessor reads, and gives the bytes that were unpacked up to now; what is wrong with it is told when it is read.
    pub(super) fn unpack_for(&self, accessor: usize) -> usize {
        if let Some(view) = self.root.accessors.get(accessor).and_then(|accessor| accessor.buffer_view) {
            let _ = self.view(view.value(), "");
        }
        self.taken.get()
    }

    /// The bytes of a view, and its stride where it has one.
    pub(super) fn view(&self, index: usize, place: &str) -> Result<(&[u8], Option<usize>), Fault> {
        let views = &self.root.buffer_views;
        let view = views.get(index).ok_or_else(|| dangling(&format!("bufferView {index}"), views.len()))?;
        let stride = view.byte_stride.map(|stride| stride.0);
        let Some(packed) = Packed::of(view) else {
            let offset = view.byte_offset.map_or(0, |offset| offset.0);
            return Ok((self.part(view.buffer.value(), offset, view.byte_length.0, place)?, stride));
        };
        let cell = &self.unpacked[index];
        if cell.get().is_none() {
            let damaged = || {
                Fault::damaged(format!(
                    "{place}: the packed bufferView {index} is not understood; export the mesh again"
                ))
            };
            let packed = packed.ok_or_else(damaged)?;
            let size = packed.size().ok_or_else(damaged)?;
            let taken = self.taken.get().checked_add(size).filter(|&taken| taken <= self.most).ok_or_else(too_large)?;
            let stream = self.part(packed.buffer, packed.offset, packed.length, place)?;
            let unpacked = packed.unpack(stream).ok_or_else(damaged)?;
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
        let buffers = &self.root.buffers;
        let buffer = buffers.get(index).ok_or_else(|| dangling(&format!("buffer {index}"), buffers.len()))?;
        let Some(uri) = &buffer.uri else {
            if index == 0 {
                return Ok(self.binary);
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
        let cell = &self.decoded[index];
        if cell.get().is_none() {
            let text = data.split_once(";base64,").map(|(_, text)| text.trim_ascii());
            let decoded = text.and_then(|text| BASE64.decode(text).ok()).ok_or_else(|| {
                Fault::damaged(format!("{place}: the data: URI of buffer {index} is not base64; export the mesh again"))
            })?;
            cell.get_or_init(|| decoded);
        }
        Ok(cell.get().map_or(&[], Vec::as_slice))
    }
}

pub(super) fn outside(place: &str) -> Fault {
    Fault::damaged(format!("{place}: reaches beyond the binary data; copy or export the file again"))
}
