//! Reads frames on a dedicated thread and encodes them as chunks of a request body.

use crate::error::ClientError;
use crate::source::FrameSource;
use crate::upload::set::FrameRange;
use bytes::Bytes;
use cager_proto::record::{self, Kind};
use std::io;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use tokio::sync::{mpsc as async_mpsc, oneshot};

/// Size of the chunks, whole frames each: few hand-overs at little memory.
pub(crate) const PIECE_BYTES: usize = 512 << 10;

/// Chunks buffered ahead of the connection.
const WAITING_PIECES: usize = 3;

/// Interval at which an idle connection gets an incomplete chunk, so that a slow source does not delay its frames.
const FLUSH_INTERVAL: Duration = Duration::from_millis(5);

/// Encoding of the request body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// Rows back to back: one range of frames.
    Raw,
    /// Frame records, which say their numbers: any frames.
    Records,
}

/// What to read for the requests of one pass.
struct Job {
    ranges: Vec<FrameRange>,
    layout: Layout,
    /// Most frames to read.
    most: u32,
    /// The first frame is a piece of its own, so that it can be answered before the next is sent.
    first_alone: bool,
    pieces: async_mpsc::Sender<Bytes>,
    outcome: oneshot::Sender<Outcome>,
}

/// How reading ended: the number of frames of the capture, where its end was met.
pub(crate) type Outcome = Result<Option<u32>, ClientError>;

/// The chunks of request bodies, any of which may send any chunk, and how reading ended.
pub(crate) struct BodyChunks {
    pub(crate) pieces: async_mpsc::Receiver<Bytes>,
    pub(crate) outcome: oneshot::Receiver<Outcome>,
}

/// Handle to the reading thread, which ends after its current frame when this is dropped.
pub(crate) struct FrameFeed {
    jobs: mpsc::Sender<Job>,
}

impl FrameFeed {
    /// `handles` are the rows to send of every frame; without them all are.
    pub(crate) fn start(
        mut source: impl FrameSource + 'static,
        handles: Option<Vec<u32>>,
    ) -> Result<Self, ClientError> {
        let (jobs, queue) = mpsc::channel::<Job>();
        let run = move || {
            let mut reader = Reader { position: None, frame: Vec::new(), rows: Vec::new(), handles };
            for Job { ranges, layout, most, first_alone, pieces, outcome } in queue {
                let mut body =
                    BodyWriter { pieces, piece: Vec::new(), layout, alone: first_alone, flushed: Instant::now() };
                let end = reader.read(&mut source, &ranges, most, &mut body);
                // Before `body` goes, so that whoever sees the body's end finds the outcome.
                if let Some(end) = end {
                    let _ = outcome.send(end);
                }
            }
        };
        std::thread::Builder::new()
            .name("cager-frames".to_owned())
            .spawn(run)
            .map_err(|cause| ClientError::Source { frame: 0, cause })?;
        Ok(Self { jobs })
    }

    /// Starts reading the first `most` frames of a request; an earlier request is abandoned.
    ///
    /// # Errors
    /// The thread is gone, since the source has panicked.
    pub(crate) fn read(
        &self,
        ranges: Vec<FrameRange>,
        layout: Layout,
        most: u32,
        first_alone: bool,
    ) -> Result<BodyChunks, ClientError> {
        let frame = ranges.first().map_or(0, |range| range.first);
        let (pieces, receive) = async_mpsc::channel(WAITING_PIECES);
        let (outcome, ended) = oneshot::channel();
        let job = Job { ranges, layout, most, first_alone, pieces, outcome };
        self.jobs.send(job).map_err(|_| {
            let cause = io::Error::other("the thread that reads the frames has panicked; look at its message");
            ClientError::Source { frame, cause }
        })?;
        Ok(BodyChunks { pieces: receive, outcome: ended })
    }
}

struct Reader {
    /// The frame that the source would read next.
    position: Option<u32>,
    frame: Vec<f32>,
    rows: Vec<f32>,
    handles: Option<Vec<u32>>,
}

