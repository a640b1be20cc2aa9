//! Writing a container, frame by frame.

use super::codec;
use super::section::{self, CODED, CODED_STATIC, Entry, HEADER_BYTES, RAW, SectionHeader};
use super::{CHUNK_FRAMES, Error, Header, MAX_HEADER_BYTES, counted_from_zero, tag, units};
use crate::le::f32_bytes;
use crate::report::Report;
use crate::wire;
use cager_codec::{CodedMesh, CodedSurface, encode_errors};
use cager_core::cage::Carrier;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::units::Units;
use std::io::Write;

/// Writes one container to anything that takes bytes. The same input gives the same bytes.
///
/// Memory grows by 8 bytes for each frame and 40 for each chunk of [`CHUNK_FRAMES`].
pub struct ContainerWriter<W: Write> {
    out: W,
    offset: u64,
    header: Header,
    /// The rows of frames that wait for their chunk.
    pending: Vec<f32>,
    errors: Vec<[f32; 2]>,
    /// Whether frames came in groups.
    is_coded: bool,
    contents: Vec<u8>,
}

/// Bytes that colours of points take in a container.
pub fn colors_bytes(colors: &[[u8; 3]]) -> usize {
    if colors.is_empty() {
        return 0;
    }
    let (raw, header) = (colors.as_flattened(), SectionHeader::new(tag::REST_COLORS, (0, 0)));
    HEADER_BYTES + codec::encode(header, raw, 1).map_or(raw.len(), |(_, payload)| payload.len())
}

impl<W: Write> ContainerWriter<W> {
    /// Writes everything before the frames. The counts of `header` are taken from the meshes.
    ///
    /// # Errors
    /// An output that refuses; meshes that readers would refuse.
    pub fn new(out: W, header: &Header, rest: &Model, cage: &TriMesh) -> Result<Self, Error> {
        Self::with_meshes(out, header, (rest, None), (cage, None), &[])
    }

    /// The same with meshes as bytes, where given; `rest` and `cage` are what these decode to. The
    /// carriers say which component of the cage carries which points, none that all of it does.
    pub fn with_meshes(
        out: W,
        header: &Header,
        (rest, coded_rest): (&Model, Option<&CodedMesh>),
        (cage, coded_cage): (&TriMesh, Option<&CodedMesh>),
        carriers: &[Carrier],
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
        let mut writer = Self::begin(out, header)?;
        let encoded =
            wire::encode::<_, MAX_HEADER_BYTES>(&writer.header).map_err(|e| Error::TooLarge(e.to_string()))?;
        writer.section(tag::HEADER, &encoded)?;
        writer.write_placement()?;
        writer.positions(tag::REST_POINTS, &rest.points, coded_rest)?;
        if !rest.faces.is_empty() {
            let numbers: Vec<u32> = rest.faces.arities().iter().chain(rest.faces.indices()).copied().collect();
            writer.faces(tag::REST_FACES, &numbers, coded_rest)?;
        }
        if !rest.colors.is_empty() {
            writer.section(tag::REST_COLORS, rest.colors.as_flattened())?;
        }
        let surface = match coded_rest {
            Some(coded) => coded.surface.clone(),
            None => CodedSurface::new(rest, &rest.faces),
        };
        if let Some(surface) = surface {
            writer.write_surface(&surface)?;
            writer.write_pictures(&surface.outline.pictures)?;
        }
        // Before the cage, which is complete then for who reads the file as it comes.
        writer.write_carriers(carriers)?;
        writer.positions(tag::CAGE_VERTICES, &cage.vertices, coded_cage)?;
        writer.faces(tag::CAGE_FACES, cage.triangles.as_flattened(), coded_cage)?;
        Ok(writer)
    }

