//! Writing a container, frame by frame.

use super::codec::{self, CODED, CODED_STATIC, DIFFERENCE, PLANES, RAW};
use super::section::{self, HEADER_BYTES, SectionHeader};
use super::{CHUNK_FRAMES, Error, Header, MAX_HEADER_BYTES, counted_from_zero, tag, units};
use crate::report::Report;
use crate::wire;
use cager_codec::{CodedMesh, encode_errors};
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::units::Units;
use std::io::Write;

/// Writes one container to anything that takes bytes. The same input gives the same bytes.
///
/// Memory does not grow with the frames but for 8 bytes each and 40 bytes per chunk of [`CHUNK_FRAMES`].
pub struct ContainerWriter<W: Write> {
    out: W,
    offset: u64,
    header: Header,
    /// Frames not yet written, their numbers as little-endian bytes back to back.
    pending: Vec<u8>,
    pending_frames: usize,
    errors: Vec<u8>,
    /// Whether frames came in groups.
    is_coded: bool,
    contents: Vec<u8>,
}

/// Bytes that colours of points take in a container.
pub fn colors_bytes(colors: &[[u8; 3]]) -> usize {
    if colors.is_empty() {
        return 0;
    }
    let raw = colors.as_flattened();
    HEADER_BYTES + codec::encode(PLANES, raw, 1, 0).map_or(raw.len(), |(_, payload)| payload.len())
}

impl<W: Write> ContainerWriter<W> {
    /// Writes everything that comes before the frames. The counts in `header` are taken from the meshes, not from it.
    ///
    /// # Errors
    /// Where the output refuses, a mesh exceeds what the format can count, or readers would refuse the meshes.
    pub fn new(out: W, header: &Header, rest: &Model, cage: &TriMesh) -> Result<Self, Error> {
        Self::with_meshes(out, header, (rest, None), (cage, None))
    }

