//! Writes the Ogawa container: children before their group, the root last.

use std::io::{self, Seek, SeekFrom, Write};

use crate::alembic::ogawa::{CLOSED, DATA, DIGEST, HEADER, MAGIC, VERSION};

/// Where the byte is that says whether an archive was closed, and where the offset of its root.
const CLOSED_AT: u64 = MAGIC.len() as u64;
const ROOT_AT: u64 = 8;

pub(super) type Digest = [u8; DIGEST as usize];

/// Tells contents apart: programs take samples of one digest for the same.
pub(super) fn digest(parts: &[&[u8]]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(part);
    }
    let mut digest = Digest::default();
    hasher.finalize_xof().fill(&mut digest);
    digest
}

pub(super) struct Sink<W> {
    out: W,
    at: u64,
}

impl<W: Write + Seek> Sink<W> {
    pub(super) fn new(mut out: W) -> io::Result<Self> {
        let mut header = [0; HEADER];
        header[..MAGIC.len()].copy_from_slice(MAGIC);
        header[6..8].copy_from_slice(&VERSION);
        out.write_all(&header)?;
        Ok(Self { out, at: HEADER as u64 })
    }

    /// Writes a block of data; gives the offset that its parent has.
    pub(super) fn data(&mut self, parts: &[&[u8]]) -> io::Result<u64> {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        if length == 0 {
            return Ok(DATA);
        }
        let at = self.at;
        self.put(&(length as u64).to_le_bytes())?;
        parts.iter().try_for_each(|part| self.put(part))?;
        Ok(at | DATA)
    }

    /// Writes a sample; one without values has no digest either.
    pub(super) fn sample(&mut self, bytes: &[u8]) -> io::Result<u64> {
        if bytes.is_empty() { Ok(DATA) } else { self.data(&[&digest(&[bytes]), bytes]) }
    }

    pub(super) fn group(&mut self, children: &[u64]) -> io::Result<u64> {
        if children.is_empty() {
            return Ok(0);
        }
        let at = self.at;
        self.put(&(children.len() as u64).to_le_bytes())?;
        children.iter().try_for_each(|child| self.put(&child.to_le_bytes()))?;
        Ok(at)
    }

    /// Says where the root is, and that the archive is whole.
    pub(super) fn close(mut self, root: u64) -> io::Result<W> {
        self.out.seek(SeekFrom::Start(ROOT_AT))?;
        self.out.write_all(&root.to_le_bytes())?;
        self.out.seek(SeekFrom::Start(CLOSED_AT))?;
        self.out.write_all(&[CLOSED])?;
        self.out.seek(SeekFrom::End(0))?;
        Ok(self.out)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}
