//! The Ogawa container: blocks of data, and groups of the offsets of children; little-endian.

use std::io::{Read, Seek};

use crate::error::Fault;
use crate::frames::Scalar;
use crate::scene::{Allowance, MOST_OPERATIONS, Points, Reader, Source, Value, Values, damaged};
use crate::signature::Signature;

/// Set in the offset of a block of data, clear in that of a group.
pub(super) const DATA: u64 = 1 << 63;
/// Set in the value of positions of double precision, beyond all offsets.
pub(super) const DOUBLES: u64 = 1 << 62;
/// What an archive begins with: its name, whether it was closed, and the version of the container.
pub(super) const MAGIC: &[u8; 5] = b"Ogawa";
pub(super) const CLOSED: u8 = 0xff;
pub(super) const VERSION: [u8; 2] = [0, 1];
/// Bytes before the first group, the last eight of which are the offset of the root.
pub(super) const HEADER: usize = 16;
/// Bytes at the beginning of every sample that tell its contents apart from others.
pub(super) const DIGEST: u64 = 16;

/// Bytes of the file that are known to be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) start: u64,
    pub(super) length: u64,
}

pub(super) struct Container<'a> {
    pub(super) source: Source<'a>,
}

impl<'a> Container<'a> {
    /// Opens an archive of `length` bytes; gives the offset of its root too.
    pub(super) fn open(mut source: Reader<'a>, length: u64) -> Result<(Self, u64), Fault> {
        let mut head = Vec::new();
        source.rewind()?;
        source.by_ref().take(512).read_to_end(&mut head)?;
        let (Some(header), true) = (head.first_chunk::<HEADER>(), head.starts_with(MAGIC)) else {
            let other = Signature::other_than("abc", &head);
            let none = "does not begin as an Alembic archive does; export it again";
            return Err(Fault::damaged(other.unwrap_or_else(|| none.to_owned())));
        };
        if header[5] != CLOSED {
            return Err(Fault::damaged(
                "was never closed: the program that wrote it stopped before its end; export it again",
            ));
        }
        if header[6..8] != VERSION {
            let version = u16::from_be_bytes([header[6], header[7]]);
            let what =
                format!("is of version {version} of Ogawa, where version 1 is read; export it as Alembic 1.5 to 1.8");
            return Err(Fault::unsupported(what));
        }
        let [.., a, b, c, d, e, f, g, h] = *header;
        let root = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
        Ok((Self { source: Source::new(source, length, length) }, root))
    }

    /// Lets as many bytes of tables be read as the file has, `times` over.
    pub(super) fn allow(&mut self, times: u64) {
        self.source.allowance = Allowance(self.source.length.saturating_mul(times));
    }

    pub(super) fn children(&mut self, group: u64) -> Result<Vec<u64>, Fault> {
        let Some(block) = self.group(group)? else { return Ok(Vec::new()) };
        let bytes = self.table(block)?;
        Ok(bytes.as_chunks().0.iter().map(|bytes| u64::from_le_bytes(*bytes)).collect())
    }

    /// A block of data that is a table, not a sample.
    pub(super) fn contents(&mut self, data: u64) -> Result<Vec<u8>, Fault> {
        let block = self.data(data)?;
        self.table(block)
    }

    fn data(&mut self, data: u64) -> Result<Block, Fault> {
        if data & DATA == 0 {
            return Err(damaged("a group lies where data belong"));
        }
        match data & !DATA {
            0 => Ok(Block { start: 0, length: 0 }),
            at => self.sized(at, 1),
        }
    }

    /// Where the offsets of a group are; none of an empty one.
    fn group(&mut self, group: u64) -> Result<Option<Block>, Fault> {
        match group {
            0 => Ok(None),
            _ if group & DATA != 0 => Err(damaged("data lie where a group belongs")),
            at => self.sized(at, 8).map(Some),
        }
    }

    /// What follows its number of elements of `size` bytes.
    fn sized(&mut self, at: u64, size: u64) -> Result<Block, Fault> {
        let count = self.source.number(at)?;
        self.source.check(at + 8, count, size)?;
        Ok(Block { start: at + 8, length: count * size })
    }

    fn table(&mut self, Block { start, length }: Block) -> Result<Vec<u8>, Fault> {
        self.source.bytes(start, length, 1)
    }

    /// Where the numbers of a sample are, behind what tells its contents apart from others.
    pub(super) fn sample(&mut self, value: Value) -> Result<Block, Fault> {
        let Block { start, length } = self.data(value.0)?;
        if length > 0 && length < DIGEST {
            return Err(damaged("a sample is too short"));
        }
        let digest = DIGEST.min(length);
        Ok(Block { start: start + digest, length: length - digest })
    }

    /// The values of a sample, of `N` numbers each.
    pub(super) fn vectors<const N: usize>(&mut self, value: Value) -> Result<Vec<[f32; N]>, Fault> {
        let block = self.sample(value)?;
        let bytes = self.table(block)?;
        let numbers: Vec<f32> = bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        Ok(numbers.as_chunks().0.to_vec())
    }

    /// The bytes of a small sample, at most `most`. They are free, as every frame reads some.
    pub(super) fn small(&mut self, value: Value, most: u64, name: &str) -> Result<Vec<u8>, Fault> {
        let block = self.sample(value)?;
        if block.length > most {
            return Err(damaged(&format!("{name} has {} bytes where {most} are the most", block.length)));
        }
        let mut bytes = vec![0; block.length as usize];
        self.source.fill(block.start, &mut bytes)?;
        Ok(bytes)
    }
}

impl Values for Container<'_> {
    fn numbers(&mut self, value: Value) -> Result<Vec<f64>, Fault> {
        let bytes = self.small(value, 8 * 16 * MOST_OPERATIONS as u64, ".vals")?;
        Ok(bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    }

    fn integers(&mut self, value: Value, most: u64) -> Result<Vec<i32>, Fault> {
        let block = self.sample(value)?;
        if block.length / 4 > most {
            return Err(damaged(&format!("it has {} numbers of faces where {most} are the most", block.length / 4)));
        }
        Ok(self.table(block)?.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect())
    }

    fn points(&mut self, value: Value) -> Result<Points, Fault> {
        let scalar = if value.0 & DOUBLES == 0 { Scalar::F32Little } else { Scalar::F64Little };
        let Block { start, length } = self.sample(Value(value.0 & !DOUBLES))?;
        let size = 3 * scalar.size() as u64;
        if length % size != 0 {
            return Err(damaged("its positions end within a point"));
        }
        let count = usize::try_from(length / size).unwrap_or(usize::MAX);
        Ok(Points { start, count, scalar })
    }

    fn read(&mut self, points: Points, out: &mut [f64]) -> Result<bool, Fault> {
        self.source.values(points.start, points.scalar, out)
    }
}
