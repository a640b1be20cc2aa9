//! Reading a container: validated before use, with random access to its sections.

use super::codec;
use super::edits::Layers;
use super::groups::Groups;
use super::section::{self, Entry, FOOTER_BYTES, HEADER_BYTES, PRELUDE_BYTES, SectionHeader};
use super::{Error, Header, MAX_HEADER_BYTES, tag, units};
use crate::le::{self, value_at};
use crate::wire;
use cager_geometry::mesh::Model;
use std::io::{Read, Seek, SeekFrom};

/// One section, for listings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// Its tag.
    pub tag: String,
    /// Number of its codec.
    pub codec: u8,
    /// Bytes in the file, header included.
    pub bytes: u64,
    /// Bytes once decoded.
    pub raw_bytes: u64,
}

/// Most bytes of coordinates unless set: as many as solving takes when a file is written.
const COORDINATES_BYTES: u64 = 16 << 30;

/// Reads a container from any seekable input. Whatever reads fails where what it reads is damaged.
pub struct ContainerReader<R: Read + Seek> {
    input: R,
    pub(super) file_bytes: u64,
    pub(super) entries: Vec<Entry>,
    /// Entries of the frame chunks, by first frame.
    pub(super) chunks: Vec<usize>,
    pub(super) frames: usize,
    pub(super) header: Header,
    /// The model, once it was decoded.
    pub(super) rest: Option<Model>,
    /// The chunk decoded last, by its offset.
    pub(super) cached: Option<(u64, Vec<u8>)>,
    pub(super) groups: Groups,
    pub(super) layers: Layers,
    /// Most bytes that the coordinates which coded cages need may take.
    pub(super) coordinates_bytes: u64,
    /// The last chunk that [`Self::is_intact`] could not read, by its offset.
    damaged_chunk: Option<u64>,
}

impl<R: Read + Seek> ContainerReader<R> {
    /// Checks both ends, the table of contents and the header; [`Self::verify`] checks everything.
    pub fn open(input: R) -> Result<Self, Error> {
        let mut reader = Self::begin(input)?;
        let file_bytes = reader.file_bytes;
        if file_bytes < (PRELUDE_BYTES + HEADER_BYTES + FOOTER_BYTES) as u64 {
            return Err(Error::corrupt(file_bytes, "the file was cut"));
        }
        let footer = reader.bytes_at(file_bytes - FOOTER_BYTES as u64)?;
        reader.read_contents(section::check_footer(&footer, file_bytes)?)?;
        reader.read_header()?;
        reader.check_sizes(true)?;
        reader.read_units()?;
        reader.read_origin()?;
        Ok(reader)
    }

    /// Opens a cut or damaged file; [`Self::is_intact`] says which frames can be read.
    ///
    /// # Errors
    /// See [`Error`]: a file without a complete model and cage.
    pub fn open_cut(input: R) -> Result<Self, Error> {
        let mut reader = Self::begin(input)?;
        reader.layers.passes_over_damage = true;
        reader.scan()?;
        reader.read_header()?;
        reader.check_sizes(false)?;
        // Positions decode without them.
        let _ = reader.read_units();
        reader.read_origin()?;
        Ok(reader)
    }

    fn begin(mut input: R) -> Result<Self, Error> {
        let file_bytes = input.seek(SeekFrom::End(0))?;
        let mut start = Vec::new();
        input.rewind()?;
        input.by_ref().take(PRELUDE_BYTES as u64).read_to_end(&mut start)?;
        let Some(prelude) = start.first_chunk() else {
            let ours = !start.is_empty() && super::MAGIC.starts_with(&start[..start.len().min(8)]);
            return Err(if ours { Error::corrupt(file_bytes, "the file was cut") } else { Error::NotAContainer });
        };
        section::check_prelude(prelude)?;
        Ok(Self {
            input,
            file_bytes,
            entries: Vec::new(),
            chunks: Vec::new(),
            frames: 0,
            header: Header::default(),
            rest: None,
            cached: None,
            groups: Groups::default(),
            layers: Layers::default(),
            coordinates_bytes: COORDINATES_BYTES,
            damaged_chunk: None,
        })
    }

