//! Everything of fixed size: the prelude, section headers and the footer.

use super::{Error, MAGIC, MAX_HEADER_BYTES, VERSION, tag};
use crate::le::value_at;

pub(crate) const PRELUDE_BYTES: usize = 16;
pub(crate) const HEADER_BYTES: usize = 40;
pub(crate) const FOOTER_BYTES: usize = 24;
/// Bytes of one entry of the table of contents: an offset and a header without its checksums.
pub(crate) const ENTRY_BYTES: usize = 40;
const FOOTER_MAGIC: [u8; 4] = *b"CGRE";

/// Codecs: the bytes as they are.
pub(crate) const RAW: u8 = 0;
/// Byte planes of the elements, then zstd.
pub(crate) const PLANES: u8 = 1;
/// Differences of 32-bit words one stride apart, zigzag-coded, then byte planes and zstd.
pub(crate) const DIFFERENCE: u8 = 2;
/// Whole numbers by `cager-codec` of a group of frames: cages or residual.
pub(crate) const CODED: u8 = 3;
/// Whole numbers of a mesh at rest or of the errors of frames.
pub(crate) const CODED_STATIC: u8 = 4;

/// Whether a section is whole numbers.
pub(crate) fn is_coded(codec: u8) -> bool {
    [CODED, CODED_STATIC].contains(&codec)
}

/// The header before every section's payload, without its checksums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SectionHeader {
    pub(crate) tag: [u8; 4],
    pub(crate) codec: u8,
    /// Bytes of one element of the raw data: what the byte planes are split by.
    pub(crate) width: u8,
    /// For frame chunks, the first frame and their number.
    pub(crate) first: u32,
    pub(crate) count: u32,
    pub(crate) payload_bytes: u64,
    pub(crate) raw_bytes: u64,
}

impl SectionHeader {
    /// What all layers of edits may decode to, by the length of the file.
    pub(crate) const LAYERS_TIMES: u64 = 16;
    pub(crate) const LAYERS_MORE: u64 = 8 << 20;

    /// Of a section as it is usually written, before its bytes are counted.
    pub(crate) fn new(tag: [u8; 4], (first, count): (u32, u32)) -> Self {
        let (codec, width) = layout(tag);
        Self { tag, codec, width, first, count, payload_bytes: 0, raw_bytes: 0 }
    }

    fn to_bytes(self) -> Vec<u8> {
        [
            &self.tag[..],
            &[self.codec, self.width, 0, 0],
            &self.first.to_le_bytes(),
            &self.count.to_le_bytes(),
            &self.payload_bytes.to_le_bytes(),
            &self.raw_bytes.to_le_bytes(),
        ]
        .concat()
    }

    fn from_bytes(b: &[u8]) -> Self {
        Self {
            tag: [b[0], b[1], b[2], b[3]],
            codec: b[4],
            width: b[5],
            first: value_at(b, 8, u32::from_le_bytes),
            count: value_at(b, 12, u32::from_le_bytes),
            payload_bytes: value_at(b, 16, u64::from_le_bytes),
            raw_bytes: value_at(b, 24, u64::from_le_bytes),
        }
    }

    /// The bytes before a payload with this checksum.
    pub(crate) fn sealed(self, payload_crc: u32) -> Vec<u8> {
        sealed(&[&self.to_bytes(), &payload_crc.to_le_bytes()])
    }

    /// The header before a payload, and the payload's checksum.
    pub(crate) fn unsealed(b: &[u8; HEADER_BYTES], offset: u64) -> Result<(Self, u32), Error> {
        if !is_sealed(b) {
            return Err(Error::corrupt(offset, "the checksum of a section's header does not match"));
        }
        if b[6..8] != [0, 0] {
            return Err(Error::corrupt(offset + 6, "reserved bytes are not zero"));
        }
        Ok((Self::from_bytes(b), value_at(b, 32, u32::from_le_bytes)))
    }

