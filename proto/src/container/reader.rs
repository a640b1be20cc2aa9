//! Reading a container: validated before use, with random access to frames.

use super::codec::{self, CODED};
use super::edits::Layers;
use super::groups::Groups;
use super::section::{self, Entry, FOOTER_BYTES, HEADER_BYTES, PRELUDE_BYTES, SectionHeader};
use super::{Error, Header, MAX_HEADER_BYTES, counted_from_zero, tag, units};
use crate::le::{self, f32_at, u64_at};
use crate::report::{FrameError, Report, WorstError};
use crate::wire;
use cager_geometry::mesh::{Model, Point, Polygons, TriMesh, diagonal};
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

/// Bytes that coordinates may take where nobody says otherwise: as many as those that were solved for when a file was written.
const COORDINATES_BYTES: u64 = 16 << 30;

/// Reads a container from any seekable input.
pub struct ContainerReader<R: Read + Seek> {
    input: R,
    pub(super) file_bytes: u64,
    pub(super) entries: Vec<Entry>,
    /// Entries of the frame chunks, by first frame.
    pub(super) chunks: Vec<usize>,
    pub(super) frames: usize,
    pub(super) header: Header,
    /// The model, once it was decoded.
    rest: Option<Model>,
    /// The chunk decoded last, by its offset.
    cached: Option<(u64, Vec<u8>)>,
    pub(super) groups: Groups,
    pub(super) layers: Layers,
    /// Most bytes that the coordinates which coded cages need may take.
    pub(super) coordinates_bytes: u64,
    /// The last chunk that [`Self::is_intact`] could not read.
    damaged_chunk: Option<usize>,
}

impl<R: Read + Seek> ContainerReader<R> {
    /// Checks both ends, the table of contents and the header. Sections are checked as they are read; [`Self::verify`] reads
    /// them all.
    ///
    /// # Errors
    /// See [`Error`].
    pub fn open(input: R) -> Result<Self, Error> {
        let mut reader = Self::begin(input)?;
        let file_bytes = reader.file_bytes;
        if file_bytes < (PRELUDE_BYTES + HEADER_BYTES + FOOTER_BYTES) as u64 {
            return Err(Error::corrupt(file_bytes, "the file was cut"));
        }
        let mut footer = [0; FOOTER_BYTES];
        reader.input.seek(SeekFrom::Start(file_bytes - FOOTER_BYTES as u64))?;
        reader.input.read_exact(&mut footer)?;
        reader.read_contents(section::check_footer(&footer, file_bytes)?)?;
        reader.read_header()?;
        reader.check_sizes(true)?;
        reader.read_units()?;
        reader.read_origin()?;
        Ok(reader)
    }

    /// Opens what is there of a file that was cut or damaged, from its beginning on: the frames before the cut. Sections are checked as they are
    /// read, and [`Self::is_intact`] says which frames can be.
    ///
    /// # Errors
    /// See [`Error`]: a file without a whole model and cage.
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

    /// Whether what follows the last frame is missing, as of a file that was cut: frames after it may have been there.
    pub fn lacks_end(&self) -> bool {
        self.entry(tag::ERRORS).is_err()
    }

    /// Whether the file was read from its beginning on, and ends before its table of contents: layers of edits at its end may be missing.
    pub fn was_cut(&self) -> bool {
        self.layers.is_cut
    }

    /// Whether a frame can be read, with its residual where `residual` asks for it.
    pub fn is_intact(&mut self, frame: usize, residual: bool) -> bool {
        let chunk = self.chunks.partition_point(|&k| self.entries[k].header.first as usize <= frame);
        if self.damaged_chunk == Some(chunk) {
            return false;
        }
        let mut cage = Vec::new();
        let intact = self.read_frame(frame, &mut cage).is_ok() && (!residual || self.load_residual(frame).is_ok());
        self.damaged_chunk = (!intact).then_some(chunk).or(self.damaged_chunk);
        intact
    }