    /// Sets how many bytes the coordinates of coded cages may take, 16 GiB by default. All other
    /// memory follows from the length of the file, see `docs/FORMAT.md`.
    pub fn limit_coordinates(&mut self, bytes: u64) {
        self.coordinates_bytes = bytes;
    }

    /// What a decoder must know.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Whether the end is missing, as of a file that was cut: there may have been more frames.
    pub fn lacks_end(&self) -> bool {
        self.entry(tag::ERRORS).is_err()
    }

    /// Whether the file ends before its table of contents: layers at its end may be missing.
    pub fn was_cut(&self) -> bool {
        self.layers.is_cut
    }

    /// Whether a frame can be read, with its residual where `residual` asks for it.
    pub fn is_intact(&mut self, frame: usize, residual: bool) -> bool {
        let Ok(Entry { offset, .. }) = self.chunk_of(frame) else { return false };
        if self.damaged_chunk == Some(offset) {
            return false;
        }
        let intact =
            self.read_frame(frame, &mut Vec::new()).is_ok() && (!residual || self.load_residual(frame).is_ok());
        self.damaged_chunk = (!intact).then_some(offset).or(self.damaged_chunk);
        intact
    }

    /// The sections, in the order of the file.
    pub fn sections(&self) -> Vec<SectionInfo> {
        let info = |e: &Entry| SectionInfo {
            tag: String::from_utf8_lossy(&e.header.tag).into_owned(),
            codec: e.header.codec,
            bytes: HEADER_BYTES as u64 + e.header.payload_bytes,
            raw_bytes: e.header.raw_bytes,
        };
        self.entries.iter().map(info).collect()
    }

    /// Reads and checks everything; of unknown sections, the checksum.
    pub fn verify(&mut self) -> Result<(), Error> {
        self.cage()?;
        if !self.carriers()?.is_empty() {
            self.checked_cage()?;
        }
        self.layers()?;
        self.colors()?;
        self.surface()?;
        self.pictures()?;
        self.elements()?;
        self.report()?;
        let mut cage = Vec::new();
        for frame in 0..self.frames {
            self.read_frame(frame, &mut cage)?;
        }
        self.verify_residuals()?;
        for k in 0..self.entries.len() {
            if !tag::KNOWN.contains(&self.entries[k].header.tag) {
                self.payload(self.entries[k])?;
            }
        }
        Ok(())
    }

    fn read_header(&mut self) -> Result<(), Error> {
        let entry = self.entry(tag::HEADER)?;
        let corrupt = |what: &str| Err(Error::corrupt(entry.offset, what));
        if entry.header.codec != section::RAW {
            return corrupt("the header is compressed");
        }
        let raw = self.raw(entry)?;
        self.header = wire::decode::<_, MAX_HEADER_BYTES>(&raw)
            .map_err(|e| Error::corrupt(entry.offset, format!("the header cannot be read ({e})")))?;
        let h = &self.header;
        if h.frame_rate.is_some_and(|fps| !(fps.is_finite() && fps > 0.0)) {
            return corrupt("the frame rate is not a positive number");
        }
        if h.rows_per_frame == 0 || h.points > u64::from(u32::MAX) || h.cage_vertices > u64::from(u32::MAX) {
            return corrupt("the header has impossible counts");
        }
        Ok(())
    }

    fn read_units(&mut self) -> Result<(), Error> {
        let Some((offset, raw)) = self.optional(tag::UNITS)? else { return Ok(()) };
        self.header.units = units::from_bytes(&raw, offset)?;
        Ok(())
    }

