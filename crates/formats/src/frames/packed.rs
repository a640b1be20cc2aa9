//! One file of a zip archive, unpacked while it is read, as frames may be larger than memory.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;

use flate2::Crc;
use flate2::read::DeflateDecoder;

use crate::error::Fault;

/// Where a file lies in an archive, and how it is packed.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    /// Name of the archive in messages.
    pub(super) path: PathBuf,
    pub(super) start: u64,
    pub(super) packed: u64,
    pub(super) length: u64,
    pub(super) checksum: u32,
    pub(super) deflated: bool,
}

/// The bytes of an [`Entry`], and never more of them than the archive announces.
pub(super) struct Unpacked {
    entry: Entry,
    file: File,
    source: Box<dyn Read + Send>,
    at: u64,
    /// Of all bytes so far; none once some were passed over.
    sum: Option<Crc>,
}

impl Unpacked {
    /// Unpacks from the beginning; one reader of a file at a time, as all share its position.
    pub(super) fn new(file: &File, entry: &Entry) -> io::Result<Self> {
        let source = entry.source(file, 0)?;
        Ok(Self { entry: entry.clone(), file: file.try_clone()?, source, at: 0, sum: Some(Crc::new()) })
    }

    fn damaged(&self, why: &str) -> io::Error {
        let what =
            format!("cannot be unpacked ({why}); copy the file again, or save its arrays again with numpy.savez");
        io::Error::other(Fault::damaged(what).at(&self.entry.path))
    }
}

impl Entry {
    /// What is unpacked from an offset of the packed bytes on.
    fn source(&self, file: &File, from: u64) -> io::Result<Box<dyn Read + Send>> {
        let mut file = file.try_clone()?;
        file.seek(SeekFrom::Start(self.start + from))?;
        let packed = file.take(self.packed - from);
        Ok(if self.deflated { Box::new(DeflateDecoder::new(packed)) } else { Box::new(packed) })
    }
}

impl Read for Unpacked {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = usize::try_from(self.entry.length - self.at).unwrap_or(usize::MAX);
        let room = out.len().min(left);
        if room == 0 {
            return Ok(0);
        }
        let read = self.source.read(&mut out[..room]);
        let count = match read {
            Ok(0) => return Err(self.damaged("it ends too early")),
            Err(cause) if cause.kind() == io::ErrorKind::InvalidInput || cause.kind() == io::ErrorKind::InvalidData => {
                return Err(self.damaged(&cause.to_string()));
            }
            read => read?,
        };
        self.at += count as u64;
        if let Some(sum) = &mut self.sum {
            sum.update(&out[..count]);
            if self.at == self.entry.length && sum.sum() != self.entry.checksum {
                return Err(self.damaged("its checksum is another one"));
            }
        }
        Ok(count)
    }
}

impl Seek for Unpacked {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let wanted = super::layout::offset(self.at, self.entry.length, to)?;
        if wanted < self.at {
            *self = Self::new(&self.file, &self.entry)?;
        }
        let between = wanted - self.at;
        // Frames are passed over; the header is read, so that its checksum can be compared.
        if !self.entry.deflated && between > 1 << 17 {
            self.source = self.entry.source(&self.file, wanted.min(self.entry.packed))?;
            (self.at, self.sum) = (wanted, None);
        } else {
            io::copy(&mut self.by_ref().take(between), &mut io::sink())?;
        }
        Ok(self.at)
    }
}
