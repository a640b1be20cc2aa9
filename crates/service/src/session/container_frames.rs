//! A session's container, written as its frames come.

use super::Session;
use super::groups::StoredGroup;
use crate::preparation::{Geometry, Prepared, ValidOptions};
use cager_capture::capture::{CaptureWriter, Encoding, StoredError};
use cager_capture::coding::Carried;
use cager_proto::container;
use cager_proto::le;
use std::io::{self, Write};

/// Stored frames read at a time.
const READ_FRAMES: usize = 64;

/// Writes a container from its beginning on: the meshes, then frames in order, and what comes after them.
pub(crate) struct ContainerFrames<W: Write> {
    writer: CaptureWriter<W>,
    diagonal: f64,
    points: usize,
    /// What the last group left.
    carried: Carried,
    /// Whether it is written to complete the session, and so has the groups that are coded for that.
    completes: bool,
}

impl<W: Write> ContainerFrames<W> {
    /// Writes what comes before the frames.
    ///
    /// # Errors
    /// Options of another version; an output that refuses.
    pub(crate) fn begin(session: &Session, prepared: &Prepared, geometry: &Geometry, out: W) -> io::Result<Self> {
        let valid = ValidOptions::of(&session.meta.options)?;
        let encoding = Encoding {
            rest: &geometry.rest,
            cage: &geometry.cage,
            system: valid.system,
            options: prepared.options,
            solver: &prepared.solver,
            frame_rate: session.meta.options.frame_rate,
            origin: None,
            units: geometry.units,
        };
        let coded = geometry.coded.as_ref().map(|(rest, cage)| (rest, cage));
        let writer = CaptureWriter::new(out, &encoding, coded).map_err(plain)?;
        let points = geometry.rest.points.len();
        Ok(Self { writer, diagonal: prepared.solver.diagonal(), points, carried: Carried::default(), completes: false })
    }

    /// With the groups that are coded for the completion that is going on.
    pub(crate) fn completing(self) -> Self {
        Self { completes: true, ..self }
    }

    /// Frames written so far.
    pub(crate) fn frames(&self) -> u32 {
        self.writer.frames() as u32
    }

    /// Bytes written so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.writer.bytes()
    }

    /// Writes the next frames below `end`: a coded group, or some frames as they were solved. Returns false if the next
    /// frame is not ready. Blocks.
    ///
    /// # Errors
    /// Damage; an output that refuses.
    pub(crate) fn write_next(&mut self, session: &Session, end: u32) -> io::Result<bool> {
        let next = self.frames();
        if next >= end {
            return Ok(false);
        }
        if session.goal().is_some() {
            let group = if self.completes { session.group_to_write(next) } else { session.coded_group(next) };
            let Some(group) = group.filter(|group| group.first + group.frames <= end) else { return Ok(false) };
            let stored = session.read_group(group.first)?;
            let StoredGroup { cages, residual, errors, farthest, .. } = &stored;
            let written = self.writer.write_group(cages, residual.as_deref(), errors, *farthest);
            self.carried = stored.carried;
            return written.map(|()| true).map_err(plain);
        }
        let entries = session.frames().run(next, READ_FRAMES.min((end - next) as usize));
        let mut bytes = Vec::new();
        session.read_cages(&entries, &mut bytes)?;
        for (entry, bytes) in entries.iter().zip(bytes.chunks_exact((bytes.len() / entries.len().max(1)).max(1))) {
            let error = StoredError { l2: entry.l2, linf: entry.linf, squared: entry.squared, spread: entry.spread };
            self.writer.write_frame(&le::f32s(bytes), &error).map_err(plain)?;
        }
        Ok(!entries.is_empty())
    }

    /// Writes what comes after the frames, and gives back the output, which the caller flushes.
    ///
    /// # Errors
    /// An output that refuses.
    pub(crate) fn finish(mut self, session: &Session) -> io::Result<W> {
        let rows = session.facts().map_or(1, |facts| facts.unknowns as usize);
        let group_frames = cager_capture::coding::group_frames(self.points, rows);
        let coding =
            |goal: cager_capture::coding::Goal| goal.coding(&self.carried, self.points, self.diagonal, group_frames);
        if let Some(coding) = session.goal().and_then(coding) {
            self.writer.set_coding(coding);
        }
        self.writer.finish().map(|(out, _)| out).map_err(plain)
    }
}

fn plain(error: container::Error) -> io::Error {
    match error {
        container::Error::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}