    fn read_origin(&mut self) -> Result<(), Error> {
        let Some((offset, raw)) = self.optional(tag::ORIGIN)? else { return Ok(()) };
        let origin = [0, 8, 16].map(|at| value_at(&raw, at, f64::from_le_bytes));
        if origin.iter().any(|x| !x.is_finite()) {
            return Err(Error::corrupt(offset, "the origin is not finite"));
        }
        self.header.origin = Some(origin);
        Ok(())
    }

    /// The sections with this tag, in the order of the file.
    pub(super) fn sections_of(&self, tag: [u8; 4]) -> impl Iterator<Item = Entry> {
        self.entries.iter().filter(move |e| e.header.tag == tag).copied()
    }

    /// The one section with this tag.
    pub(super) fn entry(&self, tag: [u8; 4]) -> Result<Entry, Error> {
        let name = String::from_utf8_lossy(&tag);
        let mut found = self.sections_of(tag);
        match (found.next(), found.next()) {
            (Some(entry), None) => Ok(entry),
            (None, _) => Err(Error::corrupt(0, format!("the section {name} is missing"))),
            (_, Some(second)) => Err(Error::corrupt(second.offset, format!("the section {name} is there twice"))),
        }
    }

    /// Where the section with this tag is and what it decodes to, if there is one.
    pub(super) fn optional(&mut self, tag: [u8; 4]) -> Result<Option<(u64, Vec<u8>)>, Error> {
        let Some(entry) = self.sections_of(tag).next() else { return Ok(None) };
        Ok(Some((entry.offset, self.raw(entry)?)))
    }

    fn bytes_at<const N: usize>(&mut self, offset: u64) -> Result<[u8; N], Error> {
        let mut bytes = [0; N];
        self.input.seek(SeekFrom::Start(offset))?;
        self.input.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// The section that begins here, and the checksum of its payload.
    pub(super) fn entry_at(&mut self, offset: u64) -> Result<(Entry, u32), Error> {
        let (header, payload_crc) = SectionHeader::unsealed(&self.bytes_at(offset)?, offset)?;
        Ok((Entry { offset, header }, payload_crc))
    }

    /// The decoded bytes of a section, checked against both its header and the table of contents.
    pub(super) fn raw(&mut self, entry: Entry) -> Result<Vec<u8>, Error> {
        self.check_limit(entry)?;
        let payload = self.payload(entry)?;
        let stride = if entry.header.tag == tag::FRAMES { 3 * self.header.rows_per_frame as usize } else { 1 };
        codec::decode(&entry.header, payload, stride, entry.offset)
    }

    /// The numbers of a section.
    pub(super) fn numbers<const N: usize, T>(&mut self, entry: Entry, read: fn([u8; N]) -> T) -> Result<Vec<T>, Error> {
        Ok(le::values(&self.raw(entry)?, read).collect())
    }

    pub(super) fn check_limit(&self, entry: Entry) -> Result<(), Error> {
        let SectionHeader { tag, codec, raw_bytes, .. } = entry.header;
        if raw_bytes > SectionHeader::most_raw_bytes(tag, codec, self.file_bytes) {
            return Err(Error::corrupt(entry.offset, "a section declares more bytes than the file can hold"));
        }
        Ok(())
    }

    /// The stored bytes of a section.
    pub(super) fn payload(&mut self, entry: Entry) -> Result<Vec<u8>, Error> {
        let corrupt = |what: &str| Err(Error::corrupt(entry.offset, what));
        let (found, crc) = self.entry_at(entry.offset)?;
        if found.header != entry.header {
            return corrupt("a section differs from the table of contents");
        }
        if entry.end().is_none_or(|end| end > self.file_bytes) {
            return corrupt("a section declares more bytes than the file can hold");
        }
        let mut payload = vec![0; entry.header.payload_bytes as usize];
        self.input.read_exact(&mut payload)?;
        if crc32c::crc32c(&payload) == crc { Ok(payload) } else { corrupt("the checksum of a section does not match") }
    }
}
