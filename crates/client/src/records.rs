//! Splits a chunked byte stream into frame records.

use bytes::{Buf, BytesMut};
use cager_proto::record::{self, Kind, RecordError};

/// A solved cage.
#[derive(Clone, Debug, PartialEq)]
pub struct CageFrame {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// `sqrt(mean |e|²)` as a fraction of the rest diagonal, where it was measured.
    pub l2: Option<f32>,
    /// `max |e|` as a fraction of the rest diagonal, where it was measured.
    pub linf: Option<f32>,
    /// m × 3 values, interleaved.
    pub values: Vec<f32>,
}

/// Parses a stream of cage records as it comes. Holds at most one record and one chunk.
#[derive(Debug)]
pub(crate) struct CageRecords {
    /// Unknowns per frame, m: records of another size belong to no frame of this session.
    rows: u32,
    buffer: BytesMut,
}

impl CageRecords {
    pub(crate) fn new(rows: u32) -> Self {
        Self { rows, buffer: BytesMut::new() }
    }

    pub(crate) fn push(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// The next cage; `None` until more bytes come.
    pub(crate) fn next(&mut self) -> Result<Option<CageFrame>, RecordError> {
        let mut values = Vec::new();
        match record::decode(&self.buffer, Kind::Cage, self.rows, &mut values) {
            Ok((header, used)) => {
                self.buffer.advance(used);
                let measured = |x: f32| (!x.is_nan()).then_some(x);
                let (l2, linf) = (measured(header.l2), measured(header.linf));
                Ok(Some(CageFrame { frame: header.frame, l2, linf, values }))
            }
            Err(RecordError::Incomplete { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Bytes of a record that is not whole yet.
    pub(crate) fn pending(&self) -> usize {
        self.buffer.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chunks::{cut, cuts};
    use proptest::prelude::*;

    fn stream(frames: &[(u32, [f32; 6])]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (frame, values) in frames {
            record::encode(Kind::Cage, *frame, 0.5, f32::NAN, values, &mut bytes).expect("rows of three");
        }
        bytes
    }

    proptest! {
        #[test]
        fn records_are_found_however_the_stream_is_cut(
            frames in prop::collection::vec((any::<u32>(), prop::array::uniform6(-1e3_f32..1e3)), 0..6),
            cuts in cuts(),
        ) {
            let bytes = stream(&frames);
            let mut records = CageRecords::new(2);
            let mut found = Vec::new();
            for piece in cut(&bytes, &cuts) {
                records.push(piece);
                while let Some(cage) = records.next().expect("whole records") {
                    prop_assert_eq!((cage.l2, cage.linf), (Some(0.5), None));
                    found.push((cage.frame, <[f32; 6]>::try_from(cage.values).expect("two rows")));
                }
            }
            prop_assert_eq!(found, frames);
            prop_assert_eq!(records.pending(), 0);
        }

        #[test]
        fn garbage_is_refused_or_waits_but_is_never_a_cage(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut records = CageRecords::new(2);
            records.push(&bytes);
            prop_assert!(!matches!(records.next(), Ok(Some(_))));
        }
    }

    #[test]
    fn a_record_of_another_size_is_refused_before_its_rows_come() {
        let mut bytes = stream(&[(1, [0.0; 6])]);
        bytes[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        let mut records = CageRecords::new(2);
        records.push(&bytes[..28]);
        assert!(matches!(records.next(), Err(RecordError::Rows { found: u32::MAX, .. })));
    }

    #[test]
    fn a_page_in_place_of_records_is_refused_at_its_first_byte() {
        let mut records = CageRecords::new(2);
        records.push(b"<");
        assert_eq!(records.next(), Err(RecordError::NotARecord));
    }
}
