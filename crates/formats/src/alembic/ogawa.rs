//! The Ogawa container: blocks of data, and groups of the offsets of their children; all little-endian. Every offset and size is compared with the
//! length of the file before it is followed.

use std::io::{Read, Seek, SeekFrom};

use crate::error::Fault;
use crate::frames::{Scalar, read_values};
use crate::scene::{Failure, MOST_OPERATIONS, Points, Value, Values};
use crate::signature::Signature;

/// Set in the offset of a block of data, clear in that of a group.
pub(super) const DATA: u64 = 1 << 63;
/// What an archive begins with: its name, whether it was closed, and the version of the container.
pub(super) const MAGIC: &[u8; 5] = b"Ogawa";
pub(super) const CLOSED: u8 = 0xff;
pub(super) const VERSION: [u8; 2] = [0, 1];
/// Bytes before the first group, the last eight of which are the offset of the root.
pub(super) const HEADER: usize = 16;
/// Bytes at the beginning of every sample that tell its contents apart from others.
pub(super) const DIGEST: u64 = 16;

/// The fault of whatever only damage explains.
pub(super) fn damaged(what: &str) -> Fault {
    Fault::damaged(format!("{what}, so the archive is damaged; copy or export it again"))
}

/// Bytes of the file that are known to be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) start: u64,
    pub(super) length: u64,
}

pub(super) struct Container<R> {
    source: R,
    length: u64,
    /// Bytes of tables that may still be read: in an archive that is whole no two of them overlap.
    allowance: u64,
    /// How positions are stored.
    pub(super) scalar: Scalar,
    block: Vec<u8>,
}

impl<R: Read + Seek> Container<R> {
    /// Opens an archive of `length` bytes; gives the offset of its root too.
    pub(super) fn open(mut source: R, length: u64) -> Result<(Self, u64), Failure> {
        let mut head = Vec::new();
        source.rewind()?;
        source.by_ref().take(512).read_to_end(&mut head)?;
        let (Some(header), true) = (head.first_chunk::<HEADER>(), head.starts_with(MAGIC)) else {
            let other = Signature::other_than("abc", &head);
            let none = "does not begin as an Alembic archive does; export it again";
            return Err(Fault::damaged(other.unwrap_or_else(|| none.to_owned())).into());
        };
        if header[5] != CLOSED {
            return Err(Fault::damaged(
                "was never closed: the program that wrote it stopped before its end; export it again",
            )
            .into());
        }
        if header[6..8] != VERSION {
            let version = u16::from_be_bytes([header[6], header[7]]);
            let what =
                format!("is of version {version} of Ogawa, where version 1 is read; export it as Alembic 1.5 to 1.8");
            return Err(Fault::unsupported(what).into());
        }
        let [.., a, b, c, d, e, f, g, h] = *header;
        let root = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
        let (scalar, block) = (Scalar::F32Little, Vec::new());
        Ok((Self { source, length, allowance: length, scalar, block }, root))
    }

    /// Bytes of the file.
    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Lets as many bytes of tables be read as the file has, `times` over.
    pub(super) fn allow(&mut self, times: u64) {
        self.allowance = self.length.saturating_mul(times);
    }

    /// Reads what is known to be there.
    fn read_bytes(&mut self, start: u64, out: &mut [u8]) -> Result<(), Failure> {
        self.source.seek(SeekFrom::Start(start))?;
        Ok(self.source.read_exact(out)?)
    }

    /// The children of a group.
    pub(super) fn children(&mut self, group: u64) -> Result<Vec<u64>, Failure> {
        let Some(block) = self.group(group)? else { return Ok(Vec::new()) };
        let bytes = self.table(block)?;
        Ok(bytes.as_chunks().0.iter().map(|bytes| u64::from_le_bytes(*bytes)).collect())
    }

    /// A block of data that is a table, not a sample.
    pub(super) fn contents(&mut self, data: u64) -> Result<Vec<u8>, Failure> {
        let block = self.data(data)?;
        self.table(block)
    }