    /// A file of which nothing but its first bytes is written.
    pub(super) fn begin(out: W, header: Header) -> Result<Self, Error> {
        let (pending, errors, contents) = (Vec::new(), Vec::new(), Vec::new());
        let mut writer = Self { out, offset: 0, header, pending, errors, is_coded: false, contents };
        writer.put(&section::prelude())?;
        Ok(writer)
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
    pub fn add_elements(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.section(tag::ELEMENTS, bytes)
    }

    /// Adds the cage of the next frame, rows × 3, and its errors over the rest diagonal.
    ///
    /// # Errors
    /// A cage of another size or with a value that is not finite; an output that refuses.
    pub fn write_frame(&mut self, cage: &[f32], l2: f32, linf: f32) -> Result<(), Error> {
        let frame = self.errors.len();
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
        self.pending.extend(cage);
        self.errors.push([l2, linf]);
        if self.pending.len() == CHUNK_FRAMES * cage.len() { self.flush_chunk() } else { Ok(()) }
    }

    /// Adds at most [`group_frames`](super::group_frames) of a file without other frames, as
    /// `cager_codec` encodes them, with their errors over the rest diagonal.
    pub fn write_group(&mut self, cages: &[u8], residual: Option<&[u8]>, errors: &[(f32, f32)]) -> Result<(), Error> {
        let first = self.errors.len() as u32;
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
        self.errors.extend(errors.iter().map(|&(l2, linf)| [l2, linf]));
        Ok(())
    }

    /// Adds the numbers of the frames where they come from, ascending; 0, 1, 2, … take no place.
    ///
    /// # Errors
    /// Numbers that readers would refuse; an output that refuses.
    pub fn add_frame_numbers(&mut self, numbers: &[f64]) -> Result<(), Error> {
        // After the frames, where they are put into files that are there, too.
        self.flush_chunk()?;
        self.number(numbers, self.errors.len())
    }

    pub(super) fn number(&mut self, numbers: &[f64], frames: usize) -> Result<(), Error> {
        if numbers.len() != frames || !super::are_frame_numbers(numbers) {
            return Err(Error::Invalid("frame numbers that are not one for each frame, ascending".to_owned()));
        }
        if counted_from_zero(numbers) {
            return Ok(());
        }
        let raw: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.section(tag::NUMBERS, &raw)
    }

    /// Writes what comes after the frames, with the part of the report that no other section says,
    /// and gives back the output, which the caller flushes.
    pub fn finish(mut self, report: Option<&Report>) -> Result<W, Error> {
        self.flush_chunk()?;
        self.write_errors()?;
        self.write_report(report)?;
        self.end()
    }

    pub(super) fn write_report(&mut self, report: Option<&Report>) -> Result<(), Error> {
        let Some(report) = report else { return Ok(()) };
        let text = report.stored().map_err(|e| Error::Invalid(e.to_string()))?;
        self.section(tag::REPORT, &text)
    }

    /// Writes the table of contents and the footer.
    pub(super) fn end(mut self) -> Result<W, Error> {
        let contents_offset = self.offset;
        let contents = std::mem::take(&mut self.contents);
        self.section(tag::CONTENTS, &contents)?;
        let file_bytes = self.offset + section::FOOTER_BYTES as u64;
        self.put(&section::footer(contents_offset, file_bytes))?;
        Ok(self.out)
    }

    /// Writes what positions mean and where they are, as far as there is anything to say.
    pub(super) fn write_placement(&mut self) -> Result<(), Error> {
        if let Some(origin) = self.header.origin {
            let raw: Vec<u8> = origin.iter().flat_map(|x| x.to_le_bytes()).collect();
            self.section(tag::ORIGIN, &raw)?;
        }
        units::to_bytes(self.header.units).map_or(Ok(()), |raw| self.section(tag::UNITS, &raw))
    }

    fn write_errors(&mut self) -> Result<(), Error> {
        let raw = f32_bytes(self.errors.as_flattened());
        if self.is_coded {
            let coded = encode_errors(&self.errors);
            if coded.len() < raw.len() {
                return self.coded(tag::ERRORS, &coded, raw.len(), (0, 0));
            }
        }
        self.section(tag::ERRORS, &raw)
    }

    fn flush_chunk(&mut self) -> Result<(), Error> {
        let count = self.pending.len() / (3 * self.header.rows_per_frame as usize);
        if count == 0 {
            return Ok(());
        }
        let raw = f32_bytes(&self.pending);
        self.pending.clear();
        let frames = ((self.errors.len() - count) as u32, count as u32);
        self.encoded(SectionHeader::new(tag::FRAMES, frames), &raw)
    }

    /// Single precision where it loses nothing, as for models that came from such a file.
    fn positions(&mut self, tag: [u8; 4], points: &[Point], coded: Option<&CodedMesh>) -> Result<(), Error> {
        if let Some(coded) = coded {
            return self.coded(tag, &coded.positions, 12 * points.len(), (0, 0));
        }
        let single = points.iter().flatten().all(|&x| f64::from(x as f32).to_bits() == x.to_bits());
        let (width, raw): (u8, Vec<u8>) = if single {
            (4, points.iter().flatten().flat_map(|&x| (x as f32).to_le_bytes()).collect())
        } else {
            (8, points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect())
        };
        self.encoded(SectionHeader { width, ..SectionHeader::new(tag, (0, 0)) }, &raw)
    }

    fn faces(&mut self, tag: [u8; 4], numbers: &[u32], coded: Option<&CodedMesh>) -> Result<(), Error> {
        if let Some(coded) = coded {
            return self.coded(tag, &coded.faces, 4 * numbers.len(), (0, 0));
        }
        let raw: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.section(tag, &raw)
    }

    pub(super) fn section(&mut self, tag: [u8; 4], raw: &[u8]) -> Result<(), Error> {
        self.encoded(SectionHeader::new(tag, (0, 0)), raw)
    }

    /// Encodes what a section decodes to.
    pub(super) fn encoded(&mut self, header: SectionHeader, raw: &[u8]) -> Result<(), Error> {
        let stride = if header.tag == tag::FRAMES { 3 * self.header.rows_per_frame as usize } else { 1 };
        let (header, payload) = codec::encode(header, raw, stride)?;
        // Readers refuse what expands too far, lest a small file takes all their memory.
        if header.raw_bytes > SectionHeader::most_raw_bytes(header.tag, header.codec, payload.len() as u64) {
            return self.payload(SectionHeader { codec: RAW, ..header }, raw);
        }
        self.payload(header, &payload)
    }

    /// Writes whole numbers that are encoded already.
    fn coded(&mut self, tag: [u8; 4], payload: &[u8], raw_bytes: usize, frames: (u32, u32)) -> Result<(), Error> {
        let codec = if [tag::RESIDUAL, tag::FRAMES].contains(&tag) { CODED } else { CODED_STATIC };
        let header = SectionHeader { codec, raw_bytes: raw_bytes as u64, ..SectionHeader::new(tag, frames) };
        self.payload(header, payload)
    }

    pub(super) fn payload(&mut self, header: SectionHeader, payload: &[u8]) -> Result<(), Error> {
        let header = SectionHeader { payload_bytes: payload.len() as u64, ..header };
        self.contents.extend(Entry { offset: self.offset, header }.to_bytes());
        self.put(&header.sealed(crc32c::crc32c(payload)))?;
        self.put(payload)
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), Error> {
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