    /// The same with meshes in the bytes of [`CodedMesh`], where they are given; `rest` and `cage` are what these decode to.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_meshes(
        out: W,
        header: &Header,
        (rest, coded_rest): (&Model, Option<&CodedMesh>),
        (cage, coded_cage): (&TriMesh, Option<&CodedMesh>),
    ) -> Result<Self, Error> {
        // Readers refuse what expands too far; such meshes are stored as others are.
        let fits = |coded: &&CodedMesh| {
            let (points, corners) = (coded.mesh.points.len(), coded.mesh.faces.indices().len());
            let raw = (12 * points).max(4 * (coded.mesh.faces.len() + corners)) as u64;
            let payloads = (coded.faces.len() + coded.positions.len()) as u64;
            raw <= SectionHeader::most_raw_bytes(tag::REST_POINTS, CODED, payloads)
        };
        let (coded_rest, coded_cage) = (coded_rest.filter(fits), coded_cage.filter(fits));
        let header = Header {
            points: rest.points.len() as u64,
            rest_faces: rest.faces.len() as u64,
            rest_corners: rest.faces.indices().len() as u64,
            cage_vertices: cage.vertices.len() as u64,
            cage_faces: cage.triangles.len() as u64,
            ..header.clone()
        };
        check(&header, rest, cage)?;
        let mut writer = Self::empty(out, header);
        writer.put(&section::prelude())?;
        let encoded =
            wire::encode::<_, MAX_HEADER_BYTES>(&writer.header).map_err(|e| Error::TooLarge(e.to_string()))?;
        writer.section(tag::HEADER, RAW, 1, 0, &encoded)?;
        writer.write_placement()?;
        writer.positions(tag::REST_POINTS, &rest.points, coded_rest)?;
        if let Some(coded) = coded_rest.filter(|_| !rest.faces.is_empty()) {
            let raw_bytes = 4 * (rest.faces.len() + rest.faces.indices().len());
            writer.coded(tag::REST_FACES, &coded.faces, raw_bytes, (0, 0))?;
        } else if !rest.faces.is_empty() {
            let numbers: Vec<u8> =
                rest.faces.arities().iter().chain(rest.faces.indices()).flat_map(|i| i.to_le_bytes()).collect();
            writer.section(tag::REST_FACES, DIFFERENCE, 4, 1, &numbers)?;
        }
        if !rest.colors.is_empty() {
            writer.section(tag::REST_COLORS, PLANES, 1, 0, rest.colors.as_flattened())?;
        }
        writer.positions(tag::CAGE_VERTICES, &cage.vertices, coded_cage)?;
        if let Some(coded) = coded_cage {
            writer.coded(tag::CAGE_FACES, &coded.faces, 12 * cage.triangles.len(), (0, 0))?;
        } else {
            let corners: Vec<u8> = cage.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
            writer.section(tag::CAGE_FACES, DIFFERENCE, 4, 1, &corners)?;
        }
        Ok(writer)
    }

    pub(super) fn empty(out: W, header: Header) -> Self {
        Self {
            out,
            offset: 0,
            header,
            pending: Vec::new(),
            pending_frames: 0,
            errors: Vec::new(),
            is_coded: false,
            contents: Vec::new(),
        }
    }

    /// The header, with the counts of the meshes.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Bytes written so far, frames that wait for their chunk aside.
    pub fn bytes(&self) -> u64 {
        self.offset
    }

    /// Adds the boundary elements that the coordinates were solved on.
    ///
    /// # Errors
    /// An output that refuses.
    pub fn add_elements(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.section(tag::ELEMENTS, PLANES, 1, 0, bytes)
    }

    /// Adds the cage of the next frame, rows × 3, and its errors over the rest diagonal.
    ///
    /// # Errors
    /// A cage of another size or with a value that is not finite; an output that refuses.
    pub fn write_frame(&mut self, cage: &[f32], l2: f32, linf: f32) -> Result<(), Error> {
        let frame = self.errors.len() / 8;
        let rows = self.header.rows_per_frame as usize;
        if cage.len() != 3 * rows {
            return Err(Error::BadFrame { frame, what: format!("it has {} numbers, not 3 × {rows}", cage.len()) });
        }
        if let Some(k) = cage.iter().position(|x| !x.is_finite()) {
            return Err(Error::BadFrame { frame, what: format!("cage vertex {} is not finite", k / 3) });
        }
        if frame >= u32::MAX as usize {
            return Err(too_many_frames());
        }
        self.pending.extend(cage.iter().flat_map(|x| x.to_le_bytes()));
        self.pending_frames += 1;
        self.errors.extend_from_slice(&l2.to_le_bytes());
        self.errors.extend_from_slice(&linf.to_le_bytes());
        if self.pending_frames == CHUNK_FRAMES { self.flush_chunk() } else { Ok(()) }
    }

    /// Adds a group of frames as `cager_codec::encode_cages` gives them, what `cager_codec::encode_residual` adds to their positions, and their
    /// errors over the rest diagonal. Groups are at most [`group_frames`](super::group_frames) long, and a file has no other frames.
    ///
    /// # Errors
    /// An output that refuses.
    pub fn write_group(&mut self, cages: &[u8], residual: Option<&[u8]>, errors: &[(f32, f32)]) -> Result<(), Error> {
        let first = (self.errors.len() / 8) as u32;
        let frames = (first, errors.len() as u32);
        if first.checked_add(frames.1).is_none() {
            return Err(too_many_frames());
        }
        if first > 0 && !self.is_coded {
            return Err(Error::Invalid("a group of frames after single ones; write all frames in groups".to_owned()));
        }
        self.is_coded = true;
        // Before the cages, so that cages that are there have all that belongs to them.
        if let Some(residual) = residual {
            self.coded(tag::RESIDUAL, residual, residual.len(), frames)?;
        }
        self.coded(tag::FRAMES, cages, 12 * errors.len() * self.header.rows_per_frame as usize, frames)?;
        for (l2, linf) in errors {
            self.errors.extend_from_slice(&l2.to_le_bytes());
            self.errors.extend_from_slice(&linf.to_le_bytes());
        }
        Ok(())
    }

    /// Adds the numbers that the frames have where they come from, ascending; 0, 1, 2, … take no place.
    ///
    /// # Errors
    /// Numbers that readers would refuse; an output that refuses.
    pub fn add_frame_numbers(&mut self, numbers: &[f64]) -> Result<(), Error> {
        // After the frames, where they are put into files that are there, too.
        self.flush_chunk()?;
        self.number(numbers, self.errors.len() / 8)
    }

    pub(super) fn number(&mut self, numbers: &[f64], frames: usize) -> Result<(), Error> {
        if numbers.len() != frames || !super::are_frame_numbers(numbers) {
            return Err(Error::Invalid("frame numbers that are not one for each frame, ascending".to_owned()));
        }
        if counted_from_zero(numbers) {
            return Ok(());
        }
        let raw: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.section(tag::NUMBERS, PLANES, 8, 0, &raw)
    }

    /// Writes what comes after the frames and gives back the output, which the caller flushes. Of the report it takes what no other
    /// section says and what is the same each time.
    ///
    /// # Errors
    /// An output that refuses.
    pub fn finish(mut self, report: Option<&Report>) -> Result<W, Error> {
        self.flush_chunk()?;
        self.write_errors()?;
        self.write_report(report)?;
        self.end()
    }

    pub(super) fn write_report(&mut self, report: Option<&Report>) -> Result<(), Error> {
        let Some(report) = report else { return Ok(()) };
        let text = report.stored().map_err(|e| Error::Invalid(e.to_string()))?;
        self.section(tag::REPORT, PLANES, 1, 0, &text)
    }

    /// Writes the table of contents and the footer.
    pub(super) fn end(mut self) -> Result<W, Error> {
        let contents_offset = self.offset;
        let contents = std::mem::take(&mut self.contents);
        self.section(tag::CONTENTS, RAW, 1, 0, &contents)?;
        let file_bytes = self.offset + section::FOOTER_BYTES as u64;
        self.put(&section::footer(contents_offset, file_bytes))?;
        Ok(self.out)
    }

    /// Writes what positions mean and where they are, as far as there is anything to say.
    pub(super) fn write_placement(&mut self) -> Result<(), Error> {
        if let Some(origin) = self.header.origin {
            let raw: Vec<u8> = origin.iter().flat_map(|x| x.to_le_bytes()).collect();
            self.section(tag::ORIGIN, RAW, 8, 0, &raw)?;
        }
        units::to_bytes(self.header.units).map_or(Ok(()), |raw| self.section(tag::UNITS, RAW, 1, 0, &raw))
    }

    fn write_errors(&mut self) -> Result<(), Error> {
        let errors = std::mem::take(&mut self.errors);
        if self.is_coded {
            let numbers: Vec<f32> = errors.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
            let coded = encode_errors(numbers.as_chunks().0);
            if coded.len() < errors.len() {
                return self.coded(tag::ERRORS, &coded, errors.len(), (0, 0));
            }
        }
        self.section(tag::ERRORS, PLANES, 4, 0, &errors)
    }

    fn flush_chunk(&mut self) -> Result<(), Error> {
        if self.pending_frames == 0 {
            return Ok(());
        }
        let raw = std::mem::take(&mut self.pending);
        let count = std::mem::take(&mut self.pending_frames) as u32;
        let first = (self.errors.len() / 8) as u32 - count;
        self.chunk(tag::FRAMES, DIFFERENCE, 4, 3 * self.header.rows_per_frame as usize, &raw, (first, count))?;
        self.pending = raw;
        self.pending.clear();
        Ok(())
    }

    /// Single precision where it loses nothing, as for models that came from such a file.
    fn positions(&mut self, tag: [u8; 4], points: &[Point], coded: Option<&CodedMesh>) -> Result<(), Error> {
        if let Some(coded) = coded {
            return self.coded(tag, &coded.positions, 12 * points.len(), (0, 0));
        }
        let single = points.iter().flatten().all(|&x| f64::from(x as f32).to_bits() == x.to_bits());
        let (width, raw): (usize, Vec<u8>) = if single {
            (4, points.iter().flatten().flat_map(|&x| (x as f32).to_le_bytes()).collect())
        } else {
            (8, points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect())
        };
        self.section(tag, PLANES, width, 0, &raw)
    }

    pub(super) fn section(
        &mut self,
        tag: [u8; 4],
        codec: u8,
        width: usize,
        stride: usize,
        raw: &[u8],
    ) -> Result<(), Error> {
        self.chunk(tag, codec, width, stride, raw, (0, 0))
    }

    pub(super) fn chunk(
        &mut self,
        tag: [u8; 4],
        codec: u8,
        width: usize,
        stride: usize,
        raw: &[u8],
        frames: (u32, u32),
    ) -> Result<(), Error> {
        let (codec, payload) = match codec::encode(codec, raw, width, stride)? {
            // Readers refuse what expands too far, lest a small file takes all their memory.
            (codec, payload) if raw.len() as u64 > SectionHeader::most_raw_bytes(tag, codec, payload.len() as u64) => {
                (RAW, raw.to_vec())
            }
            encoded => encoded,
        };
        self.payload((tag, codec, width as u8), &payload, raw.len(), frames)
    }

    fn coded(&mut self, tag: [u8; 4], payload: &[u8], raw_bytes: usize, frames: (u32, u32)) -> Result<(), Error> {
        let (codec, width) = match tag {
            tag::RESIDUAL => (CODED, 1),
            tag::FRAMES => (CODED, 4),
            _ => (CODED_STATIC, 4),
        };
        self.payload((tag, codec, width), payload, raw_bytes, frames)
    }

    pub(super) fn payload(
        &mut self,
        (tag, codec, width): ([u8; 4], u8, u8),
        payload: &[u8],
        raw_bytes: usize,
        frames: (u32, u32),
    ) -> Result<(), Error> {
        let header = SectionHeader {
            tag,
            codec,
            width,
            first: frames.0,
            count: frames.1,
            payload_bytes: payload.len() as u64,
            raw_bytes: raw_bytes as u64,
            payload_crc: crc32c::crc32c(payload),
        };
        let header = header.to_bytes();
        self.contents.extend_from_slice(&self.offset.to_le_bytes());
        self.contents.extend_from_slice(&header[..32]);
        self.put(&header)?;
        self.put(payload)
    }

    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.out.write_all(bytes)?;
        self.offset += bytes.len() as u64;
        Ok(())
    }
}

