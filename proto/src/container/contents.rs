//! Which sections a container has: the table of contents, or the headers of a cut file one after another; and whether they are as many and as large as the header says.

use super::codec::{self, CODED};
use super::edits::MAX_LAYERS;
use super::reader::ContainerReader;
use super::section::{Entry, FOOTER_BYTES, HEADER_BYTES, PRELUDE_BYTES, SectionHeader};
use super::units::UNITS_BYTES;
use super::{Error, tag};
use crate::le::u64_at;
use std::io::{Read, Seek};

/// Bytes of one entry of the table of contents: an offset and the section's header but for its checksums.
const ENTRY_BYTES: usize = 40;

impl<R: Read + Seek> ContainerReader<R> {
    pub(super) fn read_contents(&mut self, offset: u64) -> Result<(), Error> {
        let end = self.file_bytes - FOOTER_BYTES as u64;
        if offset < PRELUDE_BYTES as u64 || offset.checked_add(HEADER_BYTES as u64).is_none_or(|start| start > end) {
            return Err(Error::corrupt(end, "the table of contents lies outside the file"));
        }
        let header = self.header_at(offset)?;
        if header.tag != tag::CONTENTS
            || header.codec != codec::RAW
            || header.payload_bytes != end - offset - HEADER_BYTES as u64
        {
            return Err(Error::corrupt(offset, "there is no table of contents where the end says"));
        }
        let contents = self.raw(Entry { offset, header })?;
        if contents.len() % ENTRY_BYTES != 0 {
            return Err(Error::corrupt(offset, "the table of contents is cut"));
        }
        let mut next = PRELUDE_BYTES as u64;
        for line in contents.chunks_exact(ENTRY_BYTES) {
            let at = u64_at(line, 0);
            let header = SectionHeader::without_checksum(&line[8..]);
            // Sections follow each other without gaps, so that no byte of the file goes unchecked.
            if at != next {
                return Err(Error::corrupt(offset, "the table of contents leaves a gap"));
            }
            next = at
                .checked_add(HEADER_BYTES as u64)
                .and_then(|x| x.checked_add(header.payload_bytes))
                .filter(|&x| x <= offset)
                .ok_or_else(|| Error::corrupt(offset, "the table of contents lists a section beyond itself"))?;
            self.add_entry(Entry { offset: at, header })?;
        }
        if next == offset {
            Ok(())
        } else {
            Err(Error::corrupt(offset, "the table of contents does not list all sections"))
        }
    }

    pub(super) fn add_entry(&mut self, entry: Entry) -> Result<(), Error> {
        let header = entry.header;
        if SectionHeader::is_required(header.tag) && !tag::KNOWN.contains(&header.tag) {
            return Err(Error::UnknownSection(String::from_utf8_lossy(&header.tag).into_owned()));
        }
        // A residual comes right before the frames that it belongs to.
        let residual = self.entries.last().filter(|last| last.header.tag == tag::RESIDUAL).map(|last| last.header);
        let of_other =
            |last: SectionHeader| header.tag != tag::FRAMES || (last.first, last.count) != (header.first, header.count);
        if residual.is_some_and(of_other) || header.tag == tag::RESIDUAL && header.codec != CODED {
            return Err(Error::corrupt(entry.offset, "a residual is not followed by its frames"));
        }
        if header.tag == tag::FRAMES {
            let end = header.first.checked_add(header.count);
            let (true, Some(end)) = (header.first as usize == self.frames && header.count > 0, end) else {
                return Err(Error::corrupt(entry.offset, "the frames are not in order"));
            };
            self.frames = end as usize;
            self.chunks.push(self.entries.len());
        }
        self.entries.push(entry);
        Ok(())
    }

    /// Lists the sections from front to back, up to the first whose header is damaged or whose payload is not all there.
    pub(super) fn scan(&mut self) -> Result<(), Error> {
        let mut next = PRELUDE_BYTES as u64;
        self.layers.is_cut = true;
        while next + HEADER_BYTES as u64 <= self.file_bytes {
            let Ok(header) = self.header_at(next) else { break };
            self.layers.is_cut = header.tag != tag::CONTENTS;
            let end = (next + HEADER_BYTES as u64).checked_add(header.payload_bytes);
            let Some(end) = end.filter(|&end| end <= self.file_bytes && header.tag != tag::CONTENTS) else { break };
            self.add_entry(Entry { offset: next, header: SectionHeader { payload_crc: 0, ..header } })?;
            next = end;
        }
        Ok(())
    }

