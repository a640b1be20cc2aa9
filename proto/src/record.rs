//! The frame record, `application/vnd.cager.frames`: a frame's rows with its number and its error.
//!
//! A record is a header of 28 bytes and `rows` × 3 `f32`, little-endian, one right after another;
//! `README.md` of this crate has the table. The checksum covers the rows only: whoever stores
//! records guards the header with one of their own.

use crate::le::{self, value_at};

/// The media type of a stream of records.
pub const MEDIA_TYPE: &str = "application/vnd.cager.frames";

/// Bytes of a record before its rows.
pub const HEADER_BYTES: usize = 28;

const MAGIC: [u8; 4] = *b"CGRF";
const VERSION: u16 = 1;

/// What the rows of a record are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum Kind {
    /// Positions of all points of the model.
    Positions = 1,
    /// Positions of the handles only, in the order of the handles.
    HandleRows = 2,
    /// A solved cage: its vertices, or what else the coordinate system has for unknowns.
    Cage = 3,
}

/// The header of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameHeader {
    /// What the rows are.
    pub kind: Kind,
    /// Number of the frame, from 0.
    pub frame: u32,
    /// Number of rows, three values each.
    pub rows: u32,
    /// Root mean square error of the frame as a fraction of the rest diagonal; NaN if not measured.
    pub l2: f32,
    /// Largest error of the frame as a fraction of the rest diagonal; NaN if not measured.
    pub linf: f32,
    /// CRC32C of the rows as bytes.
    pub crc: u32,
}

/// Why bytes are not the record that was expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// More bytes have to arrive before the record can be read.
    #[error("the frame record is cut short: {needed} bytes are needed and {have} are there; send the rest")]
    Incomplete {
        /// Bytes needed, from the start of the record, or of the rows for [`decode_rows`].
        needed: usize,
        /// Bytes there.
        have: usize,
    },
    /// The bytes do not start with a record.
    #[error("these bytes are not a frame record; send {MEDIA_TYPE}, each record right after the one before")]
    NotARecord,
    /// The record is of another version.
    #[error("the frame record has version {found}, but only version {VERSION} is read; send that one")]
    Version {
        /// The version found.
        found: u16,
    },
    /// The rows are something else than asked for.
    #[error("the frame record is of kind {found}, but kind {} was expected; send that one", *expected as u16)]
    Kind {
        /// The kind expected.
        expected: Kind,
        /// The kind found; known or not.
        found: u16,
    },
    /// The record has another number of rows than the frames of the session.
    #[error("frame {frame} has {found} rows, but {expected} were expected; send one row for each point or handle")]
    Rows {
        /// Number of the frame.
        frame: u32,
        /// Rows expected.
        expected: u32,
        /// Rows found.
        found: u32,
    },
    /// The rows are not those that were sent.
    #[error("the rows of frame {frame} arrived damaged (their checksum differs); send the frame again")]
    Checksum {
        /// Number of the frame.
        frame: u32,
    },
    /// The values to encode are not rows of three, or more rows than a record can count.
    #[error("{values} values do not make a frame record; give three for each of at most 4294967295 rows")]
    Shape {
        /// Number of values.
        values: usize,
    },
}

impl FrameHeader {
    /// The header as it is written.
    pub fn to_bytes(&self) -> Vec<u8> {
        [
            &MAGIC[..],
            &VERSION.to_le_bytes(),
            &(self.kind as u16).to_le_bytes(),
            &self.frame.to_le_bytes(),
            &self.rows.to_le_bytes(),
            &self.l2.to_le_bytes(),
            &self.linf.to_le_bytes(),
            &self.crc.to_le_bytes(),
        ]
        .concat()
    }

    /// Bytes of the rows.
    pub fn row_bytes(&self) -> u64 {
        12 * u64::from(self.rows)
    }
}