    /// Where the bytes of data are.
    fn data(&mut self, data: u64) -> Result<Block, Failure> {
        if data & DATA == 0 {
            return Err(damaged("a group lies where data belong").into());
        }
        match data & !DATA {
            0 => Ok(Block { start: 0, length: 0 }),
            at => self.sized(at, 1),
        }
    }

    /// Where the offsets of a group are; none of an empty one.
    fn group(&mut self, group: u64) -> Result<Option<Block>, Failure> {
        match group {
            0 => Ok(None),
            _ if group & DATA != 0 => Err(damaged("data lie where a group belongs").into()),
            at => self.sized(at, 8).map(Some),
        }
    }

    /// What follows its number of elements of `size` bytes.
    fn sized(&mut self, at: u64, size: u64) -> Result<Block, Failure> {
        let outside = || damaged("an offset leads out of the file");
        if at.checked_add(8).is_none_or(|start| start > self.length) {
            return Err(outside().into());
        }
        let (start, count) = (at + 8, self.number(at)?);
        let length = count.checked_mul(size).filter(|&length| length <= self.length - start).ok_or_else(outside)?;
        Ok(Block { start, length })
    }

    fn number(&mut self, at: u64) -> Result<u64, Failure> {
        let mut bytes = [0; 8];
        self.read_bytes(at, &mut bytes)?;
        Ok(u64::from_le_bytes(bytes))
    }

    /// The bytes of a table.
    pub(super) fn table(&mut self, block: Block) -> Result<Vec<u8>, Failure> {
        // The number before the bytes counts too, so that empty tables are not free.
        let overlap = || damaged("its tables overlap");
        self.allowance = self.allowance.checked_sub(block.length.saturating_add(8)).ok_or_else(overlap)?;
        let mut bytes = vec![0; usize::try_from(block.length).map_err(|_| overlap())?];
        self.read_bytes(block.start, &mut bytes)?;
        Ok(bytes)
    }

    /// Where the numbers of a sample are, behind what tells its contents apart from others.
    pub(super) fn sample(&mut self, value: Value) -> Result<Block, Failure> {
        let Block { start, length } = self.data(value.0)?;
        if length > 0 && length < DIGEST {
            return Err(damaged("a sample is too short").into());
        }
        let digest = DIGEST.min(length);
        Ok(Block { start: start + digest, length: length - digest })
    }

    /// The bytes of a sample that is small: `most` at the most. They cost nothing, as some are read for every frame.
    pub(super) fn small(&mut self, value: Value, most: u64, name: &str) -> Result<Vec<u8>, Failure> {
        let block = self.sample(value)?;
        if block.length > most {
            return Err(damaged(&format!("{name} has {} bytes where {most} are the most", block.length)).into());
        }
        let mut bytes = vec![0; block.length as usize];
        self.read_bytes(block.start, &mut bytes)?;
        Ok(bytes)
    }
}

impl<R: Read + Seek + Send> Values for Container<R> {
    fn numbers(&mut self, value: Value) -> Result<Vec<f64>, Failure> {
        let bytes = self.small(value, 8 * 16 * MOST_OPERATIONS as u64, ".vals")?;
        Ok(bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    }

    fn integers(&mut self, value: Value, most: u64) -> Result<Vec<i32>, Failure> {
        let block = self.sample(value)?;
        if block.length / 4 > most {
            return Err(
                damaged(&format!("it has {} numbers of faces where {most} are the most", block.length / 4)).into()
            );
        }
        Ok(self.table(block)?.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect())
    }

    fn points(&mut self, value: Value) -> Result<Points, Failure> {
        let Block { start, length } = self.sample(value)?;
        let size = 3 * self.scalar.size() as u64;
        if length % size != 0 {
            return Err(damaged("its positions end within a point").into());
        }
        let count = usize::try_from(length / size).unwrap_or(usize::MAX);
        Ok(Points { start, count, scalar: self.scalar })
    }

    fn read(&mut self, points: Points, out: &mut [f64]) -> Result<bool, Failure> {
        Ok(read_values(&mut self.source, points.start, points.scalar, &mut self.block, out)?)
    }
}