impl Reader {
    /// Reads `most` frames of the ranges; `None` if the request was abandoned.
    fn read(
        &mut self,
        source: &mut impl FrameSource,
        ranges: &[FrameRange],
        mut most: u32,
        body: &mut BodyWriter,
    ) -> Option<Outcome> {
        for range in ranges {
            let mut next = range.first;
            while most > 0 && range.end.is_none_or(|end| next < end) {
                most -= 1;
                match self.read_frame(source, next) {
                    Ok(true) => {}
                    Ok(false) if range.end.is_none() => {
                        body.flush()?;
                        return Some(Ok(Some(next)));
                    }
                    Ok(false) => {
                        body.flush()?;
                        let what =
                            format!("the frames end before frame {next}, which is missing; give the whole capture");
                        return Some(Err(ClientError::Mismatch(what)));
                    }
                    Err(error) => {
                        // The frames before it are complete; send them.
                        body.flush()?;
                        return Some(Err(error));
                    }
                }
                let (kind, rows) = match &self.handles {
                    None => (Kind::Positions, &self.frame),
                    Some(_) => (Kind::HandleRows, &self.rows),
                };
                body.frame(kind, next, rows)?;
                next = match next.checked_add(1) {
                    Some(next) => next,
                    None => return Some(Ok(None)),
                };
            }
        }
        body.flush()?;
        Some(Ok(None))
    }

    fn read_frame(&mut self, source: &mut impl FrameSource, frame: u32) -> Result<bool, ClientError> {
        let failed = |cause| ClientError::Source { frame, cause };
        // After an error the position of the source is unknown.
        if self.position.take() != Some(frame) {
            source.seek(frame).map_err(failed)?;
        }
        if !source.read(&mut self.frame).map_err(failed)? {
            return Ok(false);
        }
        self.position = frame.checked_add(1);
        let expected = 3 * source.points();
        if self.frame.len() != expected {
            let found = self.frame.len();
            return Err(ClientError::Mismatch(format!(
                "frame {frame} has {found} coordinates where {expected} are expected; give every point of every frame"
            )));
        }
        if let Some(handles) = &self.handles {
            self.rows.clear();
            for &handle in handles {
                let at = 3 * handle as usize;
                self.rows.extend_from_slice(&self.frame[at..at + 3]);
            }
        }
        Ok(true)
    }
}

struct BodyWriter {
    pieces: async_mpsc::Sender<Bytes>,
    piece: Vec<u8>,
    layout: Layout,
    alone: bool,
    flushed: Instant,
}

impl BodyWriter {
    /// Adds a frame; `None` if the request was abandoned.
    fn frame(&mut self, kind: Kind, frame: u32, rows: &[f32]) -> Option<()> {
        match self.layout {
            Layout::Raw => self.piece.extend(rows.iter().flat_map(|x| x.to_le_bytes())),
            // The rows were counted: they cannot be of another shape.
            Layout::Records => drop(record::encode(kind, frame, f32::NAN, f32::NAN, rows, &mut self.piece)),
        }
        let idle = self.pieces.capacity() == self.pieces.max_capacity() && self.flushed.elapsed() >= FLUSH_INTERVAL;
        if std::mem::take(&mut self.alone) || idle || self.piece.len() >= PIECE_BYTES { self.flush() } else { Some(()) }
    }

    fn flush(&mut self) -> Option<()> {
        let piece = Bytes::from(std::mem::take(&mut self.piece));
        if !piece.is_empty() {
            self.pieces.blocking_send(piece).ok()?;
        }
        self.flushed = Instant::now();
        Some(())
    }
}

/// Whether all handles are points.
pub(crate) fn check_handles(handles: &[u32], points: u32) -> Result<(), ClientError> {
    match handles.iter().find(|&&handle| handle >= points) {
        None => Ok(()),
        Some(handle) => Err(ClientError::Protocol(format!("handle {handle} is none of the {points} points"))),
    }
}
