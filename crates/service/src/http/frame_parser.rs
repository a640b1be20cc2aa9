//! Reassembles frames from the chunks of a request body.

use crate::file_bodies::{TELLING_BYTES, refuse_file};
use crate::problem::{self, ApiError};
use crate::session::facts::Facts;
use cager_core::inversion::Rows;
use cager_proto::record::{self, FrameHeader, Kind, RecordError};
use serde::Deserialize;

/// The highest number of a frame: a capture has at most `u32::MAX`.
const LAST_FRAME: u32 = u32::MAX - 1;

/// A complete frame.
#[derive(Debug, PartialEq)]
pub(crate) struct ReceivedFrame {
    pub(crate) frame: u32,
    pub(crate) rows: Rows,
    /// Little-endian f32, three for each row.
    pub(crate) bytes: Vec<u8>,
}

/// Which rows of a frame come.
#[derive(Clone, Copy, Debug, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum RowsQuery {
    All,
    Handles,
}

/// How frames are laid out in a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BodyLayout {
    /// Back to back, numbered from `first`.
    Raw { first: u32, rows: Rows },
    /// As frame records, which contain their numbers.
    Records,
}

/// Incremental parser of a request body.
pub(crate) struct FrameReader {
    layout: BodyLayout,
    points: u32,
    handles: u32,
    /// Number of the next raw frame; an error beyond [`LAST_FRAME`].
    next: u64,
    head: Vec<u8>,
    record: Option<FrameHeader>,
    bytes: Vec<u8>,
    begun: bool,
    /// Whether the first bytes may still turn out to be those of a file; records have a beginning of their own.
    may_be_file: bool,
}

impl FrameReader {
    pub(crate) fn new(layout: BodyLayout, facts: &Facts) -> Self {
        let next = match layout {
            BodyLayout::Raw { first, .. } => u64::from(first),
            BodyLayout::Records => 0,
        };
        Self {
            layout,
            points: facts.points,
            handles: facts.handle_count,
            next,
            head: Vec::new(),
            record: None,
            bytes: Vec::new(),
            begun: false,
            may_be_file: matches!(layout, BodyLayout::Raw { .. }),
        }
    }

    /// Size of the largest possible next frame, in bytes; the caller reserves this much memory before it calls [`Self::push`].
    pub(crate) fn frame_bytes(&self) -> usize {
        let rows = match self.layout {
            BodyLayout::Raw { rows: Rows::Handles, .. } => self.handles,
            BodyLayout::Raw { rows: Rows::All, .. } => self.points,
            BodyLayout::Records => self.points.max(self.handles),
        };
        12 * rows as usize
    }

    /// Whether no byte of the next frame has been received.
    pub(crate) fn is_between_frames(&self) -> bool {
        !self.begun
    }

    /// Consumes bytes from the front of `input`; returns a frame once it is complete.
    ///
    /// # Errors
    /// A record that is damaged or of another kind or size; a file in place of numbers.
    pub(crate) fn push(&mut self, input: &mut &[u8]) -> Result<Option<ReceivedFrame>, ApiError> {
        if input.is_empty() {
            return Ok(None);
        }
        self.begun = true;
        let (frame, rows, needed) = match self.layout {
            BodyLayout::Raw { rows, .. } => (numbered(self.next)?, rows, self.frame_bytes()),
            BodyLayout::Records => {
                let Some(header) = self.header(input)? else { return Ok(None) };
                let rows = if header.kind == Kind::HandleRows { Rows::Handles } else { Rows::All };
                (numbered(header.frame.into())?, rows, header.row_bytes() as usize)
            }
        };
        if self.bytes.capacity() < needed {
            self.bytes.reserve_exact(needed - self.bytes.len());
        }
        let take = input.len().min(needed - self.bytes.len());
        self.bytes.extend_from_slice(&input[..take]);
        *input = &input[take..];
        let telling = needed.min(TELLING_BYTES);
        if self.may_be_file && self.bytes.len() >= telling {
            self.refuse_file(telling)?;
            self.may_be_file = false;
        }
        if self.bytes.len() < needed {
            return Ok(None);
        }
        let bytes = std::mem::take(&mut self.bytes);
        if let Some(header) = self.record.take()
            && crc32c::crc32c(&bytes) != header.crc
        {
            return Err(refused(&RecordError::Checksum { frame }).frame(frame));
        }
        self.head.clear();
        self.begun = false;
        self.next += 1;
        Ok(Some(ReceivedFrame { frame, rows, bytes }))
    }

    /// Checks that the body may end here.
    ///
    /// # Errors
    /// The body ends within a frame, or is a short file.
    pub(crate) fn finish(&self) -> Result<(), ApiError> {
        if !self.begun {
            return Ok(());
        }
        if self.may_be_file {
            self.refuse_file(self.bytes.len())?;
        }
        let (which, have, needed) = match (self.layout, self.record) {
            (BodyLayout::Raw { .. }, _) => (format!("frame {}", self.next), self.bytes.len(), self.frame_bytes()),
            (BodyLayout::Records, Some(header)) => {
                (format!("frame {}", header.frame), self.bytes.len(), header.row_bytes() as usize)
            }
            (BodyLayout::Records, None) => {
                ("the header of a frame record".to_owned(), self.head.len(), record::HEADER_BYTES)
            }
        };
        Err(ApiError::new(
            problem::BAD_REQUEST,
            format!("the body ends within {which}, after {have} of {needed} bytes; send whole frames"),
        ))
    }

    /// Looks at as many bytes whatever pieces they come in.
    fn refuse_file(&self, telling: usize) -> Result<(), ApiError> {
        refuse_file(&self.bytes[..telling]).map_err(|mut error| {
            error.problem.detail.push_str("; a frame that only looks like that can be posted as frame records");
            error
        })
    }

