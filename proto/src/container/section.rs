//! Section headers, the prelude and the footer: everything of fixed size.

use crate::le::{u32_at, u64_at};

use super::{Error, MAGIC, MAX_HEADER_BYTES, VERSION, codec, tag};

pub(crate) const PRELUDE_BYTES: usize = 16;
pub(crate) const HEADER_BYTES: usize = 40;
pub(crate) const FOOTER_BYTES: usize = 24;
const FOOTER_MAGIC: [u8; 4] = *b"CGRE";

/// The header before every section's payload.
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
    pub(crate) payload_crc: u32,
}

impl SectionHeader {
    /// What all layers of edits may decode to together: so much more than so many times the file's length.
    pub(crate) const LAYERS_TIMES: u64 = 16;
    pub(crate) const LAYERS_MORE: u64 = 8 << 20;

    pub(crate) fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let mut out = [0; HEADER_BYTES];
        out[0..4].copy_from_slice(&self.tag);
        out[4] = self.codec;
        out[5] = self.width;
        out[8..12].copy_from_slice(&self.first.to_le_bytes());
        out[12..16].copy_from_slice(&self.count.to_le_bytes());
        out[16..24].copy_from_slice(&self.payload_bytes.to_le_bytes());
        out[24..32].copy_from_slice(&self.raw_bytes.to_le_bytes());
        out[32..36].copy_from_slice(&self.payload_crc.to_le_bytes());
        let crc = crc32c::crc32c(&out[..36]);
        out[36..40].copy_from_slice(&crc.to_le_bytes());
        out
    }

    pub(crate) fn from_bytes(b: &[u8; HEADER_BYTES], offset: u64) -> Result<Self, Error> {
        if crc32c::crc32c(&b[..36]) != u32_at(b, 36) {
            return Err(Error::corrupt(offset, "the checksum of a section's header does not match"));
        }
        if b[6..8] != [0, 0] {
            return Err(Error::corrupt(offset + 6, "reserved bytes are not zero"));
        }
        Ok(Self { payload_crc: u32_at(b, 32), ..Self::without_checksum(b) })
    }

    /// All fields but the checksum of the payload, which is 0: the table of contents repeats these.
    pub(crate) fn without_checksum(b: &[u8]) -> Self {
        Self {
            tag: [b[0], b[1], b[2], b[3]],
            codec: b[4],
            width: b[5],
            first: u32_at(b, 8),
            count: u32_at(b, 12),
            payload_bytes: u64_at(b, 16),
            raw_bytes: u64_at(b, 24),
            payload_crc: 0,
        }
    }

    /// Most bytes that a section may decode to in a file of this length, so that what a reader builds from all of them keeps to the bound of
    /// `docs/FORMAT.md`.
    pub(crate) fn most_raw_bytes(tag: [u8; 4], codec: u8, file_bytes: u64) -> u64 {
        let (times, more) = match tag {
            tag::HEADER => return MAX_HEADER_BYTES as u64,
            // Decoding whole numbers takes several times the memory of the result.
            _ if codec::is_coded(codec) => (16, 2 << 20),
            // Two bytes of JSON may become an empty text of 24 bytes.
            tag::REPORT => (16, 4 << 20),
            tag::EDIT => (Self::LAYERS_TIMES, Self::LAYERS_MORE),
            _ => (48, 12 << 20),
        };
        file_bytes.saturating_mul(times).saturating_add(more)
    }

    /// Whether a reader that does not know the section must refuse the file.
    pub(crate) fn is_required(tag: [u8; 4]) -> bool {
        !tag[0].is_ascii_lowercase()
    }
}

pub(crate) fn prelude() -> [u8; PRELUDE_BYTES] {
    let mut out = [0; PRELUDE_BYTES];
    out[0..8].copy_from_slice(&MAGIC);
    out[8..10].copy_from_slice(&VERSION.to_le_bytes());
    let crc = crc32c::crc32c(&out[..12]);
    out[12..16].copy_from_slice(&crc.to_le_bytes());
    out
}

pub(crate) fn check_prelude(b: &[u8; PRELUDE_BYTES]) -> Result<(), Error> {
    if b[0..8] != MAGIC {
        return Err(Error::NotAContainer);
    }
    if crc32c::crc32c(&b[..12]) != u32_at(b, 12) {
        return Err(Error::corrupt(0, "the checksum of the first bytes does not match"));
    }
    match u16::from_le_bytes([b[8], b[9]]) {
        VERSION if b[10..12] == [0, 0] => Ok(()),
        VERSION => Err(Error::UnknownSection("flags".to_owned())),
        newer => Err(Error::NewerVersion(newer)),
    }
}

/// The last bytes of a file: where its table of contents is, and its length.
pub(crate) fn footer(contents_offset: u64, file_bytes: u64) -> [u8; FOOTER_BYTES] {
    let mut out = [0; FOOTER_BYTES];
    out[0..8].copy_from_slice(&contents_offset.to_le_bytes());
    out[8..16].copy_from_slice(&file_bytes.to_le_bytes());
    out[16..20].copy_from_slice(&FOOTER_MAGIC);
    let crc = crc32c::crc32c(&out[..20]);
    out[20..24].copy_from_slice(&crc.to_le_bytes());
    out
}

/// Checks a footer; returns the offset of the table of contents.
pub(crate) fn check_footer(b: &[u8; FOOTER_BYTES], file_bytes: u64) -> Result<u64, Error> {
    let offset = file_bytes - FOOTER_BYTES as u64;
    if b[16..20] != FOOTER_MAGIC {
        return Err(Error::corrupt(offset, "the end is missing, as of a file that was cut"));
    }
    if crc32c::crc32c(&b[..20]) != u32_at(b, 20) || u64_at(b, 8) != file_bytes {
        return Err(Error::corrupt(offset, "the end does not fit the file"));
    }
    Ok(u64_at(b, 0))
}

/// A section, and where it begins.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    pub(super) offset: u64,
    pub(super) header: SectionHeader,
}