    /// Every section must be there as often as it should, and have the size that the header's counts give it.
    pub(super) fn check_sizes(&self, whole: bool) -> Result<(), Error> {
        for tag in [tag::REST_POINTS, tag::CAGE_VERTICES, tag::CAGE_FACES] {
            self.entry(tag)?;
        }
        if whole {
            self.entry(tag::ERRORS)?;
            if let Some(last) = self.entries.last().filter(|last| last.header.tag == tag::RESIDUAL) {
                return Err(Error::corrupt(last.offset, "a residual is not followed by its frames"));
            }
        }
        // Whoever lists frames takes memory for each before any is read.
        if 8 * self.frames as u64 > SectionHeader::most_raw_bytes(tag::ERRORS, codec::RAW, self.file_bytes) {
            return Err(Error::corrupt(0, "the file counts more frames than it can hold"));
        }
        self.check_layers(whole)?;
        let most_faces = usize::from(self.header.rest_faces > 0);
        if most_faces == 0 && self.header.rest_corners > 0 {
            return Err(Error::corrupt(0, "the header counts corners of a model without faces".to_owned()));
        }
        for (tag, least, most) in [
            (tag::REST_FACES, most_faces, most_faces),
            (tag::ORIGIN, 0, 1),
            (tag::UNITS, 0, 1),
            (tag::REST_COLORS, 0, 1),
            (tag::ELEMENTS, 0, 1),
            (tag::NUMBERS, 0, 1),
            (tag::REPORT, 0, 1),
            (tag::CONTENTS, 0, 0),
        ] {
            let count = self.entries.iter().filter(|e| e.header.tag == tag).count();
            if count < least || count > most {
                let name = String::from_utf8_lossy(&tag);
                return Err(Error::corrupt(0, format!("the section {name} is there {count} times")));
            }
        }
        for entry in &self.entries {
            let (h, s) = (&self.header, &entry.header);
            let expected = match s.tag {
                tag::REST_POINTS => h.points.checked_mul(3 * u64::from(s.width)),
                tag::ORIGIN => Some(24),
                tag::UNITS => Some(UNITS_BYTES as u64),
                tag::REST_COLORS => h.points.checked_mul(3),
                tag::REST_FACES => h.rest_faces.checked_add(h.rest_corners).and_then(|n| n.checked_mul(4)),
                tag::CAGE_VERTICES => h.cage_vertices.checked_mul(3 * u64::from(s.width)),
                tag::CAGE_FACES => h.cage_faces.checked_mul(12),
                tag::FRAMES => {
                    u64::from(s.count).checked_mul(12).and_then(|n| n.checked_mul(u64::from(h.rows_per_frame)))
                }
                tag::ERRORS | tag::NUMBERS => Some(8 * self.frames as u64),
                _ => Some(s.raw_bytes),
            };
            let width_fits = match s.tag {
                tag::REST_POINTS | tag::CAGE_VERTICES => s.width == 4 || s.width == 8,
                tag::REST_FACES | tag::CAGE_FACES | tag::FRAMES | tag::ERRORS | tag::EDIT => s.width == 4,
                tag::ORIGIN | tag::NUMBERS => s.width == 8,
                tag::UNITS | tag::REST_COLORS | tag::ELEMENTS | tag::RESIDUAL => s.width == 1,
                _ => s.width > 0,
            };
            if expected != Some(s.raw_bytes) || !width_fits {
                return Err(Error::corrupt(entry.offset, "a section does not have the size that the header gives it"));
            }
        }
        Ok(())
    }

    /// Layers of edits are few, small, and about frames that are there; of a cut file, those before its end.
    fn check_layers(&self, whole: bool) -> Result<(), Error> {
        let (mut count, mut raw_bytes) = (0, 0_u64);
        for entry in self.sections_of(tag::EDIT) {
            let header = entry.header;
            let end = u64::from(header.first) + u64::from(header.count);
            if header.count == 0 || whole && end > self.frames as u64 {
                return Err(Error::corrupt(entry.offset, "a layer of edits is about frames that are not there"));
            }
            (count, raw_bytes) = (count + 1, raw_bytes.saturating_add(header.raw_bytes));
            let most = SectionHeader::most_raw_bytes(tag::EDIT, codec::RAW, self.file_bytes);
            if count > MAX_LAYERS || raw_bytes > most {
                return Err(Error::corrupt(entry.offset, "the file has more layers of edits than it can hold"));
            }
        }
        Ok(())
    }
}