fn too_many_frames() -> Error {
    Error::TooLarge("a file holds at most 4,294,967,295 frames".to_owned())
}

/// Refuses what a reader would refuse, so that a file that was written can be read.
fn check(header: &Header, rest: &Model, cage: &TriMesh) -> Result<(), Error> {
    if header.origin.is_some_and(|origin| origin.iter().any(|x| !x.is_finite())) {
        return Err(Error::TooLarge("an origin that is not finite".to_owned()));
    }
    if header.units.metres_per_unit.is_some_and(|metres| !Units::is_length(metres)) {
        return Err(Error::Invalid("a unit that is no length".to_owned()));
    }
    if header.rows_per_frame == 0 {
        return Err(Error::Invalid("a frame without rows".to_owned()));
    }
    let meshes: [(&str, &[Point], &[u32]); 2] =
        [("model", &rest.points, rest.faces.indices()), ("cage", &cage.vertices, cage.triangles.as_flattened())];
    for (name, points, indices) in meshes {
        if points.len() > u32::MAX as usize {
            return Err(Error::TooLarge(format!("the {name} has more than 4,294,967,295 points")));
        }
        if let Some(k) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(Error::Invalid(format!("point {k} of the {name} is not finite")));
        }
        if let Some(k) = indices.iter().find(|&&k| k as usize >= points.len()) {
            return Err(Error::Invalid(format!("a face of the {name} names point {k} of {}", points.len())));
        }
    }
    Ok(())
}