    /// The header of the current record, once it is complete.
    fn header(&mut self, input: &mut &[u8]) -> Result<Option<FrameHeader>, ApiError> {
        if self.record.is_none() {
            let take = input.len().min(record::HEADER_BYTES - self.head.len());
            self.head.extend_from_slice(&input[..take]);
            *input = &input[take..];
            let header = match record::decode_header(&self.head, Kind::Positions, self.points) {
                Err(RecordError::Kind { .. }) => record::decode_header(&self.head, Kind::HandleRows, self.handles),
                other => other,
            };
            match header {
                Ok(header) => self.record = Some(header),
                Err(RecordError::Incomplete { .. }) => return Ok(None),
                Err(error) => return Err(refused(&error)),
            }
        }
        Ok(self.record)
    }
}

/// The number of a frame.
///
/// # Errors
/// It is beyond [`LAST_FRAME`].
fn numbered(frame: u64) -> Result<u32, ApiError> {
    u32::try_from(frame).ok().filter(|frame| *frame <= LAST_FRAME).ok_or_else(|| {
        let detail = format!("the frame numbers pass {LAST_FRAME}, the highest there is");
        ApiError::new(problem::INVALID_FRAME, detail)
    })
}

fn refused(error: &RecordError) -> ApiError {
    ApiError::new(problem::INVALID_FRAME, error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_proto::messages::{CacheUse, ConditionNumber, PreparationSeconds};

    fn facts() -> Facts {
        Facts {
            points: 5,
            handles_digest: String::new(),
            unknowns: 4,
            handle_count: 4,
            reads_handles_only: true,
            cage_vertices: 4,
            cage_faces: 4,
            spectrum: 0,
            condition_number: ConditionNumber { full: 1.0, handles: 1.0 },
            rank: 4,
            affine_reproduction_error: 0.0,
            cache: CacheUse::Miss,
            seconds: PreparationSeconds::default(),
            warnings: Vec::new(),
        }
    }

    fn read(layout: BodyLayout, body: &[u8], chunk: usize) -> Result<Vec<ReceivedFrame>, ApiError> {
        let mut reader = FrameReader::new(layout, &facts());
        let mut frames = Vec::new();
        for mut piece in body.chunks(chunk) {
            while !piece.is_empty() {
                frames.extend(reader.push(&mut piece)?);
            }
        }
        reader.finish().map(|()| frames)
    }

    #[test]
    fn frames_are_the_same_however_the_body_is_cut() {
        let body: Vec<u8> = (0..180u8).collect();
        let layout = BodyLayout::Raw { first: 7, rows: Rows::All };
        let whole = read(layout, &body, 1000).unwrap();
        assert_eq!(whole.iter().map(|f| f.frame).collect::<Vec<_>>(), [7, 8, 9]);
        assert_eq!(whole.iter().flat_map(|f| f.bytes.clone()).collect::<Vec<_>>(), body);
        for chunk in 1..100 {
            assert_eq!(read(layout, &body, chunk).unwrap(), whole, "chunks of {chunk}");
        }
        let handles = read(BodyLayout::Raw { first: 0, rows: Rows::Handles }, &body[..96], 5).unwrap();
        assert_eq!((handles.len(), handles[0].bytes.len()), (2, 48));
    }

    #[test]
    fn whole_frames_have_a_row_for_each_point_whatever_the_handles() {
        let facts = Facts { points: 1, handle_count: 3, ..facts() };
        let mut reader = FrameReader::new(BodyLayout::Raw { first: 0, rows: Rows::All }, &facts);
        let frame = reader.push(&mut &[0; 12][..]).unwrap().expect("a whole frame");
        assert_eq!(frame.bytes.len(), 12);
        reader.finish().unwrap();
    }

    #[test]
    fn records_are_the_same_however_the_body_is_cut() {
        let mut body = Vec::new();
        record::encode(Kind::Positions, 3, f32::NAN, f32::NAN, &[1.0; 15], &mut body).unwrap();
        record::encode(Kind::HandleRows, 9, f32::NAN, f32::NAN, &[2.0; 12], &mut body).unwrap();
        for chunk in 1..body.len() + 1 {
            let frames = read(BodyLayout::Records, &body, chunk).unwrap();
            assert_eq!(
                frames.iter().map(|f| (f.frame, f.rows)).collect::<Vec<_>>(),
                [(3, Rows::All), (9, Rows::Handles)]
            );
        }
        for cut in 1..88 {
            assert!(read(BodyLayout::Records, &body[..cut], 1000).is_err(), "cut at {cut}");
        }
        body[40] ^= 1;
        assert!(read(BodyLayout::Records, &body, 7).unwrap_err().problem.detail.contains("damaged"));
    }

    #[test]
    fn a_body_that_ends_within_a_frame_says_where() {
        let error = read(BodyLayout::Raw { first: 4, rows: Rows::All }, &[0; 70], 64).unwrap_err();
        assert!(error.problem.detail.contains("frame 5, after 10 of 60 bytes"), "{}", error.problem.detail);
        let last = |first, bytes: &[u8]| read(BodyLayout::Raw { first, rows: Rows::All }, bytes, 64);
        assert_eq!(last(LAST_FRAME, &[0; 60]).unwrap().len(), 1);
        for (first, bytes) in [(LAST_FRAME, &[0; 120][..]), (u32::MAX, &[0; 60])] {
            assert!(last(first, bytes).unwrap_err().problem.detail.contains("4294967294"));
        }
        let mut record = Vec::new();
        record::encode(Kind::Positions, u32::MAX, f32::NAN, f32::NAN, &[1.0; 15], &mut record).unwrap();
        assert!(read(BodyLayout::Records, &record, 64).unwrap_err().problem.detail.contains("4294967294"));
    }
}
