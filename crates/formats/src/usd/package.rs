//! Packages, `.usdz`: zip archives of files as they are, of which the first is the layer.

use std::borrow::Cow;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

use cager_geometry::surface::Picture;
use zip::{CompressionMethod, ZipArchive};

use crate::error::Fault;
use crate::scene::{Reader, damaged};

pub(super) const MAGIC: &[u8; 4] = b"PK\x03\x04";

struct Inside<'a> {
    source: Reader<'a>,
    start: u64,
    length: u64,
    at: u64,
}

/// The first file of a package of `length` bytes, and its own length.
pub(super) fn first(source: Reader<'_>, length: u64) -> Result<(Reader<'_>, u64), Fault> {
    let wrong = |_| damaged("its list of files cannot be read");
    let mut archive = ZipArchive::new(source).map_err(wrong)?;
    let (mut start, mut size) = (0, 0);
    for index in 0..archive.len().min(1) {
        let file = archive.by_index_raw(index).map_err(wrong)?;
        if file.compression() != CompressionMethod::Stored || file.encrypted() {
            let what = "is a package whose files are compressed or encrypted; pack it again with usdzip";
            return Err(Fault::unsupported(what));
        }
        (start, size) = (file.data_start().unwrap_or(u64::MAX), file.size());
    }
    if start.checked_add(size).is_none_or(|end| end > length) {
        return Err(damaged("an offset leads out of the package"));
    }
    let mut inside = Inside { source: archive.into_inner(), start, length: size, at: 0 };
    inside.rewind()?;
    Ok((Box::new(inside), size))
}

/// The other files of a package, as far as they are not compressed and do not overlap.
pub(super) fn others(source: Reader<'_>, length: u64) -> Result<(Reader<'_>, Vec<Picture>), Fault> {
    let wrong = |_| damaged("its list of files cannot be read");
    let mut archive = ZipArchive::new(source).map_err(wrong)?;
    let (mut left, mut files) = (length, Vec::new());
    for index in 1..archive.len() {
        let file = archive.by_index_raw(index).map_err(wrong)?;
        let size = left.checked_sub(file.size());
        let Some(rest) = size.filter(|_| file.compression() == CompressionMethod::Stored && file.is_file()) else {
            continue;
        };
        left = rest;
        let (Ok(path), mut bytes) = (file.name().map(Cow::into_owned), Vec::new()) else { continue };
        file.take(length).read_to_end(&mut bytes)?;
        files.push(Picture { path, bytes: Arc::from(bytes) });
    }
    Ok((archive.into_inner(), files))
}

impl Read for Inside<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = usize::try_from(self.length.saturating_sub(self.at)).unwrap_or(usize::MAX);
        let most = out.len().min(left);
        let read = self.source.read(&mut out[..most])?;
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for Inside<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(offset) => self.length.checked_add_signed(offset),
            SeekFrom::Current(offset) => self.at.checked_add_signed(offset),
        };
        let place = at.and_then(|at| Some((at, self.start.checked_add(at)?)));
        let (at, place) = place.ok_or(io::ErrorKind::InvalidInput)?;
        self.source.seek(SeekFrom::Start(place))?;
        self.at = at;
        Ok(at)
    }
}
