//! The bytes of a binary layer: every offset and size is compared with the length of the file before it is followed.

use std::io::{Read, Seek, SeekFrom};

use super::pack::Allowance;
use crate::frames::{Scalar, read_values};
use crate::scene::Failure;
use crate::usd::layer::damaged;

/// What a layer begins with.
pub(crate) const MAGIC: &[u8; 8] = b"PXR-USDC";

/// A value as fields have it: its type, and the value itself or where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rep(pub(super) u64);

impl Rep {
    pub(super) fn kind(self) -> u8 {
        (self.0 >> 48) as u8
    }

    pub(super) fn is_array(self) -> bool {
        self.0 >> 63 != 0
    }

    pub(super) fn is_inlined(self) -> bool {
        self.0 >> 62 & 1 != 0
    }

    pub(super) fn is_packed(self) -> bool {
        self.0 >> 61 & 1 != 0
    }

    /// Where the value is.
    pub(super) fn offset(self) -> u64 {
        self.0 & ((1 << 48) - 1)
    }

    /// The value itself.
    pub(super) fn inlined(self) -> [u8; 4] {
        (self.0 as u32).to_le_bytes()
    }
}

pub(super) struct File<R> {
    source: R,
    length: u64,
    /// The minor version of the format, of which the major one is 0.
    pub(super) version: u8,
    /// Bytes of tables that may still be read: the same one is read a few times at the most.
    pub(super) allowance: Allowance,
    block: Vec<u8>,
}

impl<R: Read + Seek> File<R> {
    pub(super) fn new(source: R, length: u64, version: u8) -> Self {
        // The sections once; then times and lists, many of which may be the same.
        let allowance = Allowance(length.saturating_mul(64).saturating_add(1 << 16));
        Self { source, length, version, allowance, block: Vec::new() }
    }

    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Whether so many elements of a size are there.
    pub(super) fn check(&self, start: u64, count: u64, size: u64) -> Result<(), Failure> {
        let end = count.checked_mul(size).and_then(|length| start.checked_add(length));
        if end.is_none_or(|end| end > self.length) {
            return Err(damaged("an offset leads out of the file").into());
        }
        Ok(())
    }

    /// Bytes of a table of so many elements.
    pub(super) fn bytes(&mut self, start: u64, count: u64, size: u64) -> Result<Vec<u8>, Failure> {
        self.check(start, count, size)?;
        let length = self.allowance.take(count * size, 1)?;
        let mut bytes = vec![0; length];
        self.source.seek(SeekFrom::Start(start))?;
        self.source.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// A few bytes.
    pub(super) fn array<const N: usize>(&mut self, start: u64) -> Result<[u8; N], Failure> {
        self.check(start, N as u64, 1)?;
        let mut bytes = [0; N];
        self.source.seek(SeekFrom::Start(start))?;
        self.source.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    pub(super) fn number(&mut self, start: u64) -> Result<u64, Failure> {
        Ok(u64::from_le_bytes(self.array(start)?))
    }

    /// Where the elements of an array begin, and how many they are.
    pub(super) fn elements(&mut self, rep: Rep) -> Result<(u64, u64), Failure> {
        let start = rep.offset();
        match (start, self.version) {
            (0, _) => Ok((0, 0)),
            // Behind the number of dimensions.
            (_, ..5) => Ok((start + 8, u32::from_le_bytes(self.array(start + 4)?).into())),
            (_, ..7) => Ok((start + 4, u32::from_le_bytes(self.array(start)?).into())),
            _ => Ok((start + 8, self.number(start)?)),
        }
    }

    pub(super) fn read_values(&mut self, start: u64, scalar: Scalar, out: &mut [f64]) -> Result<bool, Failure> {
        Ok(read_values(&mut self.source, start, scalar, &mut self.block, out)?)
    }
}
