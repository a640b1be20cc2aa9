//! Bytes of a layer one after another, alone or as the first file of a package.

use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;

use flate2::Crc;

/// Bytes before the values, which are written last.
const HEAD: usize = 88;
/// Where files of a package begin is a multiple of this.
const ALIGNED: usize = 64;
/// Bytes of the header before a file in a package, with its name.
const LOCAL: usize = 30;
/// Bytes of a name in a package at the most.
const LONGEST: usize = 1 << 12;

pub(super) struct Sink<W> {
    out: W,
    at: u64,
    package: Option<Package>,
}

/// A zip archive of files that are stored as they are, the layer first.
struct Package {
    name: String,
    before: usize,
    /// Of all but the head.
    crc: Crc,
}

impl<W: Write + Seek> Sink<W> {
    /// Begins a layer, or a package of a layer that is called `packed`.
    pub(super) fn new(mut out: W, packed: Option<String>) -> io::Result<Self> {
        let package = packed.map(|name| {
            // Filled up by a field of its own, whose header has four bytes.
            let before = (LOCAL + name.len() + 4).next_multiple_of(ALIGNED);
            Package { name, before, crc: Crc::new() }
        });
        out.write_all(&vec![0; package.as_ref().map_or(0, |package| package.before)])?;
        out.write_all(&[0; HEAD])?;
        Ok(Self { out, at: HEAD as u64, package })
    }

    /// Writes bytes; gives where they are.
    pub(super) fn put(&mut self, bytes: &[u8]) -> io::Result<u64> {
        let at = self.at;
        self.out.write_all(bytes)?;
        if let Some(package) = &mut self.package {
            package.crc.update(bytes);
        }
        self.at += bytes.len() as u64;
        Ok(at)
    }

    /// Fills up to where a value may begin.
    pub(super) fn align(&mut self) -> io::Result<()> {
        let missing = self.at.next_multiple_of(8) - self.at;
        self.put(&[0; 8][..missing as usize])?;
        Ok(())
    }

    /// Ends the layer with what it begins with, and the package around it with other files.
    pub(super) fn close(mut self, head: &[u8], files: &[(String, Arc<[u8]>)]) -> io::Result<W> {
        let mut first = [0; HEAD];
        first[..head.len()].copy_from_slice(head);
        let before = self.package.as_ref().map_or(0, |package| package.before);
        if let Some(package) = &self.package {
            if files.len() >= usize::from(u16::MAX) || files.iter().any(|(name, _)| name.len() > LONGEST) {
                return Err(io::Error::other(
                    "its pictures are too many, or have names that are too long, for a package",
                ));
            }
            let mut crc = Crc::new();
            crc.update(&first);
            crc.combine(&package.crc);
            let (name, length) = (package.name.as_str(), self.at as usize);
            let layer = Entry { name, at: 0, before, crc: crc.sum(), length };
            let (mut list, mut end) = (layer.central(), before + length);
            for (name, bytes) in files {
                let mut crc = Crc::new();
                crc.update(bytes);
                let before = (end + LOCAL + name.len() + 4).next_multiple_of(ALIGNED) - end;
                let entry = Entry { name, at: end, before, crc: crc.sum(), length: bytes.len() };
                self.out.write_all(&entry.local())?;
                self.out.write_all(bytes)?;
                list.extend(entry.central());
                end += before + bytes.len();
            }
            let (count, size) = (1 + files.len() as u16, list.len() as u32);
            list.extend(b"PK\x05\x06\0\0\0\0");
            list.extend([count, count].map(u16::to_le_bytes).concat());
            list.extend([size, end as u32].map(u32::to_le_bytes).concat());
            list.extend([0, 0]);
            self.out.write_all(&list)?;
            self.out.rewind()?;
            self.out.write_all(&layer.local())?;
        }
        self.out.seek(SeekFrom::Start(before as u64))?;
        self.out.write_all(&first)?;
        self.out.seek(SeekFrom::End(0))?;
        Ok(self.out)
    }
}

/// A file of a package.
struct Entry<'a> {
    name: &'a str,
    /// Where its header is, and how long that is.
    at: usize,
    before: usize,
    crc: u32,
    length: usize,
}

impl Entry<'_> {
    /// What stands before the file.
    fn local(&self) -> Vec<u8> {
        let filled = self.before - LOCAL - self.name.len();
        let own = [[0x86, 0x19], (filled as u16 - 4).to_le_bytes()].concat();
        let filling = (filled as u16).to_le_bytes();
        [b"PK\x03\x04", &self.common()[..], &filling, self.name.as_bytes(), &own, &vec![0; filled - 4]].concat()
    }

    /// What the list of all files has of it.
    fn central(&self) -> Vec<u8> {
        let at = (self.at as u32).to_le_bytes();
        [b"PK\x01\x02\x0a\0", &self.common()[..], &[0; 12], &at, self.name.as_bytes()].concat()
    }

    /// Version, whether the name is UTF-8, stored, 1 January 1980; then the sizes, and the length of
    /// the name.
    fn common(&self) -> Vec<u8> {
        let mut common = vec![10, 0, 0, 8 * u8::from(!self.name.is_ascii()), 0, 0, 0, 0, 0x21, 0];
        let length = self.length as u32;
        common.extend([self.crc, length, length].map(u32::to_le_bytes).concat());
        common.extend((self.name.len() as u16).to_le_bytes());
        common
    }
}