    /// Most bytes that a section may decode to in a file of this length, see `docs/FORMAT.md`.
    pub(crate) fn most_raw_bytes(tag: [u8; 4], codec: u8, file_bytes: u64) -> u64 {
        let (times, more) = match tag {
            tag::HEADER => return MAX_HEADER_BYTES as u64,
            // Decoding whole numbers takes several times the memory of the result.
            _ if is_coded(codec) => (16, 2 << 20),
            // Two bytes of JSON may become an empty text of 24 bytes.
            tag::REPORT => (16, 4 << 20),
            tag::EDIT => (Self::LAYERS_TIMES, Self::LAYERS_MORE),
            _ => (48, 12 << 20),
        };
        file_bytes.saturating_mul(times).saturating_add(more)
    }

    /// Whether a reader that does not know the section must refuse the file.
    pub(crate) fn is_required(self) -> bool {
        !self.tag[0].is_ascii_lowercase()
    }

    /// The frames of a chunk.
    pub(crate) fn frames(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }
}

/// The codec by which a section is written, and the bytes of one of its numbers.
fn layout(tag: [u8; 4]) -> (u8, u8) {
    match tag {
        tag::REST_FACES | tag::CAGE_FACES | tag::FRAMES => (DIFFERENCE, 4),
        tag::ERRORS | tag::EDIT | tag::COMPONENTS => (PLANES, 4),
        tag::REST_COLORS | tag::SURFACE | tag::ELEMENTS | tag::REPORT => (PLANES, 1),
        tag::REST_POINTS | tag::CAGE_VERTICES => (PLANES, 4),
        tag::NUMBERS => (PLANES, 8),
        tag::ORIGIN => (RAW, 8),
        _ => (RAW, 1),
    }
}

/// A section, and where it begins.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub(super) offset: u64,
    pub(super) header: SectionHeader,
}

impl Entry {
    /// The line of the table of contents.
    pub(super) fn to_bytes(self) -> Vec<u8> {
        [&self.offset.to_le_bytes()[..], &self.header.to_bytes()].concat()
    }

    pub(super) fn from_bytes(b: &[u8]) -> Self {
        Self { offset: value_at(b, 0, u64::from_le_bytes), header: SectionHeader::from_bytes(&b[8..]) }
    }

    /// Where the section after it begins.
    pub(super) fn end(&self) -> Option<u64> {
        self.offset.checked_add(HEADER_BYTES as u64)?.checked_add(self.header.payload_bytes)
    }
}

/// Bytes and their checksum.
fn sealed(parts: &[&[u8]]) -> Vec<u8> {
    let mut out = parts.concat();
    out.extend(crc32c::crc32c(&out).to_le_bytes());
    out
}

fn is_sealed(bytes: &[u8]) -> bool {
    let end = bytes.len() - 4;
    crc32c::crc32c(&bytes[..end]) == value_at(bytes, end, u32::from_le_bytes)
}

pub(crate) fn prelude() -> Vec<u8> {
    sealed(&[&MAGIC, &VERSION.to_le_bytes(), &[0; 2]])
}

pub(crate) fn check_prelude(b: &[u8; PRELUDE_BYTES]) -> Result<(), Error> {
    if b[0..8] != MAGIC {
        return Err(Error::NotAContainer);
    }
    if !is_sealed(b) {
        return Err(Error::corrupt(0, "the checksum of the first bytes does not match"));
    }
    match u16::from_le_bytes([b[8], b[9]]) {
        VERSION if b[10..12] == [0, 0] => Ok(()),
        VERSION => Err(Error::UnknownSection("flags".to_owned())),
        newer => Err(Error::NewerVersion(newer)),
    }
}

/// The last bytes of a file: where its table of contents is, and its length.
pub(crate) fn footer(contents_offset: u64, file_bytes: u64) -> Vec<u8> {
    sealed(&[&contents_offset.to_le_bytes(), &file_bytes.to_le_bytes(), &FOOTER_MAGIC])
}

/// Checks a footer; returns the offset of the table of contents.
pub(crate) fn check_footer(b: &[u8; FOOTER_BYTES], file_bytes: u64) -> Result<u64, Error> {
    let offset = file_bytes - FOOTER_BYTES as u64;
    if b[16..20] != FOOTER_MAGIC {
        return Err(Error::corrupt(offset, "the end is missing, as of a file that was cut"));
    }
    if !is_sealed(b) || value_at(b, 8, u64::from_le_bytes) != file_bytes {
        return Err(Error::corrupt(offset, "the end does not fit the file"));
    }
    Ok(value_at(b, 0, u64::from_le_bytes))
}
