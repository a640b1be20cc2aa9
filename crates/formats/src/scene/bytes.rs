//! The bytes of a scene: every offset and size is compared with the length of the file before it is
//! followed, and tables take no more memory than such a file should.

use std::io::{Read, Seek, SeekFrom};

use crate::error::Fault;
use crate::frames::{Scalar, read_values};

/// The fault of whatever only damage explains.
pub(crate) fn damaged(what: &str) -> Fault {
    Fault::damaged(format!("{what}, so the file is damaged; copy or export it again"))
}

/// The rest of a table.
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl<'a> Fields<'a> {
    pub(crate) fn take(&mut self, length: usize) -> Result<&'a [u8], Fault> {
        self.0.split_off(..length).ok_or_else(|| damaged("a table ends too early"))
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        Ok(bytes)
    }

    /// Bytes behind how many they are, as `short` has that.
    pub(crate) fn sized(&mut self, width: u32) -> Result<&'a [u8], Fault> {
        let length = self.short(width)?;
        self.take(length)
    }

    /// A whole number of 1 << `width` bytes: 1, 2 or 4.
    pub(crate) fn short(&mut self, width: u32) -> Result<usize, Fault> {
        let bytes = self.take(1 << width.min(2))?;
        Ok(bytes.iter().rev().fold(0, |number, &byte| number << 8 | usize::from(byte)))
    }

    pub(crate) fn number(&mut self) -> Result<u64, Fault> {
        Ok(u64::from_le_bytes(self.array()?))
    }
}

/// A file, wherever it is.
pub(crate) trait ReadSeek: Read + Seek + Send {}

impl<T: Read + Seek + Send> ReadSeek for T {}

pub(crate) type Reader<'a> = Box<dyn ReadSeek + 'a>;

/// Bytes of tables that may still be read or unpacked: in a complete file no two overlap, and
/// a small file takes little memory.
pub(crate) struct Allowance(pub(crate) u64);

impl Allowance {
    /// So many elements of `size` bytes.
    pub(crate) fn take(&mut self, count: u64, size: u64) -> Result<usize, Fault> {
        let most = || damaged("its tables overlap, or unpack to more than such a file holds");
        self.0 = count.checked_mul(size).and_then(|bytes| self.0.checked_sub(bytes)).ok_or_else(most)?;
        usize::try_from(count).map_err(|_| most())
    }
}

/// A file that is read where it is asked for.
pub(crate) struct Source<'a> {
    source: Reader<'a>,
    pub(crate) length: u64,
    pub(crate) allowance: Allowance,
    block: Vec<u8>,
}

impl<'a> Source<'a> {
    pub(crate) fn new(source: Reader<'a>, length: u64, allowance: u64) -> Self {
        Self { source, length, allowance: Allowance(allowance), block: Vec::new() }
    }

    /// Whether so many elements of a size are there.
    pub(crate) fn check(&self, start: u64, count: u64, size: u64) -> Result<(), Fault> {
        let end = count.checked_mul(size).and_then(|length| start.checked_add(length));
        if end.is_none_or(|end| end > self.length) {
            return Err(damaged("an offset leads out of the file"));
        }
        Ok(())
    }

    pub(crate) fn bytes(&mut self, start: u64, count: u64, size: u64) -> Result<Vec<u8>, Fault> {
        self.check(start, count, size)?;
        // The number before them counts too, so that empty tables are not free.
        self.allowance.take(count * size + 8, 1)?;
        let mut bytes = vec![0; usize::try_from(count * size).unwrap_or(usize::MAX)];
        self.fill(start, &mut bytes)?;
        Ok(bytes)
    }

    pub(crate) fn array<const N: usize>(&mut self, start: u64) -> Result<[u8; N], Fault> {
        self.check(start, N as u64, 1)?;
        let mut bytes = [0; N];
        self.fill(start, &mut bytes)?;
        Ok(bytes)
    }

    pub(crate) fn number(&mut self, start: u64) -> Result<u64, Fault> {
        Ok(u64::from_le_bytes(self.array(start)?))
    }

    /// Numbers that are known to be there; gives whether all are finite.
    pub(crate) fn values(&mut self, start: u64, scalar: Scalar, out: &mut [f64]) -> Result<bool, Fault> {
        Ok(read_values(&mut self.source, start, scalar, &mut self.block, out)?)
    }

    /// Bytes that are known to be there.
    pub(crate) fn fill(&mut self, start: u64, out: &mut [u8]) -> Result<(), Fault> {
        self.source.seek(SeekFrom::Start(start))?;
        Ok(self.source.read_exact(out)?)
    }
}
