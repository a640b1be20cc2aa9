//! Reading the cages of frames, and what is known of each.

use super::reader::ContainerReader;
use super::section::{CODED, Entry};
use super::{Error, are_frame_numbers, counted_from_zero, tag};
use crate::le;
use crate::report::{FrameError, Report, WorstError};
use cager_codec::decode_errors;
use cager_geometry::mesh::diagonal;
use std::io::{Read, Seek};

impl<R: Read + Seek> ContainerReader<R> {
    pub(super) fn chunk_of(&self, frame: usize) -> Result<Entry, Error> {
        let place = self.place_of(frame).ok_or(Error::NoSuchFrame { frame, frames: self.frames })?;
        Ok(self.entries[place])
    }

    /// Where the section of a frame's cage is among all.
    pub(super) fn place_of(&self, frame: usize) -> Option<usize> {
        let chunk = self.chunks.partition_point(|&k| self.entries[k].header.first as usize <= frame);
        self.chunks.get(chunk.checked_sub(1)?).filter(|_| frame < self.frames).copied()
    }

    /// The rows of a frame, rows × 3, with all [`layers`](Self::layers) that are on.
    pub fn read_frame(&mut self, frame: usize, out: &mut Vec<f32>) -> Result<(), Error> {
        self.read_frame_unedited(frame, out)?;
        self.apply_layers(frame, out)
    }

    /// The same without layers of edits.
    pub fn read_frame_unedited(&mut self, frame: usize, out: &mut Vec<f32>) -> Result<(), Error> {
        let entry = self.chunk_of(frame)?;
        let raw = match self.cached.take().filter(|(offset, _)| *offset == entry.offset) {
            Some((_, raw)) => raw,
            None if entry.header.codec == CODED => self.group(entry)?,
            None => self.raw(entry)?,
        };
        let bytes = 12 * self.header.rows_per_frame as usize;
        let start = (frame - entry.header.first as usize) * bytes;
        out.clear();
        out.extend(le::values(&raw[start..start + bytes], f32::from_le_bytes));
        self.cached = Some((entry.offset, raw));
        if out.iter().any(|x| !x.is_finite()) {
            return Err(Error::corrupt(entry.offset, format!("the cage of frame {frame} is not finite")));
        }
        Ok(())
    }

    /// Errors of all frames before any edit; [`Self::report`] has those of the frames as they are.
    ///
    /// # Errors
    /// Damage; a file that was cut before them.
    pub fn errors(&mut self) -> Result<Vec<FrameError>, Error> {
        let errors = match self.coded(tag::ERRORS)? {
            Some(coded) => coded.decode(|bytes| decode_errors(bytes, self.frames))?,
            None => {
                let error = |b: [u8; 8]| [0, 4].map(|at| le::value_at(&b, at, f32::from_le_bytes));
                self.numbers(self.entry(tag::ERRORS)?, error)?
            }
        };
        Ok(errors.into_iter().map(|[l2, linf]| FrameError { l2: l2.into(), linf: linf.into() }).collect())
    }

    /// The numbers of the frames where they come from, such as their files; or 0, 1, 2, …
    pub fn frame_numbers(&mut self) -> Result<Vec<f64>, Error> {
        let Some(entry) = self.sections_of(tag::NUMBERS).next() else {
            return Ok((0..self.frames).map(|frame| frame as f64).collect());
        };
        let numbers = self.numbers(entry, f64::from_le_bytes)?;
        if are_frame_numbers(&numbers) {
            Ok(numbers)
        } else {
            Err(Error::corrupt(entry.offset, "the numbers of the frames do not ascend"))
        }
    }

    /// The report of the encoding, without its times; what the file does not say is empty.
    pub fn report(&mut self) -> Result<Report, Error> {
        let mut report = match self.optional(tag::REPORT)? {
            Some((offset, raw)) => serde_json::from_slice(&raw)
                .map_err(|e| Error::corrupt(offset, format!("the report cannot be read ({e})")))?,
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
}