/// Appends the record of a frame with these rows, three values each; errors are NaN if unknown.
///
/// # Errors
/// [`RecordError::Shape`] if `values` is not made of rows of three; `out` is then left as it was.
pub fn encode(
    kind: Kind,
    frame: u32,
    l2: f32,
    linf: f32,
    values: &[f32],
    out: &mut Vec<u8>,
) -> Result<FrameHeader, RecordError> {
    let shape = RecordError::Shape { values: values.len() };
    if !values.len().is_multiple_of(3) {
        return Err(shape);
    }
    let rows = u32::try_from(values.len() / 3).map_err(|_| shape)?;
    let start = out.len();
    out.resize(start + HEADER_BYTES, 0);
    le::extend_f32(out, values);
    let crc = crc32c::crc32c(&out[start + HEADER_BYTES..]);
    let header = FrameHeader { kind, frame, rows, l2, linf, crc };
    out[start..start + HEADER_BYTES].copy_from_slice(&header.to_bytes());
    Ok(header)
}

/// Reads and checks the header at the start of `bytes`, so that callers can allocate for the rows.
///
/// # Errors
/// [`RecordError::Incomplete`] for fewer than [`HEADER_BYTES`] that could become a record; all
/// others but [`RecordError::Checksum`].
pub fn decode_header(bytes: &[u8], kind: Kind, rows: u32) -> Result<FrameHeader, RecordError> {
    let start = bytes.len().min(MAGIC.len());
    if bytes[..start] != MAGIC[..start] {
        return Err(RecordError::NotARecord);
    }
    if bytes.len() < HEADER_BYTES {
        return Err(RecordError::Incomplete { needed: HEADER_BYTES, have: bytes.len() });
    }
    let version = value_at(bytes, 4, u16::from_le_bytes);
    if version != VERSION {
        return Err(RecordError::Version { found: version });
    }
    let found = value_at(bytes, 6, u16::from_le_bytes);
    if found != kind as u16 {
        return Err(RecordError::Kind { expected: kind, found });
    }
    let header = FrameHeader {
        kind,
        frame: value_at(bytes, 8, u32::from_le_bytes),
        rows: value_at(bytes, 12, u32::from_le_bytes),
        l2: value_at(bytes, 16, f32::from_le_bytes),
        linf: value_at(bytes, 20, f32::from_le_bytes),
        crc: value_at(bytes, 24, u32::from_le_bytes),
    };
    if header.rows != rows {
        return Err(RecordError::Rows { frame: header.frame, expected: rows, found: header.rows });
    }
    Ok(header)
}

/// Reads the rows that follow a header into `out`: `rows` × 3 values, which may be NaN or infinite.
///
/// # Errors
/// [`RecordError::Incomplete`] or [`RecordError::Checksum`]; `out` is then empty.
pub fn decode_rows(header: &FrameHeader, bytes: &[u8], out: &mut Vec<f32>) -> Result<(), RecordError> {
    out.clear();
    let needed = usize::try_from(header.row_bytes()).unwrap_or(usize::MAX);
    let rows = bytes.get(..needed).ok_or(RecordError::Incomplete { needed, have: bytes.len() })?;
    if crc32c::crc32c(rows) != header.crc {
        return Err(RecordError::Checksum { frame: header.frame });
    }
    out.extend(le::values(rows, f32::from_le_bytes));
    Ok(())
}

/// Reads a record, its rows into `out`; returns its header and the bytes that it took.
///
/// # Errors
/// Those of [`decode_header`] and [`decode_rows`].
pub fn decode(bytes: &[u8], kind: Kind, rows: u32, out: &mut Vec<f32>) -> Result<(FrameHeader, usize), RecordError> {
    out.clear();
    let header = decode_header(bytes, kind, rows)?;
    decode_rows(&header, &bytes[HEADER_BYTES..], out).map_err(|error| match error {
        RecordError::Incomplete { needed, .. } => {
            RecordError::Incomplete { needed: needed.saturating_add(HEADER_BYTES), have: bytes.len() }
        }
        error => error,
    })?;
    Ok((header, HEADER_BYTES + 4 * out.len()))
}
