//! One file of a zip archive, unpacked while it is read: neither memory nor the disk ever hold the whole.

use std::io::{self, Read, Seek, SeekFrom, Take};
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
pub(super) struct Unpacked<R> {
    entry: Entry,
    /// Always there between calls.
    source: Option<Source<R>>,
    at: u64,
    /// Of all bytes so far; none once some were passed over.
    sum: Option<Crc>,
}

enum Source<R> {
    Stored(Take<R>),
    Deflated(Box<DeflateDecoder<Take<R>>>),
}

impl<R: Read + Seek> Unpacked<R> {
    pub(super) fn new(mut source: R, entry: &Entry) -> io::Result<Self> {
        source.seek(SeekFrom::Start(entry.start))?;
        let packed = source.take(entry.packed);
        let source = if entry.deflated {
            Source::Deflated(Box::new(DeflateDecoder::new(packed)))
        } else {
            Source::Stored(packed)
        };
        Ok(Self { entry: entry.clone(), source: Some(source), at: 0, sum: Some(Crc::new()) })
    }

    /// The archive.
    pub(super) fn into_inner(self) -> Option<R> {
        self.source.map(|source| match source {
            Source::Stored(packed) => packed.into_inner(),
            Source::Deflated(decoder) => decoder.into_inner().into_inner(),
        })
    }

    fn damaged(&self, why: &str) -> io::Error {
        let what =
            format!("cannot be unpacked ({why}); copy the file again, or save its arrays again with numpy.savez");
        io::Error::other(Fault::damaged(what).at(&self.entry.path))
    }

    fn restart(&mut self) -> io::Result<()> {
        let entry = self.entry.clone();
        let taken = Self { source: self.source.take(), entry: entry.clone(), at: 0, sum: None };
        let source = taken.into_inner().ok_or_else(|| self.damaged("it could not be read before"))?;
        *self = Self::new(source, &entry)?;
        Ok(())
    }
}

impl<R: Read + Seek> Read for Unpacked<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = usize::try_from(self.entry.length - self.at).unwrap_or(usize::MAX);
        let room = out.len().min(left);
        if room == 0 {
            return Ok(0);
        }
        let read = match &mut self.source {
            Some(Source::Stored(packed)) => packed.read(&mut out[..room]),
            Some(Source::Deflated(decoder)) => decoder.read(&mut out[..room]),
            None => Ok(0),
        };
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

impl<R: Read + Seek> Seek for Unpacked<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let wanted = super::layout::offset(self.at, self.entry.length, to)?;
        if wanted < self.at {
            self.restart()?;
        }
        match &mut self.source {
            // Whole frames are passed over; the header before the first is read, so that its checksum can be compared.
            Some(Source::Stored(packed)) if wanted - self.at > 1 << 17 => {
                let inside = wanted.min(self.entry.packed);
                packed.get_mut().seek(SeekFrom::Start(self.entry.start + inside))?;
                packed.set_limit(self.entry.packed - inside);
                (self.at, self.sum) = (wanted, None);
            }
            _ => {
                let between = wanted - self.at;
                io::copy(&mut self.by_ref().take(between), &mut io::sink())?;
            }
        }
        Ok(self.at)
    }
}