    fn begin(mut input: R) -> Result<Self, Error> {
        let file_bytes = input.seek(SeekFrom::End(0))?;
        let mut prelude = [0; PRELUDE_BYTES];
        input.rewind()?;
        if file_bytes < PRELUDE_BYTES as u64 {
            let mut start = vec![0; file_bytes as usize];
            input.read_exact(&mut start)?;
            let ours = !start.is_empty() && super::MAGIC.starts_with(&start[..start.len().min(8)]);
            return Err(if ours { Error::corrupt(file_bytes, "the file was cut") } else { Error::NotAContainer });
        }
        input.read_exact(&mut prelude)?;
        section::check_prelude(&prelude)?;
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

    /// Sets how many bytes the coordinates that coded cages need may take, 16 GiB unless it is called. Everything else that reading takes follows from the
    /// length of the file, see `docs/FORMAT.md`.
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

    /// The model in its rest pose, about the [origin](Header::origin), without its [`colors`](Self::colors).
    ///
    /// # Errors
    /// Damage.
    pub fn rest(&mut self) -> Result<Model, Error> {
        if let Some(rest) = &self.rest {
            return Ok(rest.clone());
        }
        let faces = self.rest_faces()?;
        let points = self.positions(tag::REST_POINTS, &faces)?;
        let rest = Model { points, faces, ..Model::default() };
        // Decoding takes several times as long as reading numbers that are there as they are.
        if codec::is_coded(self.entry(tag::REST_POINTS)?.header.codec) {
            self.rest = Some(rest.clone());
        }
        Ok(rest)
    }

    /// Colours of the model's points; empty where the file has none. Positions decode without them.
    ///
    /// # Errors
    /// Damage.
    pub fn colors(&mut self) -> Result<Vec<[u8; 3]>, Error> {
        let entry = self.sections_of(tag::REST_COLORS).next();
        let colors = entry.map_or(Ok(Vec::new()), |entry| self.raw(entry))?;
        Ok(colors.as_chunks().0.to_vec())
    }

    fn rest_faces(&mut self) -> Result<Polygons, Error> {
        if self.header.rest_faces == 0 {
            return Ok(Polygons::new());
        }
        let points = self.header.points as usize;
        if let Some(coded) = self.coded(tag::REST_FACES)? {
            let corners = self.header.rest_corners as usize;
            self.limit_points(tag::REST_POINTS)?;
            return coded.faces(points, self.header.rest_faces as usize, corners);
        }
        let mut faces = Polygons::new();
        let (offset, numbers) = self.indices(tag::REST_FACES)?;
        let (arities, indices) = numbers.split_at(self.header.rest_faces as usize);
        let mut rest = indices;
        for &arity in arities {
            let Some((face, tail)) = rest.split_at_checked(arity as usize) else {
                return Err(Error::corrupt(offset, "the faces of the model have more corners than there are"));
            };
            check_indices(face, points, offset)?;
            faces.push(face);
            rest = tail;
        }
        if rest.is_empty() {
            Ok(faces)
        } else {
            Err(Error::corrupt(offset, "the faces of the model have fewer corners than there are"))
        }
    }

    /// The cage around the rest pose, about the [origin](Header::origin).
    ///
    /// # Errors
    /// Damage.
    pub fn cage(&mut self) -> Result<TriMesh, Error> {
        let (points, count) = (self.header.cage_vertices as usize, self.header.cage_faces as usize);
        if let Some(coded) = self.coded(tag::CAGE_FACES)? {
            self.limit_points(tag::CAGE_VERTICES)?;
            let faces = coded.faces(points, count, count.saturating_mul(3))?;
            if faces.arities().iter().any(|&arity| arity != 3) {
                return Err(Error::corrupt(coded.offset, "the cage has faces that are no triangles"));
            }
            let vertices = self.positions(tag::CAGE_VERTICES, &faces)?;
            return Ok(TriMesh { vertices, triangles: faces.triangulated() });
        }
        let vertices = self.positions(tag::CAGE_VERTICES, &Polygons::new())?;
        let (offset, numbers) = self.indices(tag::CAGE_FACES)?;
        check_indices(&numbers, vertices.len(), offset)?;
        Ok(TriMesh { vertices, triangles: numbers.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect() })
    }

    /// The boundary elements that the coordinates were solved on, where the file has any: bytes for the coordinate system to check.
    ///
    /// # Errors
    /// Damage.
    pub fn elements(&mut self) -> Result<Option<Vec<u8>>, Error> {
        let entry = self.sections_of(tag::ELEMENTS).next();
        entry.map(|entry| self.raw(entry)).transpose()
    }

    pub(super) fn chunk_of(&self, frame: usize) -> Result<Entry, Error> {
        let place = self.place_of(frame).ok_or(Error::NoSuchFrame { frame, frames: self.frames })?;
        Ok(self.entries[place])
    }

    /// Where the section of a frame's cage is among all.
    pub(super) fn place_of(&self, frame: usize) -> Option<usize> {
        let chunk = self.chunks.partition_point(|&k| self.entries[k].header.first as usize <= frame);
        self.chunks.get(chunk.checked_sub(1)?).filter(|_| frame < self.frames).copied()
    }

    /// The rows of one frame, rows × 3, with the [`layers`](Self::layers) of edits that are on. In any order; consecutive frames are fastest.
    ///
    /// # Errors
    /// A frame that does not exist; damage.
    pub fn read_frame(&mut self, frame: usize, out: &mut Vec<f32>) -> Result<(), Error> {
        self.read_frame_unedited(frame, out)?;
        self.apply_layers(frame, out)
    }

    /// The same without layers of edits.
    ///
    /// # Errors
    /// As [`Self::read_frame`].
    pub fn read_frame_unedited(&mut self, frame: usize, out: &mut Vec<f32>) -> Result<(), Error> {
        let entry = self.chunk_of(frame)?;
        if self.cached.as_ref().is_none_or(|(cached, _)| *cached != entry.offset) {
            self.cached = None;
            let raw = if entry.header.codec == CODED { self.group(entry)? } else { self.raw(entry)? };
            self.cached = Some((entry.offset, raw));
        }
        let Some((_, raw)) = &self.cached else { return Err(Error::NoSuchFrame { frame, frames: self.frames }) };
        let bytes = 12 * self.header.rows_per_frame as usize;
        let start = (frame - entry.header.first as usize) * bytes;
        out.clear();
        out.extend(le::f32_values(&raw[start..start + bytes]));
        if out.iter().any(|x| !x.is_finite()) {
            return Err(Error::corrupt(entry.offset, format!("the cage of frame {frame} is not finite")));
        }
        Ok(())
    }

    /// Errors of all frames, as they were measured before any edit; [`Self::report`] has those of the frames as they are.
    ///
    /// # Errors
    /// Damage; a file that was cut before them.
    pub fn errors(&mut self) -> Result<Vec<FrameError>, Error> {
        if let Some(coded) = self.coded(tag::ERRORS)? {
            let errors = coded.errors(self.frames)?.into_iter();
            return Ok(errors.map(|[l2, linf]| FrameError { l2: l2.into(), linf: linf.into() }).collect());
        }
        let raw = self.raw(self.entry(tag::ERRORS)?)?;
        let error = |b: &[u8]| FrameError { l2: f32_at(b, 0).into(), linf: f32_at(b, 4).into() };
        Ok(raw.chunks_exact(8).map(error).collect())
    }

    /// The numbers that the frames have where they come from, such as those of their files; 0, 1, 2, … where the file has none.
    ///
    /// # Errors
    /// Damage.
    pub fn frame_numbers(&mut self) -> Result<Vec<f64>, Error> {
        let Some(entry) = self.sections_of(tag::NUMBERS).next() else {
            return Ok((0..self.frames).map(|frame| frame as f64).collect());
        };
        let raw = self.raw(entry)?;
        let numbers: Vec<f64> = raw.chunks_exact(8).map(|b| f64::from_bits(u64_at(b, 0))).collect();
        if super::are_frame_numbers(&numbers) {
            Ok(numbers)
        } else {
            Err(Error::corrupt(entry.offset, "the numbers of the frames do not ascend"))
        }
    }

    /// The report of the encoding, without its times. What only the encoder can tell is empty where the file has nothing of it.
    ///
    /// # Errors
    /// Damage.
    pub fn report(&mut self) -> Result<Report, Error> {
        let entry = self.sections_of(tag::REPORT).next();
        let mut report = match entry {
            Some(entry) => serde_json::from_slice(&self.raw(entry)?)
                .map_err(|e| Error::corrupt(entry.offset, format!("the report cannot be read ({e})")))?,
            None => Report::default(),
        };
        report.set_header(&self.header);
        report.frames = self.frames;
        report.diagonal = diagonal(&self.rest()?.points);
        report.frame_numbers = self.frame_numbers()?;
        if counted_from_zero(&report.frame_numbers) {
            report.frame_numbers = Vec::new();
        }
        report.error.per_frame = self.errors()?;
        report.hold_errors_to_bound();
        let edited = self.edited_frames()?;
        if edited.contains(&true) {
            report.error.forget(&edited);
        }
        report.error.worst = WorstError::of_frames(&report.error.per_frame, report.diagonal);
        report.bytes.capture = self.header.capture_bytes(self.frames);
        report.set_output(self.file_bytes);
        Ok(report)
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

    /// Reads and checks everything, frames included; of sections that this program does not know, the checksum.
    ///
    /// # Errors
    /// The first damage found.
    pub fn verify(&mut self) -> Result<(), Error> {
        self.cage()?;
        self.layers()?;
        self.colors()?;
        self.elements()?;
        self.report()?;
        let mut cage = Vec::new();
        for frame in 0..self.frames {
            self.read_frame(frame, &mut cage)?;
        }
        self.verify_residuals()?;
        for k in 0..self.entries.len() {
            let entry = self.entries[k];
            if !tag::KNOWN.contains(&entry.header.tag) {
                self.payload(entry)?;
            }
        }
        Ok(())
    }

    fn read_header(&mut self) -> Result<(), Error> {
        let entry = self.entry(tag::HEADER)?;
        if entry.header.codec != codec::RAW {
            return Err(Error::corrupt(entry.offset, "the header is compressed"));
        }
        let raw = self.raw(entry)?;
        self.header = wire::decode::<_, MAX_HEADER_BYTES>(&raw)
            .map_err(|e| Error::corrupt(entry.offset, format!("the header cannot be read ({e})")))?;
        let h = &self.header;
        if h.frame_rate.is_some_and(|fps| !(fps.is_finite() && fps > 0.0)) {
            return Err(Error::corrupt(entry.offset, "the frame rate is not a positive number"));
        }
        if h.rows_per_frame == 0 || h.points > u64::from(u32::MAX) || h.cage_vertices > u64::from(u32::MAX) {
            return Err(Error::corrupt(entry.offset, "the header has impossible counts"));
        }
        Ok(())
    }

    fn read_units(&mut self) -> Result<(), Error> {
        let Some(entry) = self.sections_of(tag::UNITS).next() else { return Ok(()) };
        self.header.units = units::from_bytes(&self.raw(entry)?, entry.offset)?;
        Ok(())
    }

    fn read_origin(&mut self) -> Result<(), Error> {
        let Some(entry) = self.sections_of(tag::ORIGIN).next() else { return Ok(()) };
        let raw = self.raw(entry)?;
        let origin = [0, 8, 16].map(|at| f64::from_bits(u64_at(&raw, at)));
        if origin.iter().any(|x| !x.is_finite()) {
            return Err(Error::corrupt(entry.offset, "the origin is not finite"));
        }
        self.header.origin = Some(origin);
        Ok(())
    }

    /// The sections with this tag, in the order of the file.
    pub(super) fn sections_of(&self, tag: [u8; 4]) -> impl Iterator<Item = Entry> {
        self.entries.iter().filter(move |e| e.header.tag == tag).copied()
    }

    pub(super) fn entry(&self, tag: [u8; 4]) -> Result<Entry, Error> {
        let mut found = self.sections_of(tag);
        match (found.next(), found.next()) {
            (Some(entry), None) => Ok(entry),
            (None, _) => Err(Error::corrupt(0, format!("the section {} is missing", String::from_utf8_lossy(&tag)))),
            (Some(_), Some(second)) => Err(Error::corrupt(
                second.offset,
                format!("the section {} is there twice", String::from_utf8_lossy(&tag)),
            )),
        }
    }

    pub(super) fn header_at(&mut self, offset: u64) -> Result<SectionHeader, Error> {
        let mut bytes = [0; HEADER_BYTES];
        self.input.seek(SeekFrom::Start(offset))?;
        self.input.read_exact(&mut bytes)?;
        SectionHeader::from_bytes(&bytes, offset)
    }

    /// The decoded bytes of a section, checked against both its header and the table of contents.
    pub(super) fn raw(&mut self, entry: Entry) -> Result<Vec<u8>, Error> {
        let header = entry.header;
        self.check_limit(entry)?;
        let payload = self.payload(entry)?;
        let stride = if header.tag == tag::FRAMES { 3 * self.header.rows_per_frame as usize } else { 1 };
        codec::decode(
            header.codec,
            payload,
            header.raw_bytes as usize,
            usize::from(header.width).max(1),
            stride,
            entry.offset,
        )
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
        let header = self.header_at(entry.offset)?;
        let in_contents = SectionHeader { payload_crc: header.payload_crc, ..entry.header };
        if header != in_contents {
            return Err(Error::corrupt(entry.offset, "a section differs from the table of contents"));
        }
        let room = self.file_bytes.saturating_sub(entry.offset + HEADER_BYTES as u64);
        if header.payload_bytes > room {
            return Err(Error::corrupt(entry.offset, "a section declares more bytes than the file can hold"));
        }
        let mut payload = vec![0; header.payload_bytes as usize];
        self.input.read_exact(&mut payload)?;
        if crc32c::crc32c(&payload) != header.payload_crc {
            return Err(Error::corrupt(entry.offset, "the checksum of a section does not match"));
        }
        Ok(payload)
    }

    fn positions(&mut self, tag: [u8; 4], faces: &Polygons) -> Result<Vec<Point>, Error> {
        let entry = self.entry(tag)?;
        if let Some(coded) = self.coded(tag)? {
            let count = if tag == tag::REST_POINTS { self.header.points } else { self.header.cage_vertices };
            return coded.positions(faces, count as usize);
        }
        let raw = self.raw(entry)?;
        let points: Vec<Point> = if entry.header.width == 4 {
            let value = |b: &[u8], k: usize| f64::from(f32_at(b, k));
            raw.chunks_exact(12).map(|b| [value(b, 0), value(b, 4), value(b, 8)]).collect()
        } else {
            raw.chunks_exact(24).map(|b| [0, 8, 16].map(|k| f64::from_bits(u64_at(b, k)))).collect()
        };
        check_finite(points, entry.offset)
    }

    fn indices(&mut self, tag: [u8; 4]) -> Result<(u64, Vec<u32>), Error> {
        let entry = self.entry(tag)?;
        let raw = self.raw(entry)?;
        Ok((entry.offset, le::u32_values(&raw).collect()))
    }
}

/// Refuses positions that are not finite, of the section there.
pub(super) fn check_finite(points: Vec<Point>, offset: u64) -> Result<Vec<Point>, Error> {
    match points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        Some(k) => Err(Error::corrupt(offset, format!("position {k} is not finite"))),
        None => Ok(points),
    }
}

fn check_indices(indices: &[u32], points: usize, offset: u64) -> Result<(), Error> {
    match indices.iter().find(|&&i| i as usize >= points) {
        Some(i) => Err(Error::corrupt(offset, format!("a face names point {i} of {points}"))),
        None => Ok(()),
    }
}
