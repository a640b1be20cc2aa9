//! Which sections a container has, by its table of contents or, of a cut file, their headers; and
//! whether they are as many and as large as the header says.

use super::edits::MAX_LAYERS;
use super::reader::ContainerReader;
use super::section::{CODED, ENTRY_BYTES, Entry, FOOTER_BYTES, HEADER_BYTES, PRELUDE_BYTES, RAW, SectionHeader};
use super::units::UNITS_BYTES;
use super::{Error, tag};
use std::io::{Read, Seek};

impl<R: Read + Seek> ContainerReader<R> {
    pub(super) fn read_contents(&mut self, offset: u64) -> Result<(), Error> {
        let end = self.file_bytes - FOOTER_BYTES as u64;
        let corrupt = |what: &str| Err(Error::corrupt(offset, what));
        if offset < PRELUDE_BYTES as u64 || offset > end.saturating_sub(HEADER_BYTES as u64) {
            return Err(Error::corrupt(end, "the table of contents lies outside the file"));
        }
        let entry = self.entry_at(offset)?.0;
        if entry.header.tag != tag::CONTENTS || entry.header.codec != RAW || entry.end() != Some(end) {
            return corrupt("there is no table of contents where the end says");
        }
        let contents = self.raw(entry)?;
        let (lines, rest) = contents.as_chunks::<ENTRY_BYTES>();
        if !rest.is_empty() {
            return corrupt("the table of contents is cut");
        }
        let mut next = PRELUDE_BYTES as u64;
        for line in lines {
            let entry = Entry::from_bytes(line);
            // Sections follow each other without gaps, so that no byte of the file goes unchecked.
            if entry.offset != next {
                return corrupt("the table of contents leaves a gap");
            }
            let Some(end) = entry.end().filter(|&end| end <= offset) else {
                return corrupt("the table of contents lists a section beyond itself");
            };
            next = end;
            self.add_entry(entry)?;
        }
        if next == offset { Ok(()) } else { corrupt("the table of contents does not list all sections") }
    }

    /// Lists the sections up to the first that is damaged or not all there.
    pub(super) fn scan(&mut self) -> Result<(), Error> {
        self.layers.is_cut = true;
        let mut next = PRELUDE_BYTES as u64;
        while let Ok((entry, _)) = self.entry_at(next) {
            self.layers.is_cut = entry.header.tag != tag::CONTENTS;
            let Some(end) = entry.end().filter(|&end| end <= self.file_bytes && self.layers.is_cut) else { break };
            self.add_entry(entry)?;
            next = end;
        }
        Ok(())
    }

    fn add_entry(&mut self, entry: Entry) -> Result<(), Error> {
        let header = entry.header;
        if header.is_required() && !tag::KNOWN.contains(&header.tag) {
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

    /// Every section must be there as often and be as large as the header says.
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
        if 8 * self.frames as u64 > SectionHeader::most_raw_bytes(tag::ERRORS, RAW, self.file_bytes) {
            return Err(Error::corrupt(0, "the file counts more frames than it can hold"));
        }
        self.check_layers(whole)?;
        let h = &self.header;
        if h.rest_faces == 0 && h.rest_corners > 0 {
            return Err(Error::corrupt(0, "the header counts corners of a model without faces"));
        }
        let at_most_one = [
            tag::ORIGIN,
            tag::UNITS,
            tag::REST_COLORS,
            tag::SURFACE,
            tag::PICTURES,
            tag::COMPONENTS,
            tag::ELEMENTS,
            tag::NUMBERS,
            tag::REPORT,
        ]
        .map(|tag| (tag, 0..=1));
        let faces = usize::from(h.rest_faces > 0);
        for (tag, expected) in [(tag::REST_FACES, faces..=faces), (tag::CONTENTS, 0..=0)].into_iter().chain(at_most_one)
        {
            let count = self.sections_of(tag).count();
            if !expected.contains(&count) {
                let name = String::from_utf8_lossy(&tag);
                return Err(Error::corrupt(0, format!("the section {name} is there {count} times")));
            }
        }
        for Entry { offset, header: s } in &self.entries {
            let positions = |points: u64| points.saturating_mul(3 * u64::from(s.width));
            let (raw_bytes, widths): (u64, &[u8]) = match s.tag {
                tag::REST_POINTS => (positions(h.points), &[4, 8]),
                tag::CAGE_VERTICES => (positions(h.cage_vertices), &[4, 8]),
                tag::REST_FACES => (h.rest_faces.saturating_add(h.rest_corners).saturating_mul(4), &[4]),
                tag::CAGE_FACES => (h.cage_faces.saturating_mul(12), &[4]),
                tag::REST_COLORS => (h.points.saturating_mul(3), &[1]),
                tag::ORIGIN => (24, &[8]),
                tag::UNITS => (UNITS_BYTES as u64, &[1]),
                tag::FRAMES => ((u64::from(s.count) * u64::from(h.rows_per_frame)).saturating_mul(12), &[4]),
                tag::ERRORS => (8 * self.frames as u64, &[4]),
                tag::NUMBERS => (8 * self.frames as u64, &[8]),
                tag::EDIT | tag::COMPONENTS => (s.raw_bytes, &[4]),
                tag::SURFACE | tag::PICTURES | tag::ELEMENTS | tag::RESIDUAL => (s.raw_bytes, &[1]),
                _ => (s.raw_bytes, if s.width > 0 { std::slice::from_ref(&s.width) } else { &[] }),
            };
            if raw_bytes != s.raw_bytes || !widths.contains(&s.width) {
                return Err(Error::corrupt(*offset, "a section does not have the size that the header gives it"));
            }
        }
        Ok(())
    }

    /// Layers of edits are few, small, and about frames that are there, unless the file was cut.
    fn check_layers(&self, whole: bool) -> Result<(), Error> {
        let most = SectionHeader::most_raw_bytes(tag::EDIT, RAW, self.file_bytes);
        let mut raw_bytes = 0_u64;
        for (k, Entry { offset, header }) in self.sections_of(tag::EDIT).enumerate() {
            if header.count == 0 || whole && header.frames().end > self.frames {
                return Err(Error::corrupt(offset, "a layer of edits is about frames that are not there"));
            }
            raw_bytes = raw_bytes.saturating_add(header.raw_bytes);
            if k >= MAX_LAYERS || raw_bytes > most {
                return Err(Error::corrupt(offset, "the file has more layers of edits than it can hold"));
            }
        }
        Ok(())
    }
}
